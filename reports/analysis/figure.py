"""Figures of an analysis: poles, loci, responses, and the stability of a workspace."""

from __future__ import annotations

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from crossbody.reports.analysis.bode import OUTPUTS, UNITS
from crossbody.reports.figures.styles import COLOURS, DASHES

RESPONDING = 1e-12
"""Part of the largest magnitude below which a response is none."""


def pole_figure(rows: pd.DataFrame) -> go.Figure:
    """Poles of every place in the complex plane."""
    figure = go.Figure()
    for i, (place, group) in enumerate(rows.groupby("place", sort=False)):
        marker = {"symbol": "x", "size": 9, "color": COLOURS[i % len(COLOURS)]}
        figure.add_trace(go.Scatter(x=group["real"], y=group["imag"], name=str(place), mode="markers", marker=marker))
    return _plane(figure, "Poles of the linear models")


def locus_figure(rows: pd.DataFrame) -> go.Figure:
    """Branches of every place over a parameter; a cross at its first value, a circle at its last."""
    figure = go.Figure()
    for i, (place, group) in enumerate(rows.groupby("place", sort=False)):
        for j, (_, line) in enumerate(group.groupby("branch", sort=True)):
            symbols = ["x", *[None] * (len(line) - 2), "circle"] if len(line) > 1 else ["x"]
            figure.add_trace(
                go.Scatter(
                    x=line["real"], y=line["imag"], name=str(place), legendgroup=str(place), showlegend=j == 0,
                    mode="lines+markers", line={"color": COLOURS[i % len(COLOURS)]},
                    marker={"size": [8 if s else 0.1 for s in symbols], "symbol": [s or "circle" for s in symbols]},
                    customdata=line["value"], hovertemplate="%{x:.4g} %{y:+.4g}i at %{customdata:.4g}",
                )
            )  # fmt: skip
    return _plane(figure, f"Root locus over {rows['parameter'].iloc[0]}")


def _plane(figure: go.Figure, title: str) -> go.Figure:
    figure.add_vline(x=0.0, line={"width": 1, "dash": "dot"})
    figure.update_xaxes(title_text="real part [1/s]")
    figure.update_yaxes(title_text="imaginary part [rad/s]")
    figure.update_layout(title_text=title, height=560)
    return figure


def response_figure(rows: pd.DataFrame) -> go.Figure:
    """Magnitude over phase of every response that is not zero."""
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    floor = RESPONDING * float(rows["magnitude"].max())
    for i, (key, line) in enumerate(rows.groupby(["place", "input", "output"], sort=False)):
        if line["magnitude"].max() > floor:
            _response(figure, line, f"{key[0]}: {key[1]} to {key[2]}", i)
    _frequencies(figure, "SI unit of output / of input")
    figure.update_layout(title_text="Frequency responses", height=680)
    return figure


def bode_figure(rows: pd.DataFrame) -> go.Figure:
    """What a hand that moves the soft fingers feels: a column an output, a line a gain of the tactile feedback.

    Args:
        rows: as `crossbody.reports.analysis.bode.table` gives them.
    """
    names = [f"finger velocity to {name}" for name in OUTPUTS]
    figure = make_subplots(rows=2, cols=len(OUTPUTS), shared_xaxes=True, vertical_spacing=0.06, column_titles=names)
    for i, (kstar, lines) in enumerate(rows.groupby("kstar", sort=True)):
        for column, output in enumerate(OUTPUTS, start=1):
            _response(figure, lines[lines["output"] == output], f"k* = {kstar:g} cm/(s N)", i, column)
    for column, output in enumerate(OUTPUTS, start=1):
        _frequencies(figure, UNITS[output], column)
    figure.update_layout(title_text="Block held by two soft fingers, linearised in the grasp", height=620)
    return figure


def _response(figure: go.Figure, line: pd.DataFrame, name: str, i: int, column: int = 1) -> None:
    """Add magnitude over phase of one response; the first column names it."""
    style = {"color": COLOURS[i % len(COLOURS)], "dash": DASHES[i % len(DASHES)], "width": 1.8}
    for row, value in enumerate(("magnitude", "phase"), start=1):
        figure.add_trace(
            go.Scatter(
                x=line["omega"], y=line[value], name=name, legendgroup=name, showlegend=row == column == 1,
                mode="lines", line=style,
            ), row=row, col=column,
        )  # fmt: skip


def _frequencies(figure: go.Figure, unit: str, column: int = 1) -> None:
    """Name the axes of one column of responses."""
    figure.update_xaxes(type="log", exponentformat="power")
    figure.update_xaxes(title_text="frequency [rad/s]", row=2, col=column)
    figure.update_yaxes(type="log", exponentformat="power", title_text=f"magnitude [{unit}]", row=1, col=column)
    figure.update_yaxes(title_text="phase [deg]", row=2, col=column)


def map_figure(rows: pd.DataFrame) -> go.Figure:
    """Largest real part of the poles over the workspace, and the line where it is 0; z points down."""
    table = rows.pivot(index="z", columns="x", values="growth")
    grid = {"x": table.columns.to_numpy(), "y": table.index.to_numpy(), "z": table.to_numpy()}
    bound = float(np.nanmax(np.abs(grid["z"]))) if np.isfinite(grid["z"]).any() else 1.0
    figure = go.Figure()
    colours = {"colorscale": "RdBu", "reversescale": True, "zmin": -bound, "zmax": bound}
    figure.add_trace(go.Heatmap(**grid, **colours, colorbar={"title": {"text": "growth [1/s]"}}))
    figure.add_trace(
        go.Contour(
            **grid, contours={"start": 0, "end": 0, "size": 1, "coloring": "none"}, line={"width": 2}, showscale=False
        )
    )  # fmt: skip
    figure.update_xaxes(title_text="x of the flange [m]")
    figure.update_yaxes(title_text="depth z of the flange [m]", autorange="reversed")
    figure.update_layout(title_text="Open-loop stability under constant torques", height=620)
    return figure
