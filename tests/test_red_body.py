"""The red body: kernels, order of modes, its inequalities, and the frozen limit of the resolved motion."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Mode, Trajectory, load
from crossbody.cases._red_body_order import LEFT, RIGHT, STAGES, Fall, inequalities, stages_in_order
from crossbody.reference import System
from crossbody.reference.systems import red_body as kernels
from crossbody.reports.metrics import load as metric
from crossbody.reports.truth import from_run

REFERENCE = engines.load("reference")
TINY = 1e-30
ALL = len(STAGES)


def numbers(case: Case) -> dict[str, float]:
    return {k: float(v) for k, v in case.parameters.items()}


def system_of(case: Case) -> System:
    return kernels.build(case.parameters, case.law)


def run(case: Case, **settings: Any) -> Trajectory:
    found: Trajectory = REFERENCE.prepare(case, "compiled", **settings).run()
    assert found.outcome.ok, found.message
    return found


def order(variant: str = "resolved", **changes: float) -> int:
    return stages_in_order(run(load("red_body", variant, **changes)).events)


def instants(found: Trajectory) -> list[tuple[int, Mode, float]]:
    return [(e.contact, e.after, e.t) for e in found.events]


# --- kernels -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def states() -> list[tuple[np.ndarray, np.ndarray]]:
    draw = np.random.default_rng(4)
    return [(draw.normal(size=6), draw.normal(size=6)) for _ in range(20)]


def complex_gaps(system: System, q: Any, v: Any) -> tuple[np.ndarray, np.ndarray]:
    h, hd = np.zeros(5, complex), np.zeros(5, complex)
    system.gaps(0.0, np.asarray(q, complex), np.asarray(v, complex), np.asarray(system.p, complex), h, hd)
    return h, hd


def test_rows_are_derivatives_of_the_gaps(states: Any) -> None:
    system = system_of(load("red_body", half_height=0.13, foot=0.25, slab_half_height=0.04))
    for q, v in states:
        H, h, Hdv = system.constraint(q, v)
        slopes = [complex_gaps(system, q + 1j * TINY * e, v)[0].imag / TINY for e in np.eye(6)]
        along, rates = complex_gaps(system, q + 1j * TINY * v, v)
        np.testing.assert_allclose(H, np.transpose(slopes), atol=1e-14)
        np.testing.assert_allclose(Hdv, rates.imag / TINY, atol=1e-13)
        np.testing.assert_allclose((h, H @ v), (along.real, rates.real), atol=1e-14)


def test_gaps_are_those_of_the_corners(states: Any) -> None:
    """From rotation matrices, without a formula of the kernels."""
    case = load("red_body")
    p, system = numbers(case), system_of(case)

    def turned(angle: float, x: float, y: float) -> np.ndarray:
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, -s], [s, c]]) @ [x, y]

    a, b, d = p["half_width"], p["half_height"], p["slab_half_height"]
    for q, v in states:
        feet = [(q[3:5] + turned(q[5], x, -d))[1] for x in (-p["foot"], p["foot"])]
        lower = [turned(-q[5], *(q[:2] + turned(q[2], x, -b) - q[3:5]))[1] - d for x in (-a, a)]
        wall = p["wall"] - (q[:2] + turned(q[2], a, b))[0]
        np.testing.assert_allclose(system.gap(q, v)[0], [*feet, *lower, wall], atol=1e-14)


def test_action_is_reaction(states: Any) -> None:
    """A push between the bodies, seen from outside, is none: no net force, and no moment about any point."""
    system = system_of(load("red_body"))
    for q, v in states:
        for x, y, turn, X, Y, Turn in system.constraint(q, v)[0][[LEFT, RIGHT]]:
            np.testing.assert_allclose((x + X, y + Y), 0.0, atol=1e-14)
            moments = turn + q[0] * y - q[1] * x, Turn + q[3] * Y - q[4] * X
            assert sum(moments) == pytest.approx(0.0, abs=1e-13)


def test_energy_is_that_of_the_mass_matrix_and_the_weights(states: Any) -> None:
    system = system_of(load("red_body"))
    for q, v in states:
        M, f = system.terms(q, v)
        e = np.zeros(2, complex)
        system.energy(np.asarray(q, complex), np.asarray(v, complex), np.asarray(system.p, complex), e)
        assert e[0].real == pytest.approx(0.5 * v @ M @ v, rel=1e-14)
        system.energy(q + 1j * TINY * v, np.asarray(v, complex), np.asarray(system.p, complex), e)
        assert e[1].imag / TINY == pytest.approx(-f @ v, rel=1e-12)


# --- the run -------------------------------------------------------------------------------------------------------


def test_every_instant_of_the_resolved_run() -> None:
    """Times of the prototype to its digits; SUNDIALS finds them to 1e-11 s."""
    case = load("red_body")
    ours, theirs = run(case, rtol=1e-12), REFERENCE.prepare(case, "cvode", rtol=1e-12).run()
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
        value = metric(claim.metric).measure(from_run(found, claim.tier, ""), found, case)
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


def rate_of_left(found: Trajectory, at: int) -> float:
    return float(system_of(load("red_body")).gap(found.q[at], found.v[at])[1][LEFT])


# --- the order of modes -----------------------------------------------------------------------------------------------

ONE_AT_A_TIME = [
    *(("b0", value, True) for value in (3e5, 1e6, 3e6)),
    ("b0", 1e5, False),  # the right corner lands before the left one has settled
    ("b0", 1e7, False),  # the left corner bounces
    *(("zeta3", value, False) for value in (1.0, 1.5)),
    *(("zeta3", value, True) for value in (2.0, 3.0, 4.0)),
    *(("zeta4", value, True) for value in (0.0, 0.05, 0.1, 0.2)),
    *(("half_height", value, False) for value in (0.13, 0.142)),
    *(("half_height", value, True) for value in (0.145, 0.15, 0.2)),
]


@pytest.mark.parametrize(("name", "value", "kept"), ONE_AT_A_TIME)
def test_one_parameter_at_a_time(name: str, value: float, kept: bool) -> None:
    """The order is kept exactly where the case says that its inequalities hold."""
    case = load("red_body", **{name: value}, t_end=0.14)
    assert (not inequalities(numbers(case), frozen=False)) is kept
    assert ("mode_order" in {claim.metric for claim in case.claims}) is kept
    assert ("the order is not claimed" in case.title) is not kept
    assert (stages_in_order(run(case).events) == ALL) is kept


PAIRED = [(3e5, 1.52), (1e6, 1.95), (1e7, 3.05), (1e8, 4.64), (1e9, 6.94)]


@pytest.mark.parametrize(("b0", "zeta3"), PAIRED)
def test_other_stiffness_with_the_damping_that_catches(b0: float, zeta3: float) -> None:
    """v*(zeta3) = 2 v3."""
    case = load("red_body", b0=b0, zeta3=zeta3)
    fall = Fall(numbers(case))
    e = np.exp(-2.0 * zeta3 * np.arccosh(zeta3) / np.sqrt(zeta3**2 - 1.0))
    threshold = fall.press(fall.tilt, 0.0) / (np.sqrt(b0) * e**1.5)
    assert threshold == pytest.approx(2.0 * fall.speed, rel=0.02)
    assert stages_in_order(run(case).events) == ALL


def test_a_strong_damper_lets_go_at_the_instant_of_the_blow() -> None:
    """2 zeta4 w v4 > K g': the left corner is released when the right one is entered."""
    found = run(load("red_body", zeta4=0.2))
    landed = next(e.t for e in found.events if (e.contact, e.after) == (RIGHT, Mode.COLLISION))
    let_go = next(e.t for e in found.events if e.contact == LEFT and e.before is Mode.CONTACT)
    assert let_go == landed


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"b0": 1e7}, "bounces"), ({"zeta3": 1.0}, "bounces"), ({"b0": 1e5}, "settled"),
        ({"half_height": 0.13}, "flat"), ({"half_height": 0.142}, "weak"), ({"tilt": -0.2}, "lean"),
        ({"tilt": 0.7}, "lean"), ({"spin": 100.0}, "lean"), ({"spin": -20.0}, "rolls over"),
        ({"spin": -7.9, "speed_y": -0.9, "drop": 1e-3}, "takes off"),
    ],
)  # fmt: skip
def test_the_broken_inequality_is_named(changes: dict[str, float], word: str) -> None:
    assert word in load("red_body", **changes).title


