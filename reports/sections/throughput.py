"""Many runs at once: the compiled reference in threads beside MuJoCo's batch."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Section, Table, columns, records
from crossbody.reports.runs.study import read_json

TITLE = "Throughput"
TEXT = (
    "Ratios of runs a second, interleaved on the same cores. Two threads are judged only where the machine gives two "
    "cores to two threads that do nothing but count."
)
COLUMNS = columns(
    what="What", value=("Value", Kind.NUMBER), unit="Unit", limit=("Limit", Kind.NUMBER), held="Held",
    beside=("Made of", Kind.LONG), how=("How", Kind.LONG),
)  # fmt: skip


def sections(out: Path) -> tuple[Section, ...]:
    """One section, if it was measured."""
    if not (out / "throughput.json").is_file():
        return ()
    rows = pd.DataFrame(read_json(out / "throughput.json")["rows"])
    table = Table(title=TITLE, columns=COLUMNS, rows=records(rows), file="throughput.csv")
    return (Section(name="throughput", title=TITLE, text=TEXT, tables=(table,)),)
