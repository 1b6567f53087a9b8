"""The stability map as a figure: one field an engine, stiffness across, tolerance or step upwards, error as colour."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

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
