"""Plots of errors show the limit: a line that is above it is of an engine that is outside."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import pytest

from crossbody.cases import load
from crossbody.cases.arrays import Floats
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
    share = highest(figure, who, axis) / level
    assert (
        share == pytest.approx(row["value"] / row["limit"], rel=0.5) or max(share, row["value"] / row["limit"]) < 1e-3
    )


def test_without_limits_none_is_drawn(result: CaseResult) -> None:
    assert not figures.motion(study.traces(result), 100)["layout"]["shapes"]
