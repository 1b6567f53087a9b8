"""Stability map of the ball maze: from which scenes the ball still comes to the centre."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Plot, Section, Table, columns, records
from crossbody.reports.runs.study import read_json

TITLE = "Stability map"
CASES = ("ball_maze",)
TEXT = (
    "The closed loop with one thing changed at a time: bounds, gains, the model that the controller believes in, the "
    "start, sampling and noise. Where the ball tumbles through several rings either end is possible."
)
COLUMNS = columns(
    who="Engine", scene="Scene", expected="Published", outcome="Outcome", arrival=("Arrival [s]", Kind.NUMBER),
    ended=("End [s]", Kind.NUMBER), changes=("Rings passed", Kind.NUMBER), why=("Says", Kind.LONG),
)  # fmt: skip


def sections(out: Path) -> tuple[Section, ...]:
    """One section, if there is a map."""
    if not (out / "stability.json").is_file():
        return ()
    from crossbody.reports.maps.stability_figure import stability

    rows = pd.DataFrame(read_json(out / "stability.json")["rows"])
    plot = Plot(name="stability-map", figure=stability(rows))
    shown = rows.assign(who=rows["engine"] + ":" + rows["profile"], scene=rows["scene"].replace("", "default"))
    table = Table(title="Stability map, a line a scene", columns=COLUMNS, rows=records(shown), file="stability.csv")
    title = "Stability map of the ball maze"
    return (Section(name="stability", title=title, text=TEXT, plots=(plot,), tables=(table,)),)
