"""The main job, `crossbody run`: the bouncing ball on every engine; nothing is outside, and its report can be sent."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from crossbody import cases
from crossbody.reports.judging.told import WRONG
from crossbody.reports.pages import site
from crossbody.reports.runs import choice, jobs, study
from crossbody.reports.runs.output import folder

CASE = choice.DEFAULT_CASES[0]


@cache
def result(variant: str) -> jobs.CaseResult:
    return jobs.run_case(cases.load(CASE, variant), choice.picks(()))


@pytest.mark.slow
@pytest.mark.parametrize("variant", cases.variants(CASE))
def test_no_engine_is_outside(variant: str) -> None:
    """Also of what is expected-outside, whose stored sizes follow from what numbers are measured by."""
    rows = study.judge([result(variant)], {result(variant).case.label: "again"})
    assert len({row["engine"] for row in rows}) > 3
    assert not [(row["engine"], row["metric"], row["value"], row["why"]) for row in rows if row["verdict"] in WRONG]


def test_the_report_in_one_file_is_below_three_megabytes(tmp_path: Path) -> None:
    results = [result(variant) for variant in cases.variants(CASE)]
    again = {one.case.label: "crossbody run" for one in results}
    with folder(tmp_path / "out") as made:
        study.write(made, results, study.judge(results, again), {"command": "crossbody run", "time": ""})
        site.write(made, single_file=True)
    assert 1e6 < (tmp_path / "out" / "index.html").stat().st_size < 3e6
