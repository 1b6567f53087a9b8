"""The main job, `crossbody run`: the bouncing ball on every engine; nothing is outside."""

from __future__ import annotations

import pytest

from crossbody import cases
from crossbody.reports.judging.told import WRONG
from crossbody.reports.runs import jobs, study


@pytest.mark.parametrize("variant", cases.variants(jobs.DEFAULT_CASES[0]))
def test_no_engine_is_outside(variant: str) -> None:
    """Also of known deviations, whose stored sizes follow from what numbers are measured by."""
    case = cases.load(jobs.DEFAULT_CASES[0], variant)
    rows = study.judge([jobs.run_case(case, jobs.picks(()))], {case.label: "again"})
    assert len({row["engine"] for row in rows}) > 3
    assert not [(row["engine"], row["metric"], row["value"], row["why"]) for row in rows if row["verdict"] in WRONG]
