"""The compiled reference beside every engine: ratio of run times at the error that the engine reaches."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Section, Table, columns, records
from crossbody.reports.runs.study import read_json

TITLE = "Lead of the reference"
TEXT = (
    "For each engine its best error and the time that it took there, beside the cheapest run of the compiled reference "
    "that is at least as accurate. The least ratio is that of all errors which the engine reaches. Errors below 1e-13, "
    "or below what a truth of tier C is known to, count as that. An engine that follows another law is judged against "
    "that law's truth. What of an engine's run is Python is said beside its ratio; its own loop alone makes the same "
    "steps natively, without record, events, and what of the law is Python."
)
COLUMNS = columns(
    case="Case", who="Engine", tier="Tier", against="Against the truth of", best_error=("Best error", Kind.NUMBER),
    engine_ms=("Its run [ms]", Kind.NUMBER), reference_ms=("Reference [ms]", Kind.NUMBER),
    ratio=("Ratio", Kind.NUMBER), ratio_call=("Ratio of the Python calls", Kind.NUMBER),
    ratio_native=("Its own loop alone", Kind.NUMBER), least_ratio=("Least ratio", Kind.NUMBER),
    interpreted=("Interpreted in its run", Kind.LONG), ahead="Ahead at every error", says=("Says", Kind.LONG),
)  # fmt: skip


def sections(out: Path) -> tuple[Section, ...]:
    """One section, if engines were timed."""
    if not (out / "headline.json").is_file():
        return ()
    rows = pd.DataFrame(read_json(out / "headline.json")["rows"])
    if len(rows):
        rows = rows.assign(who=rows["engine"] + ":" + rows["profile"])
    table = Table(title=TITLE, columns=COLUMNS, rows=records(rows), file="headline.csv")
    return (Section(name="headline", title="How much faster the reference is", text=TEXT, tables=(table,)),)
