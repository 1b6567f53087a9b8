"""Run time against error on a case's page: whole ladders if the folder has a benchmark, else the runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from crossbody.reports.figures.section import Figure, Plot, Section
from crossbody.reports.figures.styles import LINE, logarithmic, look, place_of, plain
from crossbody.reports.judging.verdict import Row
from crossbody.reports.pages.results import Results
from crossbody.reports.runs.study import read_json

SYMBOLS = ("circle", "square", "diamond", "triangle-up", "triangle-down", "pentagon", "star", "hexagon")
FLOOR = 1e-16
ERROR, TIME = "relative error of position", "run time [ms]"
RUNS = (
    "Each engine once, at its own setting; lower left is better. An engine without a position to "
    "compare is not shown; one whose error is not finite is a cross at the right edge. For whole "
    "lines over ladders of tolerances and steps, run crossbody bench, then crossbody report --with."
)
ALL = (
    "Every engine on every case, each at its own setting; lower left is better. An engine's name stands "
    "beside its largest error; the buttons above hide engines."
)
LADDERS = (
    "One line for each engine, with a point for every tolerance or step; lower left is better. "
    "Choose an error, then go up: the lowest line there is the fastest engine for that accuracy."
)


def precision(out: Path, label: str, rows: Sequence[Row], walls: Mapping[str, float]) -> list[Section]:
    """The section, if there is anything to show: a benchmark in the folder, or verdicts and run times, s."""
    if ladders := _ladders(out, label):
        import pandas as pd

        from crossbody.reports.bench.figure import work_precision

        return [_section(work_precision(pd.DataFrame(ladders)), LADDERS)]
    points = [
        (row["who"], float(row["value"]), 1e3 * walls[row["who"]]) for row in rows
        if row["metric"] == "position" and row["value"] is not None and walls.get(row["who"])
    ]  # fmt: skip
    return [_section(scatter(points, _limits(rows)), RUNS)] if points else []


def overview(found: Results) -> list[Section]:
    """The section of the index: every engine on every case, if there is anything to show."""
    points: dict[str, list[tuple[str, float, float]]] = {}
    for label, rows in found.rows.items():
        for row in rows:
            wall = found.walls.get((label, row["who"]))
            if row["metric"] == "position" and row["value"] is not None and wall:
                points.setdefault(row["who"], []).append((label, max(row["value"], FLOOR), 1e3 * wall))
    if not points:
        return []
    if len(found.rows) == 1:
        marks = [(who, error, ms) for who, ((_, error, ms),) in points.items()]
        return [_section(scatter(marks, _limits(next(iter(found.rows.values())))), RUNS)]
    return [_section(cloud(points), ALL)]


def cloud(points: Mapping[str, Sequence[tuple[str, float, float]]]) -> Figure:
    """One mark a case, a colour and a symbol an engine: error of position (relative), run time in ms.

    Marks of an engine are in the order of their errors: the page writes its name beside the last.
    """
    data = [
        {
            "type": "scatter", "mode": "markers", "x": [error for _, error, _ in mine],
            "y": [ms for *_, ms in mine], "name": plain(who), "meta": who,
            "text": [plain(label) for label, *_ in mine],
            "hovertemplate": "%{text}<br>error %{x:.2g}, %{y:.3g} ms<extra>" + plain(who) + "</extra>",
            "marker": _mark(who) | {"size": 9, "opacity": 0.8},
        }
        for who, given in sorted(points.items(), key=lambda one: place_of(one[0]))
        for mine in (sorted(given, key=lambda one: one[1]),)
    ]  # fmt: skip
    every = [one for mine in points.values() for one in mine]
    layout = {
        "title": {"text": "Run time against error of position, one mark for each case"}, "height": 460,
        "showlegend": True, "meta": "marks",
        "xaxis": {"title": {"text": ERROR}} | logarithmic([error for _, error, _ in every]),
        "yaxis": {"title": {"text": TIME}} | logarithmic([ms for *_, ms in every]),
    }  # fmt: skip
    return {"data": data, "layout": layout}


def _section(figure: Figure, text: str) -> Section:
    plots = (Plot(name="plot-precision", figure=figure),)
    return Section(name="precision", title="Run time against error", text=text, plots=plots)


def _ladders(out: Path, label: str) -> list[dict[str, Any]]:
    if not (out / "bench.json").is_file():
        return []
    return [row for row in read_json(out / "bench.json")["rows"] if row["case"] == label]


def _mark(who: str) -> dict[str, str]:
    return {"color": look(who)["color"], "symbol": SYMBOLS[place_of(who) % len(SYMBOLS)]}


def _limits(rows: Sequence[Row]) -> list[float]:
    """Return the limits on the error of position."""
    return sorted({row["limit"] for row in rows if row["metric"] == "position" and (row["limit"] or 0.0) > 0.0})


def scatter(points: Sequence[tuple[str, float, float]], limits: Sequence[float] = ()) -> Figure:
    """One mark an engine: error of position (relative), run time in ms; its limits are dashed."""
    finite = [error for _, error, _ in points if math.isfinite(error)]
    edge = 10.0 * max([*finite, FLOOR])
    data = [
        {
            "type": "scatter", "mode": "markers",
            "x": [max(error, FLOOR) if math.isfinite(error) else edge], "y": [ms],
            "name": plain(who), "meta": who, "cliponaxis": False,
            "marker": _mark(who) | {"size": 10} | ({} if math.isfinite(error) else {"symbol": "x"}),
        }
        for who, error, ms in points
    ]  # fmt: skip
    told = f". Dashed: {'limits' if len(limits) > 1 else 'limit'} of the error" if limits else ""
    layout = {
        "title": {"text": f"Run time against error of position{told}"}, "height": 420, "showlegend": False,
        "meta": "marks",
        "shapes": [
            {"type": "line", "x0": x, "x1": x, "yref": "paper", "y0": 0.0, "y1": 1.0, "line": LINE} for x in limits
        ],
        "xaxis": {"title": {"text": ERROR}} | logarithmic([max(error, FLOOR) for error in finite]),
        "yaxis": {"title": {"text": TIME}} | logarithmic([ms for _, _, ms in points]),
    }  # fmt: skip
    return {"data": data, "layout": layout}
