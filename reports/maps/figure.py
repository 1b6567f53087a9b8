"""Maps as figures: the gap map, the stability map of the maze, and the one of the engines under stress."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from crossbody.reports.figures.styles import COLOURS, DASHES
from crossbody.reports.maps.gapmap import PATTERN

ROWS = {"energy_created": "energy created / energy in", PATTERN: "pattern distance / speed in"}


def gap_map(rows: pd.DataFrame) -> go.Figure:
    """Two plots a number of balls; a run that failed is a cross on the axis.

    Args:
        rows: as `crossbody.reports.maps.gapmap.gap_map` gives them.
    """
    drawn = rows[rows["s"].notna()]
    counts = list(dict.fromkeys(drawn["n"])) or [0]
    figure = make_subplots(
        rows=len(ROWS), cols=len(counts), shared_xaxes=True, column_titles=[f"{n} balls" for n in counts],
        vertical_spacing=0.08, horizontal_spacing=0.09,
    )  # fmt: skip
    styles: dict[str, int] = {}
    for (n, engine, profile, machine), group in drawn.groupby(["n", "engine", "profile", "machine"], sort=False):
        name = f"{engine}:{profile}, {machine}"
        first = name not in styles
        style = styles.setdefault(name, len(styles))
        for i, column in enumerate(ROWS, start=1):
            for trace in _traces(group, column, name, style, first and i == 1):
                figure.add_trace(trace, row=i, col=counts.index(n) + 1)
    for i, title in enumerate(ROWS.values(), start=1):
        figure.update_yaxes(title_text=title, row=i, col=1)
    figure.update_xaxes(title_text="s = gap sqrt(a0) / v", row=len(ROWS))
    figure.update_layout(title_text="Gap map: energy created, and distance to the ideal pattern", height=760)
    return figure


def _traces(group: pd.DataFrame, column: str, name: str, style: int, legend: bool) -> list[go.Scatter]:
    values = pd.to_numeric(group[column])
    line = {"color": COLOURS[style % len(COLOURS)], "dash": DASHES[style % len(DASHES)], "width": 1.8}
    found = [
        go.Scatter(
            x=group["s"].astype(float), y=values, name=name, legendgroup=name, showlegend=legend, mode="lines",
            line=line,
        )
    ]  # fmt: skip
    failed = group[group["outcome"] != "finished"]
    if len(failed):
        found.append(
            go.Scatter(
                x=failed["s"].astype(float), y=[0.0] * len(failed), name=f"{name}: failed", legendgroup=name,
                showlegend=legend, mode="markers", marker={"symbol": "x", "size": 8, "color": line["color"]},
                text=failed["why"].astype(str), hoverinfo="text",
            )
        )  # fmt: skip
    return found


ENDS = (("arrived", "in the centre", "circle", COLOURS[2]), ("lost", "not there at the end", "x", COLOURS[3]))
LINE = 17
"""Height of one scene, pixels."""


def stability(rows: pd.DataFrame) -> go.Figure:
    """When the ball arrived, or until when it ran.

    Args:
        rows: as `crossbody.reports.maps.stability.stability_map` gives them.
    """
    drawn = rows[rows["ended"].notna()].iloc[::-1]
    names = drawn["scene"].where(drawn["scene"] != "", "default")
    several = drawn["engine"].nunique() > 1
    labels = drawn["engine"] + ": " + names if several else names
    arrived = drawn["arrived"].astype(bool)
    figure = go.Figure()
    for key, name, symbol, colour in ENDS:
        shown = arrived if key == "arrived" else ~arrived
        when = drawn["arrival"] if key == "arrived" else drawn["ended"]
        figure.add_trace(
            go.Scatter(
                x=when[shown].astype(float), y=labels[shown], name=name, mode="markers",
                marker={"symbol": symbol, "size": 9, "color": colour},
                text="expected: " + drawn["expected"][shown], hoverinfo="x+y+text",
            )
        )  # fmt: skip
    figure.update_xaxes(title_text="arrival in the centre, or end of the run [s]")
    figure.update_yaxes(categoryorder="array", categoryarray=labels.tolist(), automargin=True)
    figure.update_layout(title_text="Stability map of the ball maze", height=180 + LINE * len(drawn))
    return figure


BEST, WORST = -12.0, 2.0
"""Decades of error that the colours tell apart."""
FIELD = 240
"""Height of a row of fields, pixels."""


def stress_map(cells: pd.DataFrame) -> go.Figure:
    """Two fields a row; a cross where a run did not finish.

    Args:
        cells: as `crossbody.reports.sweep.map.stability_map` gives them.
    """
    drawn = cells[cells["finished"].notna() & (cells["knob"] != "")]
    groups = [(key, group) for key, group in drawn.groupby(["engine", "profile", "knob"], sort=False)]
    rows = max(-(-len(groups) // 2), 1)
    titles = [f"{engine}:{profile}" for (engine, profile, _), _ in groups]
    figure = make_subplots(rows=rows, cols=2, subplot_titles=titles, vertical_spacing=0.4 / rows)
    for i, ((_, _, knob), group) in enumerate(groups):
        row, column = i // 2 + 1, i % 2 + 1
        figure.add_trace(_field(group, i == 0), row=row, col=column)
        figure.add_trace(_failed(group), row=row, col=column)
        figure.update_yaxes(type="log", title_text="rtol" if knob == "rtol" else "dt [s]", row=row, col=column)
        figure.update_xaxes(type="log", title_text="a0 [1/s^2]", row=row, col=column)
    figure.update_xaxes(exponentformat="power")
    figure.update_yaxes(exponentformat="power", dtick=1)
    figure.update_layout(
        title_text="Stability map: worst error over damping ratios 0 to 10", height=120 + FIELD * rows, showlegend=False
    )
    return figure


def _field(group: pd.DataFrame, scale: bool) -> go.Scatter:
    known = group[group["worst_error"].notna()]
    colours = np.log10(known["worst_error"].astype(float).clip(10.0**BEST, 10.0**WORST))
    return go.Scatter(
        **_places(known),
        marker={
            "symbol": "square", "size": 15, "color": colours, "cmin": BEST, "cmax": WORST, "colorscale": "Viridis_r",
            "showscale": scale, "colorbar": {"title": {"text": "log10 error"}},
        },
    )  # fmt: skip


def _failed(group: pd.DataFrame) -> go.Scatter:
    bad = group[group["finished"].astype(float) < group["runs"].astype(float)]
    return go.Scatter(**_places(bad), marker={"symbol": "x-thin", "size": 9, "line": {"width": 2, "color": "crimson"}})


def _places(cells: pd.DataFrame) -> dict[str, Any]:
    """Where cells stand, and what is told of them."""
    return {
        "x": cells["a0"].astype(float), "y": cells["setting"].astype(float), "mode": "markers",
        "hoverinfo": "x+y+text", "text": [_words(row) for row in cells.to_dict(orient="records")],
    }  # fmt: skip


def _words(row: dict[Hashable, Any]) -> str:
    told = f"{row['finished']} of {row['runs']} finished"
    if not pd.isna(row["worst_error"]):
        told += f", worst error {row['worst_error']:.2g}"
    return f"{told}; {row['outcomes']}" if row["outcomes"] else told
