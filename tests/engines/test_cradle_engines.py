"""Newton's cradle in MuJoCo and Pinocchio: which rule each profile follows, and how exactly."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Mode
from crossbody.engines._real_time import in_real_time
from crossbody.reports.judging.audit import audit

pytest.importorskip("mujoco")
pytest.importorskip("pinocchio")

COUNTS = [(n, k) for n in range(2, 7) for k in range(1, n)]
ALL = [
    (name, profile)
    for name in ("mujoco", "pinocchio")
    for profile in engines.load(name).profiles
    if profile != "as_is"  # of robot files
]
LAWS = [("mujoco", "matched"), ("pinocchio", "law")]
each_law = pytest.mark.parametrize(("name", "profile"), LAWS)


def cradle(variant: str = "sliders", **parameters: Any) -> Case:
    return cases.load("newtons_cradle", variant=variant, **parameters)


def run(case: Case, name: str, profile: str, **settings: Any) -> cases.Trajectory:
    found = engines.load(name).prepare(case, profile, **settings).run()
    assert found.outcome.ok, found.message
    return found


def exact(case: Case, times: Any) -> cases.Trajectory:
    assert case.closed_form is not None
    return case.closed_form(np.asarray(times))


@pytest.mark.parametrize("gap", [0.0, 3e-3])
@pytest.mark.parametrize(("n", "k"), COUNTS)
def test_impulses_in_turn_are_the_exact_motion(n: int, k: int, gap: float) -> None:
    case = cradle(n=n, lifted=k, gap=gap)
    found = run(case, "pinocchio", "impulse")
    truth = exact(case, found.t[-1:])
    np.testing.assert_allclose(found.v[-1], truth.v[-1], atol=1e-10)
    np.testing.assert_allclose(found.q[-1], truth.q[-1], atol=1e-10)
    want = [(e.contact, e.before, e.after) for e in truth.events]
    assert sorted((e.contact, e.before, e.after) for e in found.events) == sorted(want)
    assert sum(e.impulse for e in found.events) == pytest.approx(sum(e.impulse for e in truth.events), rel=1e-10)


def test_impulses_in_turn_with_unequal_masses() -> None:
    found = run(cradle(n=3, masses="4,2,1"), "pinocchio", "impulse")
    np.testing.assert_allclose(found.v[-1], (1 / 3, 4 / 9, 16 / 9), rtol=1e-12)


@pytest.mark.parametrize("zeta", [0.1, 0.5])
def test_impulses_in_turn_have_the_restitution_of_the_fast_constants(zeta: float) -> None:
    case = cradle(n=4, zeta=zeta, gap=1e-3)
    found = run(case, "pinocchio", "impulse")
    np.testing.assert_allclose(found.v[-1], exact(case, found.t[-1:]).v[-1], atol=1e-10)


@pytest.mark.parametrize("profile", ["impulse_simultaneous", "admm"])
@pytest.mark.parametrize("n", range(3, 7))
def test_all_at_once_the_struck_balls_are_one_block(n: int, profile: str) -> None:
    found = run(cradle(n=n), "pinocchio", profile)
    np.testing.assert_allclose(found.v[-1], [(2 - n) / n] + [2 / n] * (n - 1), atol=1e-10)
    assert found.counts.get("unsolved", 0) == 0


@pytest.mark.parametrize("k", range(1, 5))
def test_all_at_once_is_the_exact_complementarity_problem(k: int) -> None:
    case = cradle(lifted=k, collisions="simultaneous", masses="0.3,0.1,0.2,0.1,0.4", zeta=0.1)
    found = run(case, "pinocchio", "impulse_simultaneous")
    np.testing.assert_allclose(found.v[-1], exact(case, found.t[-1:]).v[-1], atol=1e-10)


@each_law
def test_laws_in_real_time_make_one_block_of_balls_that_touch(name: str, profile: str) -> None:
    found = run(cradle(), name, profile)
    np.testing.assert_allclose(found.v[-1], (-0.6, 0.4, 0.4, 0.4, 0.4), atol=1e-5)


@pytest.mark.parametrize("k", [1, 3])
@each_law
def test_laws_in_real_time_give_the_ideal_pattern_over_wide_gaps(name: str, profile: str, k: int) -> None:
    speed, a0 = 1.0, 1e6
    case = cradle(n=4, lifted=k, gap=2.5 * speed / np.sqrt(a0), speed=speed, a0=a0)
    want = [0.0] * (4 - k) + [speed] * k
    np.testing.assert_allclose(run(case, name, profile).v[-1], want, atol=1e-5)


@pytest.mark.parametrize(("name", "profile"), ALL)
def test_momentum_is_kept_to_rounding(name: str, profile: str) -> None:
    case = cradle(n=4, lifted=2, gap=4e-4, masses="0.1,0.3,0.2,0.1")
    found = run(case, name, profile)
    p = found.v @ np.array([0.1, 0.3, 0.2, 0.1])
    assert np.abs(p - p[0]).max() < 1e-12 * np.abs(p[0])


@pytest.mark.parametrize(("n", "s", "percent"), [(5, 0.1, 41.4), (3, 0.2, 16.1), (3, 0.285, 16.7), (5, 0.3, 45.0)])
@each_law
def test_overlapping_collisions_make_the_energy_of_their_machine(
    name: str, profile: str, n: int, s: float, percent: float
) -> None:
    found = run(cradle(n=n, gap=s / np.sqrt(1e6)), name, profile)
    made = 100 * (found.total_energy[-1] / found.total_energy[0] - 1)
    assert made == pytest.approx(percent, abs=0.5)


@pytest.mark.parametrize("variant", cases.variants("newtons_cradle"))
@pytest.mark.parametrize("parameters", [{}, {"n": 3, "masses": "4,2,1", "gap": 1e-3, "zeta": 0.2}])
@each_law
def test_the_same_physics_reaches_every_engine(
    name: str, profile: str, variant: str, parameters: dict[str, Any]
) -> None:
    case = cradle(variant, **parameters)
    theirs = engines.load("reference").prepare(case, "compiled").audit()
    rows = audit(engines.load(name).prepare(case, profile).audit(), theirs, case)
    assert {row.quantity for row in rows} >= {"M", "bias", "H", "lam", "constants"}
    assert all(row.ok and not np.isnan(row.difference) for row in rows), rows


@pytest.mark.parametrize("zeta", [0.0, 0.1])
def test_mujoco_is_the_level_machine_to_order_four(zeta: float) -> None:
    case = cradle(n=4, gap=1e-4, zeta=zeta)
    truth = run(in_real_time(case), "reference", "compiled", rtol=1e-13).v[-1]
    steps = 2e-4 / 2.0 ** np.arange(4)
    errors = [float(np.abs(run(case, "mujoco", "matched", dt=float(dt)).v[-1] - truth).max()) for dt in steps]
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert 3.5 < order < 4.7, errors
    assert errors[-1] < 1e-7


@pytest.mark.parametrize("zeta", [0.0, 0.1])
def test_pinocchio_is_the_level_machine_to_its_tolerance(zeta: float) -> None:
    case = in_real_time(cradle(n=4, gap=1e-4, zeta=zeta), "level")
    truth = run(case, "reference", "compiled", rtol=1e-13)
    found = run(case, "pinocchio", "law", rtol=1e-12)
    np.testing.assert_allclose(found.v[-1], truth.v[-1], atol=1e-8)
    went = [(e.contact, e.before, e.after) for e in truth.events]
    assert [(e.contact, e.before, e.after) for e in found.events] == went
    np.testing.assert_allclose([e.t for e in found.events], [e.t for e in truth.events], atol=1e-9)


def test_pendulums_collide_in_turn_as_in_the_reference() -> None:
    case = cradle("pendulums", n=3, t_end=1.5)
    found, truth = (run(case, *who, rtol=1e-12) for who in (("pinocchio", "impulse"), ("reference", "compiled")))
    assert [(e.contact, e.before, e.after) for e in found.events] == [
        (e.contact, e.before, e.after) for e in truth.events
    ]
    assert len(found.events) == 12
    np.testing.assert_allclose([e.t for e in found.events], [e.t for e in truth.events], atol=1e-9)
    np.testing.assert_allclose([e.impulse for e in found.events], [e.impulse for e in truth.events], atol=1e-9)


def test_pendulums_in_mujoco_follow_the_level_machine() -> None:
    case = cradle("pendulums", n=3, gap=1e-4, t_end=0.3)
    truth = run(in_real_time(case), "reference", "compiled", rtol=1e-13)
    errors = [float(np.abs(run(case, "mujoco", "matched", dt=dt).q[-1] - truth.q[-1]).max()) for dt in (2e-4, 1e-4)]
    assert errors[1] < errors[0] / 8
    assert errors[1] < 1e-6


def test_two_balls_need_no_rule_for_several_contacts() -> None:
    reason = engines.load("pinocchio").why_not(cradle(n=2), "impulse_simultaneous")
    assert reason == "There is only one contact, so the profile impulse is the same."


def test_a_run_says_which_equations_it_follows() -> None:
    case = cradle(zeta=0.1)
    for name, profile in LAWS:
        followed = engines.load(name).prepare(case, profile).follows
        assert (followed.fsm, followed.collisions) == ("level", "resolved")
        np.testing.assert_array_equal(followed.law.a0, case.law.b0)
        assert not followed.law.b0.any()
    assert engines.load("mujoco").prepare(case, "default").follows is None
    assert engines.load("pinocchio").prepare(case, "impulse").follows is None


def test_the_obvious_model_has_other_constants_and_another_step() -> None:
    prepared = engines.load("mujoco").prepare(cradle(), "default")
    assert prepared.settings["dt"] == 2e-3
    found = prepared.run()
    assert {e.after for e in found.events} <= {Mode.FREE, Mode.CONTACT, Mode.BALLISTIC}
    assert np.abs(found.v[-1] - (-0.6, 0.4, 0.4, 0.4, 0.4)).max() > 0.05
