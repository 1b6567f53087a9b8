"""The red body: its kernels and the run with its default numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from red_body_scene import REFERENCE, instants, numbers, random_states, run, system_of

from crossbody import cases
from crossbody.cases import InvalidValue, Mode, SceneError, Trajectory, load
from crossbody.cases.mechanisms.red_body.order import LEFT, RIGHT, Fall
from crossbody.reference import System
from crossbody.reports import metrics
from crossbody.reports.judging.comparison import compare
from crossbody.reports.measuring.truth import from_run

TINY = 1e-30


def complex_gaps(system: System, q: Any, v: Any) -> tuple[np.ndarray, np.ndarray]:
    h, hd = np.zeros(5, complex), np.zeros(5, complex)
    system.gaps(0.0, np.asarray(q, complex), np.asarray(v, complex), np.asarray(system.p, complex), h, hd)
    return h, hd


def test_rows_are_derivatives_of_the_gaps() -> None:
    system = system_of(load("red_body", half_height=0.13, foot=0.25, slab_half_height=0.04))
    for q, v in random_states():
        H, h, Hdv = system.constraint(q, v)
        slopes = [complex_gaps(system, q + 1j * TINY * e, v)[0].imag / TINY for e in np.eye(6)]
        along, rates = complex_gaps(system, q + 1j * TINY * v, v)
        np.testing.assert_allclose(H, np.transpose(slopes), atol=1e-14)
        np.testing.assert_allclose(Hdv, rates.imag / TINY, atol=1e-13)
        np.testing.assert_allclose((h, H @ v), (along.real, rates.real), atol=1e-14)


def test_gaps_are_those_of_the_corners() -> None:
    """From rotation matrices, without a formula of the kernels."""
    case = load("red_body")
    p, system = numbers(case), system_of(case)

    def turned(angle: float, x: float, y: float) -> np.ndarray:
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, -s], [s, c]]) @ [x, y]

    a, b, d = p["half_width"], p["half_height"], p["slab_half_height"]
    for q, v in random_states():
        feet = [(q[3:5] + turned(q[5], x, -d))[1] for x in (-p["foot"], p["foot"])]
        lower = [turned(-q[5], *(q[:2] + turned(q[2], x, -b) - q[3:5]))[1] - d for x in (-a, a)]
        wall = p["wall"] - (q[:2] + turned(q[2], a, b))[0]
        np.testing.assert_allclose(system.gap(q, v)[0], [*feet, *lower, wall], atol=1e-14)


def test_action_is_reaction() -> None:
    """A push between the bodies, seen from outside, is none: no net force, and no moment about any point."""
    system = system_of(load("red_body"))
    for q, v in random_states():
        for x, y, turn, X, Y, Turn in system.constraint(q, v)[0][[LEFT, RIGHT]]:
            np.testing.assert_allclose((x + X, y + Y), 0.0, atol=1e-14)
            moments = turn + q[0] * y - q[1] * x, Turn + q[3] * Y - q[4] * X
            assert sum(moments) == pytest.approx(0.0, abs=1e-13)


def test_energy_is_that_of_the_mass_matrix_and_the_weights() -> None:
    system = system_of(load("red_body"))
    for q, v in random_states():
        M, f = system.terms(q, v)
        e = np.zeros(2, complex)
        system.energy(np.asarray(q, complex), np.asarray(v, complex), np.asarray(system.p, complex), e)
        assert e[0].real == pytest.approx(0.5 * v @ M @ v, rel=1e-14)
        system.energy(q + 1j * TINY * v, np.asarray(v, complex), np.asarray(system.p, complex), e)
        assert e[1].imag / TINY == pytest.approx(-f @ v, rel=1e-12)


def test_every_instant_of_the_resolved_run() -> None:
    """Times of the prototype to its digits; SUNDIALS finds them to 1e-11 s."""
    case = load("red_body")
    ours, theirs = run(case, rtol=1e-12), REFERENCE.prepare(case, "cvode", rtol=1e-13).run()
    feet, rest = instants(ours)[:2], instants(ours)[2:]
    assert feet == [(0, Mode.CONTACT, 0.0), (1, Mode.CONTACT, 0.0)]
    assert [(row, after) for row, after, _ in rest] == [
        (LEFT, Mode.COLLISION), (LEFT, Mode.CONTACT), (RIGHT, Mode.COLLISION),
        (LEFT, Mode.FREE), (RIGHT, Mode.COLLISION_SEPARATION), (RIGHT, Mode.FREE),
    ]  # fmt: skip
    touch, caught, landed, let_go, parted, up = (t for *_, t in rest)
    assert (touch, caught, landed, parted) == pytest.approx((0.045, 0.075, 0.108, 0.111), abs=5e-4)
    assert (let_go - landed, up - parted) == pytest.approx((1e-4, 1e-4), abs=2e-5)
    assert touch == pytest.approx(np.sqrt(2 * 0.01 / 9.81), abs=1e-12)
    assert [(e.contact, e.after) for e in theirs.events] == [(e.contact, e.after) for e in ours.events]
    np.testing.assert_allclose([e.t for e in theirs.events], [e.t for e in ours.events], rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("variant", cases.variants("red_body"))
def test_what_the_case_claims_comes_out(variant: str) -> None:
    case = load("red_body", variant)
    found = run(case)
    bounds = {limit.metric: limit.value for limit in case.limits if limit.engine == "*"}
    assert {claim.metric for claim in case.claims} > {"mode_order", "foot_lam", "wall_lam"}
    for claim in case.claims:
        value = metrics.of(case)[claim.metric].measure(from_run(found, claim.tier, ""), found, case)
        assert value == pytest.approx(claim.expected, abs=bounds[claim.metric]), claim.metric


def test_energy_account_closes_to_integration_accuracy() -> None:
    found = run(load("red_body"), rtol=1e-12)
    assert found.ledger is not None
    booked = found.ledger.contact.sum(axis=1)
    np.testing.assert_allclose(found.total_energy - found.total_energy[0], booked, atol=1e-11)


def test_the_left_corner_stays_a_little_above_the_surface_while_the_slow_constants_hold_it() -> None:
    """Handed over with h' > 0 it rises to .546 h'(0), some micrometres, with lam > 0: so it leaves to FREE."""
    found = run(load("red_body"), rtol=1e-12)
    held = found.mode[:, LEFT] == Mode.CONTACT
    gap, rate = found.gap[held, LEFT], rate_of_left(found, int(np.argmax(held)))
    assert 0.0 < gap.max() < np.exp(-np.pi / np.sqrt(27.0)) * rate < 6e-6
    assert 1e-7 < gap[-1] < 2e-6
    assert (found.lam[held, LEFT] > 0.0)[:-1].all()


def test_handing_over_changes_lam_by_less_than_the_elastic_part_that_was_left() -> None:
    """At most 1 % of lam; energy and state are continuous."""
    found = run(load("red_body"), rtol=1e-12)
    at = next(e.t for e in found.events if (e.contact, e.after) == (LEFT, Mode.CONTACT))
    before, after = np.flatnonzero(found.t == at)
    jump = found.lam[after, LEFT] / found.lam[before, LEFT] - 1.0
    assert 0.0 < abs(jump) < 0.01
    np.testing.assert_array_equal(found.q[before], found.q[after])
    np.testing.assert_array_equal(found.v[before], found.v[after])
    p, own = numbers(load("red_body")), found.lam[before, LEFT]
    elastic = p["b0"] * abs(found.gap[before, LEFT]) + 2.0 * p["zeta3"] * np.sqrt(p["b0"]) * rate_of_left(found, before)
    assert elastic == pytest.approx(0.01 * own * Fall(p).delassus(found.q[before, 2]), rel=1e-6)


def handed_over(profile: str, rtol: float, **changes: float) -> float:
    case = load("red_body", "resolved", tilt=0.0, spin=0.0, **changes)
    found = REFERENCE.prepare(case, profile, rtol=rtol, ledger=False).run()
    assert found.outcome.ok, found.message
    (t,) = [t for contact, after, t in instants(found) if (contact, after) == (RIGHT, Mode.CONTACT)]
    return t


@pytest.mark.parametrize(
    "changes",
    [
        {"drop": 1.957728446419402e-6, "mass": 4.276075634185, "zeta3": 1.076425859792, "zeta4": 0.050269636833994},
        {"drop": 6.232784894530541e-6, "mass": 3.427862795557, "zeta3": 0.860105859792, "zeta4": 0.167720698891},
    ],
    ids=["light", "damped"],
)  # fmt: skip
def test_a_hand_over_that_is_due_for_a_moment_only_is_not_missed(changes: dict[str, float]) -> None:
    """The elastic part is least where the gap passes through zero: one half swing later the motion is another one."""
    first = handed_over("compiled", 1e-12, **changes)
    for profile, rtol in (("compiled", 1e-8), ("compiled", 1e-10), ("cvode", 1e-8), ("cvode", 1e-11)):
        assert handed_over(profile, rtol, **changes) == pytest.approx(first, abs=1e-7)


def rate_of_left(found: Trajectory, at: int) -> float:
    return float(system_of(load("red_body")).gap(found.q[at], found.v[at])[1][LEFT])


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"mass": -1.0}, InvalidValue, "mass"), ({"slab_mass": 0.0}, InvalidValue, "slab_mass"),
        ({"gravity": 0.0}, InvalidValue, "gravity"), ({"drop": -0.01}, InvalidValue, "drop"),
        ({"b0": 1.0}, SceneError, "faster than those of CONTACT"), ({"a0": 1e7}, SceneError, "faster"),
        ({"slab_height": 0.1}, SceneError, "left corner starts"), ({"x": 0.35}, SceneError, "slab_half_length"),
        ({"wall": 0.05}, SceneError, "inside the wall"), ({"half_width": float("nan")}, InvalidValue, "half_width"),
    ],
)  # fmt: skip
def test_contradictory_numbers_are_told_in_one_sentence(
    changes: dict[str, float], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words) as told:
        load("red_body", **changes)
    assert "\n" not in str(told.value)


def test_what_is_not_claimed_is_not_judged() -> None:
    """A flat box has another order: its run is right, and no verdict on the order is given."""
    case = load("red_body", half_height=0.13)
    rows = compare(case, [REFERENCE.prepare(case, "compiled")])
    assert not rows["verdict"].eq("outside").any()
    assert not rows["metric"].isin(["mode_order", "peak_lam3"]).any()