def perturbed(draw: np.random.Generator, part: float, extras: bool) -> dict[str, float]:
    """Drop and tilt off by up to a part of themselves; with extras, everything else off a little too."""
    found = {"drop": 0.01 * (1 + draw.uniform(-part, part)), "tilt": 0.2 * (1 + draw.uniform(-part, part))}
    if extras:
        widths = {"speed_x": 0.05, "speed_y": 0.05, "spin": 0.1, "x": 0.02, "slab_tilt": 1e-4, "slab_height": 2e-5}
        found |= {name: draw.uniform(-width, width) for name, width in widths.items()}
    return found


FEW, MANY = 15, 200


@pytest.mark.parametrize("count", [FEW, pytest.param(MANY, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("part", "extras"), [(0.05, False), (0.05, True), (0.2, True)])
def test_order_is_kept_under_perturbations(part: float, extras: bool, count: int) -> None:
    draw = np.random.default_rng(5)
    for _ in range(count):
        changes = perturbed(draw, part, extras)
        found = run(load("red_body", **changes, t_end=0.14))
        assert stages_in_order(found.events) == ALL, changes
        feet = found.lam[:, :2][(found.mode[:, :2] == Mode.CONTACT).all(axis=1)]
        assert feet.min() > 19.619, changes


def test_anything_else_in_between_is_not_the_order() -> None:
    """A corner that bounces on its way is noticed, and a late row that comes up to the surface is not."""
    events = list(run(load("red_body")).events)
    assert stages_in_order(events) == ALL
    assert stages_in_order(events[:-2]) == ALL - 1
    assert stages_in_order([e for e in events if e.contact != RIGHT]) == 2
    assert stages_in_order([e for e in events if e.after is not Mode.CONTACT]) == 1
    assert stages_in_order([]) == 0


# --- frozen against resolved ------------------------------------------------------------------------------------------


def test_frozen_run_is_the_closed_form_of_the_box_alone() -> None:
    case = load("red_body", "frozen")
    fall, found = Fall(numbers(case)), run(case, rtol=1e-12)
    touch, landed = (next(e.t for e in found.events if (e.contact, e.after) == (row, Mode.COLLISION)) for row in (2, 3))
    assert touch == pytest.approx(fall.touch, abs=1e-12)
    assert landed == pytest.approx(fall.touch + fall.rotation, abs=1e-11)
    assert stages_in_order(found.events) == ALL
    impulses = [e.impulse for e in found.events if e.impulse]
    assert impulses == pytest.approx([fall.caught, fall.struck], rel=1e-9)
    at = np.flatnonzero(found.t == landed)[0]
    assert found.v[at, 2] == pytest.approx(fall.turning(0.0), rel=1e-9)
    assert fall.turning(0.0) == pytest.approx(-4.327, abs=5e-4)


def test_everything_of_the_blow_carries_one_time_stamp() -> None:
    found = run(load("red_body", "frozen"))
    blow = [e for e in found.events if e.t > 0.1]
    assert {(e.contact, e.before, e.after) for e in blow} == {
        (LEFT, Mode.CONTACT, Mode.FREE),
        (RIGHT, Mode.FREE, Mode.COLLISION),
        (RIGHT, Mode.COLLISION, Mode.FREE),
    }
    assert len({e.t for e in blow}) == 1


def test_where_collisions_overlap_in_real_time_the_orders_differ() -> None:
    """b0 1e5: frozen keeps the order, resolved does not; zeta3 1.5: caught by the press in front of the blow alone."""
    for changes in ({"b0": 1e5}, {"zeta3": 1.5}):
        assert order("frozen", **changes) == ALL
        assert order("resolved", **changes) < ALL


LADDER = {1e6: 1.95, 1e7: 3.05, 1e8: 4.64, 1e9: 6.94}
"""b0 and the zeta3 that catches at twice the speed."""


def test_frozen_is_the_limit_of_resolved_with_order_one_half() -> None:
    """State at the fixed time 0.118 s, between which both are free: |dv| and |dq| fall as b0^-1/2."""
    dq, dv = [], []
    for b0, zeta3 in LADDER.items():
        a, b = (run(load("red_body", v, b0=b0, zeta3=zeta3, t_end=0.118), rtol=1e-11) for v in ("resolved", "frozen"))
        dq.append(np.abs(a.q[-1] - b.q[-1]).max())
        dv.append(np.linalg.norm(a.v[-1] - b.v[-1]))
    slopes = [-np.polyfit(np.log(list(LADDER)), np.log(d), 1)[0] for d in (dq, dv)]
    assert slopes == pytest.approx([0.5, 0.5], abs=0.05)
    assert dv == pytest.approx([0.124, 0.0397, 0.0126, 0.0040], rel=0.02)
