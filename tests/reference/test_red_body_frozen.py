"""The red body's collisions in no time against those in real time."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import pytest
from red_body_scene import ALL, numbers, order, run, system_of

from crossbody.cases import Case, Mode, Trajectory, load
from crossbody.cases.mechanisms.red_body.order import LEFT, RIGHT, Fall, stages_in_order
from crossbody.reference import System, simulate
from crossbody.reference.systems import red_body as kernels
from crossbody.reports.pages.figures import FIGURES
from crossbody.reports.runs.store import Trace
from crossbody.reports.runs.study import _steps


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


def blow(b0: float, zeta4: float, half_height: float, spin: float = -4.327, turn: bool = True) -> tuple[Case, Any, Any]:
    """A level box whose left corner rests on the slab and whose right one comes down."""
    case = load("red_body", b0=b0, zeta4=zeta4, half_height=half_height, gravity=9.81)
    p = numbers(case)
    q = np.array([0.0, 2 * p["slab_half_height"] + half_height, 0.0, 0.0, p["slab_half_height"], 0.0])
    return case, q, np.array([0.0, p["half_width"] * spin, spin if turn else 0.0, 0.0, 0.0, 0.0])


def left_at_rest(case: Case) -> System:
    """Its left corner with slow constants alone, so that it is in CONTACT from the start."""
    law = case.law
    b0, b1 = (np.where(np.arange(5) == LEFT, 0.0, b) for b in (law.b0, law.b1))
    held = type(law)(a0=law.a0, a1=law.a1, a2=law.a2, unilateral=law.unilateral, b0=b0, b1=b1)
    return kernels.build(case.parameters, held)


def mapped(case: Case, q: Any, v: Any, e: float, held: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """v+ = v - (1 + e) h4' M^-1 Ha^T Ga^-1 e_n with the rows `held` besides the right corner, and the impulses."""
    system = system_of(case)
    M, (H, _, _) = system.mass_matrix(q), system.constraint(q)
    rows = H[[*held, RIGHT]]
    G = rows @ np.linalg.solve(M, rows.T)
    pulse = np.zeros(len(rows))
    pulse[-1] = -(1.0 + e) * float(H[RIGHT] @ v)
    P = np.linalg.solve(G, pulse)
    return v + np.linalg.solve(M, rows.T @ P), P


def restitution(zeta: float) -> float:
    return float(np.exp(-2.0 * zeta * np.arccos(zeta) / np.sqrt(1.0 - zeta**2)))


@pytest.mark.parametrize(
    ("half_height", "G33", "G34", "kept", "P3", "P4", "rate3", "rate4", "loss"),
    [
        (0.05, 3.4, -1.4, True, 0.2292, 0.5567, 0.0, 0.5717, -0.1192),
        (0.15, 1.9231, 0.0769, False, -0.0327, 0.8186, 0.0629, 0.5717, -0.1750),
    ],
)
def test_exact_map_with_one_row_in_contact(
    half_height: float, G33: float, G34: float, kept: bool,
    P3: float, P4: float, rate3: float, rate4: float, loss: float,
) -> None:  # fmt: skip
    """A flat box keeps its left corner; under a tall one the corner would pull, and is let go. v = 1, zeta .2."""
    case, q, v = blow(1e10, 0.2, half_height, spin=-5.0)
    system, e, feet = system_of(case), restitution(0.2), (0, 1)
    H = system.constraint(q)[0]
    box = H[[LEFT, RIGHT], :3]
    G = box @ np.linalg.solve(system.mass_matrix(q)[:3, :3], box.T)
    assert (G[0, 0], G[0, 1]) == pytest.approx((G33, G34), abs=5e-5)
    both, impulses = mapped(case, q, v, e, (*feet, LEFT))
    assert impulses[2:] == pytest.approx([P3, P4], abs=5e-5)
    expected, _ = (both, impulses) if kept else mapped(case, q, v, e, feet)
    for tilt in (0.0, 1e-8):  # at t = 0 too, what rests is held before what comes down strikes
        found = simulate(left_at_rest(case), q + tilt * np.eye(6)[2], v, 1e-6, rtol=1e-10)
        np.testing.assert_allclose(found.v[-1], expected, atol=1e-4)
    after = H @ expected
    assert after[[LEFT, RIGHT]] == pytest.approx([rate3, rate4], abs=5e-5)
    M = system.mass_matrix(q)
    assert 0.5 * (expected @ M @ expected - v @ M @ v) == pytest.approx(loss, abs=5e-5)
    let_go = any(e.contact == LEFT and e.before is Mode.CONTACT for e in found.events)
    assert let_go is not kept


