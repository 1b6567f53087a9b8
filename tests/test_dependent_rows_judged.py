"""Rows of a planar loop that follow from others: held by these, they are judged as what is always on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from four_bars import four_bar

from crossbody import engines
from crossbody.cases import Mode, Tier
from crossbody.reports import metrics
from crossbody.reports.judging.modes import violated
from crossbody.reports.judging.truth import from_run

RTOL = 1e-9


@pytest.mark.parametrize("profile", ["compiled", "cvode", "ida"])
@pytest.mark.parametrize("seed", range(3))
def test_rows_that_others_hold_are_no_contacts_and_no_unknown_numbers(seed: int, profile: str) -> None:
    case = four_bar(seed)
    run = engines.load("reference").prepare(case, profile, rtol=RTOL).run()
    assert run.counts["redundant"] == 1, "a closure in space has three rows where a plane needs two"
    left_out = np.isnan(run.lam).all(axis=0)
    assert left_out.sum() == 1
    assert (run.mode[:, left_out] == Mode.BILATERAL).all()
    truth = replace(from_run(run, Tier.D, "itself"), joined=True)
    found = {
        name: metrics.load(name).measure(truth, run, case)
        for name in ("complementarity", "law_residual", "mode_residual")
    }
    assert found["mode_residual"] == 0.0
    assert found["complementarity"] is not None
    assert found["complementarity"] < 1e-9
    assert found["law_residual"] is not None
    assert found["law_residual"] < 1e-7
    met = {contact.row for contact in metrics.load("touch_count").contacts(run, True)}
    assert all(case.law.unilateral[row] for row in met), "what is always on touches nothing"
    assert violated(case, run, RTOL) == ()
