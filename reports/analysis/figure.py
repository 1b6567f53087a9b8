"""Figures of an analysis: poles, loci, responses, and the stability of a workspace."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from crossbody.cases.arrays import Floats
from crossbody.reports.analysis.bode import OUTPUTS, UNITS
from crossbody.reports.figures.section import Figure
from crossbody.reports.figures.styles import COLOURS, DASHES, LEVEL, Panels

MARKS = ("x", "circle-open", "square-open", "diamond-open", "triangle-up-open")
NEAR = 0.02  # part of the largest pole within which marks are too close to be told apart
USUAL = 0.98  # part of a map that its colours tell apart: beside a singular pose growth has no bound
RESPONDING = 1e-12  # part of the largest magnitude below which a response is none


def pole_figure(rows: pd.DataFrame) -> Figure:
    """Poles of every place in the complex plane; those of several at one point are marks around each other.

    How many marks lie so close that they cover each other is written beside them.
    """
    plane = _plane("Poles of the linear models")
    for i, (place, group) in enumerate(rows.groupby("place", sort=False)):
        marker = {"symbol": MARKS[i % len(MARKS)], "size": 8 + 3 * i, "color": COLOURS[i % len(COLOURS)]}
        plane.add(x=group["real"], y=group["imag"], name=str(place), mode="markers", marker=marker)
    points = _together(rows["real"].to_numpy(float), rows["imag"].to_numpy(float))
    several = {point: count for point, count in points.items() if count > 1}
    if several:
        plane.add(
            x=[point[0] for point in several], y=[point[1] for point in several], mode="text", showlegend=False,
            text=[f"{count} poles" for count in several.values()], textposition="top right", hoverinfo="skip",
        )  # fmt: skip
    return plane.figure(shapes=AXIS)


def _together(x: Floats, y: Floats) -> dict[tuple[float, float], int]:
    """Return points, and how many of those given lie near each, within a part NEAR of the largest."""
    size = NEAR * max(float(np.max(np.hypot(x, y), initial=0.0)), 1e-300)
    found: dict[tuple[float, float], int] = {}
    for one in zip(x.tolist(), y.tolist(), strict=True):
        near = next((point for point in found if np.hypot(point[0] - one[0], point[1] - one[1]) <= size), one)
        found[near] = found.get(near, 0) + 1
    return found


def locus_figure(rows: pd.DataFrame, limits: pd.DataFrame | None = None) -> Figure:
    """Branches of every place over a parameter; a cross at its first value, a circle at its last.

    A diamond is where one crosses into the other half, of limits as of `loci.limits`.
    """
    plane = _plane(f"Root locus over {rows['parameter'].iloc[0]}")
    for i, (place, group) in enumerate(rows.groupby("place", sort=False)):
        for j, (_, line) in enumerate(group.groupby("branch", sort=True)):
            symbols = ["x", *[None] * (len(line) - 2), "circle"] if len(line) > 1 else ["x"]
            plane.add(
                x=line["real"], y=line["imag"], name=str(place), legendgroup=str(place), showlegend=j == 0,
                mode="lines+markers", line={"color": COLOURS[i % len(COLOURS)]},
                marker={"size": [8 if s else 0.1 for s in symbols], "symbol": [s or "circle" for s in symbols]},
                customdata=line["value"], hovertemplate="%{x:.4g} %{y:+.4g}i at %{customdata:.4g}",
            )  # fmt: skip
    for i, limit in enumerate(() if limits is None else limits.to_dict(orient="records")):
        plane.add(
            x=[0.0, 0.0], y=[limit["frequency"], -limit["frequency"]], mode="markers",
            name=f"{limit['place']}: unstable {limit['unstable']} {limit['value']:.6g}",
            marker={"symbol": "diamond-open", "size": 12 + 4 * i, "color": COLOURS[_place(rows, limit) % len(COLOURS)]},
        )  # fmt: skip
    return plane.figure(shapes=AXIS)


def _place(rows: pd.DataFrame, limit: Mapping[Any, Any]) -> int:
    return list(rows["place"].unique()).index(limit["place"])


AXIS = ({
    "type": "line", "x0": 0.0, "x1": 0.0, "y0": 0.0, "y1": 1.0, "yref": "paper",
    "line": {"width": 1, "dash": "dot", "color": LEVEL},
},)  # fmt: skip
"""Where a pole neither grows nor decays."""


def _plane(title: str) -> Panels:
    plane = Panels(title, 560)
    plane.axes("x", title="real part [1/s]")
    plane.axes("y", title="imaginary part [rad/s]")
    return plane


def response_figure(rows: pd.DataFrame) -> Figure:
    """Magnitude over phase of every response that is not zero."""
    panels = Panels("Frequency responses", 680, rows=2)
    floor = RESPONDING * float(rows["magnitude"].max())
    for i, (key, line) in enumerate(rows.groupby(["place", "input", "output"], sort=False)):
        if line["magnitude"].max() > floor:
            _response(panels, line, f"{key[0]}: {key[1]} to {key[2]}", i)
    _frequencies(panels, "SI unit of output / of input")
    return panels.figure()


def bode_figure(rows: pd.DataFrame) -> Figure:
    """What a hand that moves the soft fingers feels: a column an output, a line a gain of the feedback."""
    names = [f"finger velocity to {name}" for name in OUTPUTS]
    title = "Block held by two soft fingers, linearised in the grasp"
    panels = Panels(title, 620, rows=2, cols=len(OUTPUTS), heads=names)
    for i, (kstar, lines) in enumerate(rows.groupby("kstar", sort=True)):
        for column, output in enumerate(OUTPUTS, start=1):
            _response(panels, lines[lines["output"] == output], f"k* = {kstar:g} cm/(s N)", i, column)
    for column, output in enumerate(OUTPUTS, start=1):
        _frequencies(panels, UNITS[output], column)
    return panels.figure()


def _response(panels: Panels, line: pd.DataFrame, name: str, i: int, column: int = 1) -> None:
    """Add magnitude over phase of one response; the first column names it."""
    style = {"color": COLOURS[i % len(COLOURS)], "dash": DASHES[i % len(DASHES)], "width": 1.8}
    for row, value in enumerate(("magnitude", "phase"), start=1):
        panels.add(
            row, column, x=line["omega"], y=line[value], name=name, legendgroup=name,
            showlegend=row == column == 1, mode="lines", line=style,
        )  # fmt: skip


def _frequencies(panels: Panels, unit: str, column: int = 1) -> None:
    """Name the axes of one column of responses."""
    panels.axes("x", type="log", exponentformat="power")
    panels.axes("x", 2, column, title="frequency [rad/s]")
    panels.axes("y", 1, column, title=f"magnitude [{unit}]", type="log", exponentformat="power")
    panels.axes("y", 2, column, title="phase [deg]")


def map_figure(rows: pd.DataFrame) -> Figure:
    """Largest real part of the poles over the workspace, and the line where it is 0; z points down."""
    table = rows.pivot(index="z", columns="x", values="growth")
    grid: dict[str, Any] = {"x": table.columns.to_numpy(), "y": table.index.to_numpy(), "z": table.to_numpy()}
    bound = float(np.nanquantile(np.abs(grid["z"]), USUAL)) if np.isfinite(grid["z"]).any() else 1.0
    colours: dict[str, Any] = {"colorscale": "RdBu", "zmin": -bound, "zmax": bound}  # what grows is red
    panels = Panels("Open-loop stability under constant torques", 620)
    panels.add(**grid, **colours, type="heatmap", colorbar={"title": {"text": "growth [1/s]"}})
    zero = {"start": 0, "end": 0, "size": 1, "coloring": "none"}
    panels.add(**grid, type="contour", contours=zero, line={"width": 2}, showscale=False)
    panels.axes("x", title="x of the flange [m]")
    panels.axes("y", title="depth z of the flange [m]", autorange="reversed")
    return panels.figure()
