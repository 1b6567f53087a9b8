"""Gap map of Newton's cradle: from which gap on an engine gives the ideal pattern."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Plot, Section, Table, columns, records
from crossbody.reports.runs.study import read_json

TITLE = "Gap map"
CASES = ("newtons_cradle",)
TEXT = (
    "Sliders, one ball in, elastic; s = gap sqrt(a0) / v is the gap over the deepest penetration of one pair. Where "
    "collisions overlap the law itself makes energy and no row gives the ideal pattern; each line shows from which gap "
    "on an engine does. All values are ratios to what came in. A run that failed is a cross, never dropped."
)
COLUMNS = columns(
    n=("Balls", Kind.NUMBER), who="Engine", machine="Law or rule", most=("Most energy created", Kind.NUMBER),
    at_s=("at s", Kind.NUMBER), at_touch="Touching, nearest to", ideal_from=("Ideal from s", Kind.NUMBER),
    failed=("Failed", Kind.NUMBER), why=("Says", Kind.LONG),
)  # fmt: skip


def sections(out: Path) -> tuple[Section, ...]:
    """One section, if there is a map."""
    if not (out / "gapmap.json").is_file():
        return ()
    from crossbody.reports.maps.gapmap import summary
    from crossbody.reports.maps.gapmap_figure import gap_map

    rows = pd.DataFrame(read_json(out / "gapmap.json")["rows"])
    lines = summary(rows)
    lines["who"] = lines["engine"] + ":" + lines["profile"]
    table = Table(title="Gap map, a line an engine", columns=COLUMNS, rows=records(lines), file="gapmap.csv")
    plot = Plot(name="gap-map", figure=gap_map(rows))
    return (Section(name="gapmap", title="Gap map of Newton's cradle", text=TEXT, plots=(plot,), tables=(table,)),)
