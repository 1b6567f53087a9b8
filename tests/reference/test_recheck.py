"""A mode that does not hold in a finished motion is told; a sound motion is left alone."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from springs import drawn, known, suite

from crossbody import cases, engines
from crossbody.cases import Law, Mode, load
from crossbody.cases.scene import Body, Joint, RowLaw, Scene
from crossbody.engines.equations import system_of
from crossbody.reference import Violation, recheck, simulate
from crossbody.reports.judging import truth
from crossbody.reports.judging.truth_row import truth_row
from crossbody.reports.judging.verdict import Word


def far(system: Any, row: int) -> Any:
    """The same springs with one wall out of reach."""
    p = np.array(system.p)
    p[2 * system.n**2 + system.n + row] += 1e3
    law = Law(a0=system.a0, a1=system.a1, a2=system.a2, unilateral=np.ones(system.nc, dtype=bool))
    return suite().from_numbers(p, system.n, law)


@pytest.mark.parametrize("samples", [None, np.linspace(0.0, 1.0, 501)], ids=["own steps", "samples"])
@pytest.mark.parametrize("solver", ["compiled", "cvode"])
def test_a_wall_that_was_passed_through_is_told(solver: str, samples: Any) -> None:
    """Motions of the same springs with one wall moved away, held against the wall where it stands; and sound ones."""
    told = passed = 0
    for seed in range(30):
        system, q0, v0 = drawn(seed)
        bounded = {"max_step": 1e-2} if solver == "compiled" else {}
        sound = simulate(system, q0, v0, 1.0, rtol=1e-9, solver=solver, samples=samples, **bounded)
        if sound.outcome.ok:
            assert recheck(system, sound) == (), seed
        blind = far(system, 0)
        run = simulate(blind, q0, v0, 1.0, rtol=1e-9, solver=solver, samples=samples, **bounded)
        if not run.outcome.ok:
            continue
        dense = simulate(blind, q0, v0, 1.0, rtol=1e-9, samples=np.linspace(0.0, 1.0, 5001))
        depth = 1e3 - dense.gap[:, 0].min()
        passed += bool(depth > 1e-6)
        found = [one for one in recheck(system, run) if one.contact == 0]
        told += bool(found)
        assert bool(found) == bool(depth > 1e-6), (seed, depth, found)
    assert told == passed > 10


WRONG = {
    (Mode.CONTACT, Mode.BALLISTIC): "closing, and would press",
    (Mode.CONTACT, Mode.FREE): "below the surface",
    (Mode.FREE, Mode.CONTACT): "pulls",
    (Mode.FREE, Mode.BALLISTIC): "above the surface",
}


@pytest.mark.parametrize(("right", "wrong"), WRONG)
def test_a_wrong_mode_is_told_with_its_reason(right: Mode, wrong: Mode) -> None:
    """A sound motion with other modes written beside it."""
    system, q0, v0 = known()
    run = simulate(system, q0, v0, 1.0, rtol=1e-10, solver="cvode", samples=np.linspace(0.0, 1.0, 5001))
    assert recheck(system, run) == ()
    mode = run.mode.copy()
    mode[run.mode == right] = wrong
    found = recheck(system, replace(run, mode=mode))
    assert (0, wrong, WRONG[right, wrong]) in [(one.contact, one.mode, one.reason) for one in found]


@pytest.mark.parametrize("seed", range(3))
def test_a_truth_is_trusted_up_to_the_first_mode_that_does_not_hold(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two integrators that agree may have missed the same touch: the case's row of its truth is outside then."""
    case = replace(load("bouncing_ball", "linear", t_end=0.6), closed_form=None)
    assert truth.truth_of(case).trusted == math.inf
    early, late = np.sort(np.random.default_rng(seed).uniform(0.0, case.t_end, 2)).tolist()
    found = tuple(
        Violation(t=t, contact=0, mode=mode, amount=1.0, reason="below the surface")
        for t, mode in ((early, Mode.FREE), (late, Mode.CONTACT))
    )
    monkeypatch.setattr(truth, "violated", lambda *_: found)
    told = truth.truth_of(case)
    assert told.trusted == early
    assert f"FREE at t = {early:.6g} s, but below the surface: not trusted from there" in told.source
    (row,) = truth_row(case, told, "")
    assert row.verdict == Word.OUTSIDE
    assert row.compared == pytest.approx(early / case.t_end)


@pytest.mark.parametrize("seed", range(4))
def test_a_motion_of_one_row_is_looked_at_by_itself(seed: int) -> None:
    """A run may end where it began."""
    system, q0, v0 = drawn(seed)
    run = simulate(system, q0, v0, 1.0, samples=[0.0])
    assert recheck(system, run) == ()
    below = replace(run, gap=run.gap - 1e3, mode=np.full_like(run.mode, Mode.FREE), events=())
    assert {one.reason for one in recheck(system, below)} == {"below the surface"}


@pytest.mark.parametrize("apart", 10.0 ** np.arange(-12.0, -5.0))
def test_rows_that_let_go_right_behind_each_other_pull_nothing(apart: float) -> None:
    """Between two events nanoseconds apart rounding of the places says little of the speed."""
    law = RowLaw(a0=2500.0, a1=100.0)
    bodies = tuple(Body(name=name, mass=1.0) for name in "ab")
    joints = tuple(Joint(name=name, body=name, type="slide", range=(0.0, 9.0), law=law) for name in "ab")
    case = cases.from_scene(Scene(bodies=bodies, joints=joints), q0=[-0.7, -0.7 * (1.0 + apart)], t_end=0.5)
    run = engines.load("reference").prepare(case, "compiled", rtol=1e-13).run()
    assert recheck(system_of(case), run, rtol=1e-12) == ()


@pytest.mark.parametrize(("part", "told"), [(0.5, False), (2.0, True)])
def test_a_pull_of_a_contact_with_friction_is_told_from_what_the_tolerance_leaves(part, told):
    """It is a thousand times the relative tolerance, of the largest multiplier."""
    case = load("sliding_block", "stops")
    prepared = engines.load("reference").prepare(case, "compiled", rtol=1e-9)
    run = prepared.run()
    assert recheck(prepared.system, run, rtol=1e-9) == ()
    lam, k = run.lam.copy(), int(np.flatnonzero(~np.isin(run.t, [event.t for event in run.events]))[1])
    lam[k, 0] = -part * 1e3 * 1e-9 * np.abs(lam).max()
    found = recheck(prepared.system, replace(run, lam=lam), rtol=1e-9)
    assert [one.reason for one in found] == ["pulls"] * told
