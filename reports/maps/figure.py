"""Maps as figures: the gap map, the stability map of the maze, and the one of the engines under stress."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
import pandas as pd

from crossbody.reports.figures.section import Figure
from crossbody.reports.figures.styles import COLOURS, DASHES, Panels, look, plain
from crossbody.reports.maps.gapmap import PATTERN

FAILED = {"symbol": "x-thin", "size": 9, "line": {"width": 2, "color": "crimson"}}
ROWS = {"energy_created": "energy created / energy in", PATTERN: "pattern distance / speed in"}


def gap_map(rows: pd.DataFrame) -> Figure:
    """Two plots a number of balls, of rows of `maps.gapmap`; a run that failed is a cross on the axis."""
    drawn = rows[rows["s"].notna()]
    counts = list(dict.fromkeys(drawn["n"])) or [0]
    panels = Panels(
        "Gap map: energy created, and distance from the ideal pattern", 760, rows=len(ROWS),
        cols=len(counts), gap=0.08, heads=[f"{n} balls" for n in counts],
    )  # fmt: skip
    styles: dict[str, int] = {}
    for (n, engine, profile, machine), group in drawn.groupby(["n", "engine", "profile", "machine"], sort=False):
        name = f"{engine}:{profile}, {machine}"
        first = name not in styles
        style = styles.setdefault(name, len(styles))
        for i, column in enumerate(ROWS, start=1):
            for trace in _traces(group, column, name, style, first and i == 1):
                panels.add(i, counts.index(n) + 1, **trace)
    for i, title in enumerate(ROWS.values(), start=1):
        panels.axes("y", i, 1, title=title)
    panels.axes("x", len(ROWS), title="s = gap sqrt(a0) / v")
    return panels.figure()


def _traces(group: pd.DataFrame, column: str, name: str, style: int, legend: bool) -> list[dict[str, Any]]:
    values = pd.to_numeric(group[column])
    who = name.partition(",")[0]  # of one engine's machines each has a dash of its own
    line = {"color": look(who)["color"], "dash": DASHES[style % len(DASHES)], "width": 1.8}
    usual = {"name": name, "legendgroup": name, "showlegend": legend}
    found = [usual | {"x": group["s"].astype(float), "y": values, "mode": "lines", "line": line}]
    failed = group[group["outcome"] != "finished"]
    if len(failed):
        found.append(usual | {
            "x": failed["s"].astype(float), "y": [0.0] * len(failed), "name": f"{name}: failed",
            "mode": "markers", "marker": {"symbol": "x", "size": 8, "color": line["color"]},
            "text": failed["why"].astype(str), "hoverinfo": "text",
        })  # fmt: skip
    return found


ENDS = (("arrived", "in the centre", "circle", COLOURS[2]), ("lost", "not in the centre at the end", "x", COLOURS[3]))
LINE, LABEL = 17, 48  # height of one scene, pixels, and the characters of its label, which leave the plot its room


def stability(rows: pd.DataFrame) -> Figure:
    """When the ball arrived, or until when it ran, of rows of `maps.stability.stability_map`."""
    drawn = rows[rows["ended"].notna()].iloc[::-1]
    names = drawn["scene"].where(drawn["scene"] != "", "default")
    several = drawn["engine"].nunique() > 1
    labels = drawn["engine"] + ": " + names if several else names
    arrived = drawn["arrived"].astype(bool)
    short = [plain(label if len(label) <= LABEL else label[: LABEL - 1] + "…") for label in labels]
    panels = Panels("Stability map of the ball maze", 180 + LINE * len(drawn))
    for key, name, symbol, colour in ENDS:
        shown = arrived if key == "arrived" else ~arrived
        when = drawn["arrival"] if key == "arrived" else drawn["ended"]
        panels.add(
            x=when[shown].astype(float), y=labels[shown], name=name, mode="markers",
            marker={"symbol": symbol, "size": 9, "color": colour},
            text="expected: " + drawn["expected"][shown], hoverinfo="x+y+text",
        )  # fmt: skip
    panels.axes("x", title="arrival, or end of the run [s]")
    panels.axes(
        "y",
        categoryorder="array",
        categoryarray=labels.tolist(),
        automargin=True,
        tickvals=labels.tolist(),
        ticktext=short,
        range=[-0.7, len(short) - 0.3],
    )
    return panels.figure(legend={"orientation": "h", "y": 1.0, "yanchor": "bottom"})


BEST, WORST = -12.0, 2.0  # decades of error that the colours tell apart
FIELD = 240  # height of a row of fields, pixels


def stress_map(cells: pd.DataFrame) -> Figure:
    """Two fields a row of `sweep.map.stability_map`; a cross where a run did not finish."""
    drawn = cells[cells["finished"].notna() & (cells["knob"] != "")]
    groups = [(key, group) for key, group in drawn.groupby(["engine", "profile", "knob"], sort=False)]
    rows = max(-(-len(groups) // 2), 1)
    titles = [f"{engine}:{profile}" for (engine, profile, _), _ in groups]
    title, height = "Stability map: largest error over damping ratios 0 to 10", 120 + FIELD * rows
    panels = Panels(
        title, height, rows=rows, cols=min(max(len(groups), 1), 2), gap=0.4 / rows, heads=titles, shared=False
    )
    for i, ((_, _, knob), group) in enumerate(groups):
        row, column = i // 2 + 1, i % 2 + 1
        panels.add(row, column, **_field(group, i == 0))
        failed = group[group["finished"].astype(float) < group["runs"].astype(float)]
        panels.add(row, column, **_places(failed), marker=FAILED)
        panels.axes("y", row, column, type="log", title="rtol" if knob == "rtol" else "dt [s]")
        panels.axes("x", row, column, type="log", title="a0 [1/s^2]")
    panels.axes("x", exponentformat="power")
    panels.axes("y", exponentformat="power", dtick=1)
    return panels.figure(showlegend=False)


def _field(group: pd.DataFrame, scale: bool) -> dict[str, Any]:
    known = group[group["worst_error"].notna()]
    colours = np.log10(known["worst_error"].astype(float).clip(10.0**BEST, 10.0**WORST))
    marker = {
        "symbol": "square", "size": 15, "color": colours, "cmin": BEST, "cmax": WORST,
        "colorscale": "Viridis", "reversescale": True, "showscale": scale,
        "colorbar": {"title": {"text": "log10 error"}},
    }  # fmt: skip
    return _places(known) | {"marker": marker}


def _places(cells: pd.DataFrame) -> dict[str, Any]:
    """Where cells stand, and what is written on them."""
    return {
        "x": cells["a0"].astype(float), "y": cells["setting"].astype(float), "mode": "markers",
        "hoverinfo": "x+y+text", "text": [_words(row) for row in cells.to_dict(orient="records")],
    }  # fmt: skip


def _words(row: dict[Hashable, Any]) -> str:
    told = f"{row['finished']} of {row['runs']} finished"
    if not pd.isna(row["worst_error"]):
        told += f", worst error {row['worst_error']:.2g}"
    return f"{told}; {row['outcomes']}" if row["outcomes"] else told