TALL = {1e6: 1.25e-1, 1e7: 3.98e-2, 1e8: 1.26e-2, 1e9: 3.98e-3, 1e10: 1.26e-3}
TALL_ELASTIC = {1e6: 1.23e-1, 1e7: 3.97e-2, 1e8: 1.26e-2, 1e9: 4.00e-3, 1e10: 1.27e-3}
FLAT = {1e4: 1.01e-1, 1e5: 9.3e-3, 1e6: 9.2e-4, 1e7: 9.1e-5, 1e8: 1.1e-5, 1e9: 3.8e-6, 1e10: 1.2e-6}


@pytest.mark.parametrize(
    ("half_height", "zeta4", "wanted", "digits"),
    [(0.15, 0.05, TALL, 0.01), (0.15, 0.0, TALL_ELASTIC, 0.01), (0.05, 0.2, FLAT, 0.03)],
)
def test_resolved_blow_at_its_own_separation(
    half_height: float, zeta4: float, wanted: dict[float, float], digits: float
) -> None:
    """|dv| of the map falls as b0^-1/2 for the tall box; the flat one has first order until the slow forces show."""
    found = []
    for b0 in wanted:
        case, q, v = blow(b0, zeta4, half_height)
        run = simulate(left_at_rest(case), q, v, 20.0 / np.sqrt(b0), rtol=1e-12, collisions="resolved")
        parted = next(e.t for e in run.events if e.contact == RIGHT and e.before is Mode.COLLISION)
        feet = (0, 1) if half_height > 0.1 else (0, 1, LEFT)
        ideal, _ = mapped(case, q, v, restitution(zeta4), feet)
        found.append(float(np.abs(run.v[np.flatnonzero(run.t == parted)[0]] - ideal).max()))
    assert found == pytest.approx(list(wanted.values()), rel=digits)
    slope = -np.polyfit(np.log(list(wanted))[-4:], np.log(found)[-4:], 1)[0]
    if half_height > 0.1:
        assert slope == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(("b0", "zeta4"), [(1e5, 0.05), (1e10, 0.0)])
@pytest.mark.parametrize("rule", ["resolved", "sequential"])
def test_a_release_at_rounding_makes_no_false_cycle(b0: float, zeta4: float, rule: str) -> None:
    """h and h' of 1e-17 at lam = 0 once switched for ever here; each row switches a few times and the run goes on."""
    case, q, v = blow(b0, zeta4, 0.15)
    run = simulate(left_at_rest(case), q, v, 20.0 / np.sqrt(b0), rtol=1e-12, collisions=rule)
    assert run.outcome.ok, run.message
    assert len(run.events) < 20
    full = simulate(system_of(load("red_body", b0=b0, zeta4=zeta4, zeta3=8.0)), *start_of(b0), 0.3, collisions=rule)
    assert full.outcome.ok, full.message


def start_of(b0: float) -> tuple[np.ndarray, np.ndarray]:
    case = load("red_body", b0=b0)
    return case.q0, case.v0


def steps_between(found: Trajectory, start: float, end: float) -> np.ndarray:
    ends = np.unique(found.t)
    inside = (ends[:-1] >= start) & (ends[1:] <= end)
    return np.diff(ends)[inside]


def test_step_size_recovers_after_each_transient() -> None:
    """Not stiff after the transient: steps of the slow phases are hundreds of times those of collisions."""
    found = run(load("red_body"), rtol=1e-10)
    touch, caught, landed, let_go, parted, up = (e.t for e in found.events[2:])
    before, settling = steps_between(found, 0.0, touch), steps_between(found, touch, caught)
    held, blow_, free = (steps_between(found, a, b) for a, b in ((caught, landed), (let_go, parted), (up, found.t[-1])))
    assert before.max() > 100.0 * settling.min()
    assert held.max() > 100.0 * settling.min()
    assert held.max() > 30.0 * blow_.max()
    assert free.max() > 10.0 * blow_.max()


def test_the_report_draws_the_step_size() -> None:
    found = run(load("red_body"))
    about = {"engine": "reference", "profile": "compiled", "steps": _steps(found.t)}
    title, draw = FIGURES["steps"]
    figure = draw([Trace(about=about, run=found)], 10 * len(found.t))
    (line,) = figure["data"]
    starts, lengths = (np.frombuffer(base64.b64decode(line[axis]["bdata"]), line[axis]["dtype"]) for axis in "xy")
    assert title == "Step size"
    np.testing.assert_allclose(starts, np.unique(found.t), rtol=1e-7)  # the last step to its end
    np.testing.assert_allclose(lengths[:-1], np.diff(np.unique(found.t)), rtol=5e-4)  # four digits are drawn
    assert lengths[-1] == lengths[-2]
    assert figure["layout"]["yaxis"]["type"] == "log"
