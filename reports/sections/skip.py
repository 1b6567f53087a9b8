"""What a scene does not need costs nothing: ratios within one run, and counts."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Section, Table, columns, records
from crossbody.reports.runs.study import read_json

TITLE = "What is skipped"
TEXT = "Each ratio is of the shortest of interleaved runs; counts are of one run and the same every time."
COLUMNS = columns(
    what="What", value=("Value", Kind.NUMBER), unit="Unit", limit=("Limit", Kind.NUMBER), held="Held",
    beside=("Made of", Kind.LONG), how=("How", Kind.LONG),
)  # fmt: skip


def sections(out: Path) -> tuple[Section, ...]:
    """One section, if it was measured."""
    if not (out / "skip.json").is_file():
        return ()
    rows = pd.DataFrame(read_json(out / "skip.json")["rows"])
    table = Table(title=TITLE, columns=COLUMNS, rows=records(rows), file="skip.csv")
    return (Section(name="skip", title=TITLE, text=TEXT, tables=(table,)),)
