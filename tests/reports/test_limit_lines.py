"""Plots of errors show the limit: a line that is above it is of an engine that is outside."""

from __future__ import annotations

import base64
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from crossbody.cases import load
from crossbody.cases.arrays import Floats
from crossbody.reports import metrics
from crossbody.reports.judging.verdict import Row
from crossbody.reports.pages import figures
from crossbody.reports.runs import study
from crossbody.reports.runs.choice import Pick
from crossbody.reports.runs.jobs import CaseResult, run_case

DRAWN = {"position": ("motion", 2), "lam_impulse_path": ("force", 3), "energy_integrator": ("energy", 3)}
"""Metric -> figure and which plot of it shows the error."""


@pytest.fixture(scope="module")
def result() -> CaseResult:
    picks = [Pick(engine="reference", profile="compiled"), Pick(engine="mujoco", profile="default")]
    return run_case(load("bouncing_ball", "linear"), picks, refine=False)


@pytest.fixture(scope="module")
def rows(result: CaseResult) -> list[Row]:
    return study.judge([result], {result.case.label: "again"})


def highest(figure: Any, who: str, axis: str) -> float:
    (line,) = (one for one in figure["data"] if one["meta"] == who and one["yaxis"] == axis)
    values: Floats = np.frombuffer(base64.b64decode(line["y"]["bdata"]), dtype=line["y"]["dtype"])
    return float(np.nanmax(values))


@pytest.mark.parametrize("metric", DRAWN)
@pytest.mark.parametrize("who", ["reference:compiled", "mujoco:default"])
def test_a_line_passes_the_limit_where_the_metric_does(
    metric: str, who: str, result: CaseResult, rows: list[Row]
) -> None:
    name, plot = DRAWN[metric]
    traces = study.traces(result)
    figure: Any = figures.FIGURES[name][1](traces, 2000, figures.limits_of(rows))
    (row,) = (row for row in rows if row["metric"] == metric and f"{row['engine']}:{row['profile']}" == who)
    if row["value"] != row["value"]:
        pytest.skip("the engine has no such number")
    axis = f"y{plot}"
    levels = [shape["y0"] for shape in figure["layout"]["shapes"] if shape["yref"] == axis]
    limits = sorted({one["limit"] for one in rows if one["metric"] == metric and one["limit"] > 0.0})
    assert len(levels) == len(limits)
    level = sorted(levels)[limits.index(row["limit"])]
    share, told = highest(figure, who, axis) / level, row["value"] / row["limit"]
    # A line of impulses is drawn by the clock of the motion; its metric lays every touch on the truth's.
    apart = 3.0 if metric.startswith("lam_impulse") else 1.5
    assert 1.0 / apart <= share / told <= apart or max(share, told) < 1e-3


def test_without_limits_none_is_drawn(result: CaseResult) -> None:
    assert not figures.motion(study.traces(result), 100)["layout"]["shapes"]


def banded(figure: Any) -> dict[str, list[float]]:
    """Half widths of the bands around the truth's lines, by axis."""
    return {line["yaxis"]: line["band"] for line in figure["data"] if "band" in line}


@pytest.mark.parametrize(
    ("metric", "name", "plot"),
    [
        ("position", "motion", 1), ("lam_impulse_path", "force", 2), ("lam_error", "force", 1),
        ("energy_drift", "energy", 1), ("gap_error", "penetration", 1), ("penetration_error", "penetration", 1),
    ],
)  # fmt: skip
@pytest.mark.parametrize("limit", [1e-12, 0.1])
def test_a_limit_on_what_is_off_the_truth_is_a_band_around_it_where_one_sees_it(
    metric: str, name: str, plot: int, limit: float, result: CaseResult
) -> None:
    """It has the metric's own scale: an engine that is off by as much has the number that is its limit."""
    traces, truth, case = study.traces(result), result.truth, result.case
    figure = figures.FIGURES[name][1](traces, 2000, {metric: {limit: "limit"}})
    if limit < 1e-6:
        assert not banded(figure)
        return
    ((axis, (half,)),) = banded(figure).items()
    assert axis.removeprefix("y") == (str(plot) if plot > 1 else "")
    assert "Grey around the truth: limit" in figure["layout"]["title"]["text"]
    run = truth.trajectory
    shift = {
        "position": replace(run, q=run.q + half),
        "energy_drift": replace(run, energy=run.energy + np.array([half, 0.0])),
        "gap_error": replace(run, gap=run.gap + half), "penetration_error": replace(run, gap=run.gap - half),
    }  # fmt: skip
    if metric in shift:
        assert metrics.load(metric).measure(truth, shift[metric], case) == pytest.approx(limit, rel=1e-6)


def test_what_an_engine_may_reach_is_a_line_in_the_depth(result: CaseResult) -> None:
    """A claimed depth, and how far one may be from it."""
    row = {"metric": "penetration", "engine": "a", "profile": "b", "limit": 1e-5, "expected": 0.25}
    for k, row["expected"] in enumerate((0.25, math.nan, None)):
        figure = figures.penetration(study.traces(result), 100, figures.limits_of([row]))
        (line,) = figure["layout"]["shapes"]
        assert line["y0"] == (1e-5 if k else 0.25 + 1e-5)


def test_a_closure_may_drift_as_far_as_its_limit() -> None:
    result = run_case(load("bouncing_ball", "bilateral"), [Pick(engine="reference", profile="compiled")], refine=False)
    rows = study.judge([result], {result.case.label: "again"})
    figure = figures.penetration(study.traces(result), 100, figures.limits_of(rows))
    limits = {row["limit"] for row in rows if row["metric"] == "constraint_drift" and row["limit"] > 0.0}
    assert limits == {shape["y0"] for shape in figure["layout"]["shapes"]}
