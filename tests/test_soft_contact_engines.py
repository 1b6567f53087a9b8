"""The soft contact in the engines: the same physics, written out once more, and the same run."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import CaseUnsupported, Outcome
from crossbody.engines import load
from crossbody.reports.audit import audit

pytest.importorskip("pinocchio")


@pytest.mark.parametrize(
    "changed", [{}, {"probe": 0.01, "probe_rate": 20.0, "release": 3.5, "rate_share": 0.5, "t_end": 4.0}]
)
@pytest.mark.parametrize("kstar", [0.0, 20.0])
def test_pinocchio_gives_the_run_of_the_reference(kstar, changed):
    case = cases.load("soft_contact", kstar=kstar, **changed)
    ours = load("reference").prepare(case, rtol=1e-10).run()
    theirs = load("pinocchio").prepare(case, "law", rtol=1e-8, method="BDF").run()
    assert theirs.outcome is Outcome.FINISHED
    touches = [[(e.contact, e.t) for e in r.events if e.after == 1] for r in (ours, theirs)]
    assert [c for c, _ in touches[0]] == [c for c, _ in touches[1]]
    assert [t for _, t in touches[1]] == pytest.approx([t for _, t in touches[0]], abs=1e-7)
    np.testing.assert_allclose(theirs.q[-1], ours.q[-1], atol=1e-6)
    np.testing.assert_allclose(theirs.lam[-1], ours.lam[-1], atol=1e-4)


def test_pinocchio_holds_the_same_physics():
    case = cases.load("soft_contact")
    mine, theirs = (load(name).prepare(case).audit() for name in ("reference", "pinocchio"))
    rows = audit(mine, theirs, case)
    assert {row.quantity for row in rows} >= {"masses", "M", "bias", "H", "lam"}
    assert all(row.ok for row in rows), [row for row in rows if not row.ok]


def test_what_an_engine_cannot_do_is_said():
    axis, robot = cases.load("soft_contact"), cases.load("soft_contact", "delta")
    for profile in ("impulse", "impulse_simultaneous", "admm"):
        with pytest.raises(CaseUnsupported, match="sensors read forces"):
            load("pinocchio").prepare(axis, profile)
    with pytest.raises(CaseUnsupported, match="soft_delta"):
        load("pinocchio").prepare(robot, "law")
