"""Three integrators that share nothing but the kernels give the same motion and the same events."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import pytest
from mechanisms import ball, oscillator, sliders
from wall_pendulum import wall_pendulum

from crossbody.cases import InvalidValue, Outcome, SceneError, Trajectory
from crossbody.reference import System, delta, simulate
from crossbody.reference.sundials.equations import Equations

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
INDEPENDENT = ("cvode", "ida")
WITHIN = 100.0  # times the tolerance
LIFTED = [np.sin(-0.5), -np.cos(0.5)]
PUSH = ([0.5, 1.0], [[2.0], [0.0]])


@dataclass(frozen=True)
class Scene:
    system: System
    q0: list[float]
    v0: list[float]
    t_end: float
    events: int
    more: dict[str, Any] = field(default_factory=dict)


def robot() -> Scene:
    pose = delta.inverse(delta.LIGHT, (0.05, 0.0, 0.6))
    hold = np.concatenate([delta.gravity_torque(delta.LIGHT, pose)[0], np.zeros(3)])
    pulse = hold + np.array([0.0, 0.0, 0.0, 1.0, 0.5, -0.3])
    inputs = ([0.0, 0.1, 0.12], [hold, pulse, hold])
    return Scene(delta.system(delta.LIGHT), list(pose), [0.0] * 9, 0.5, 0, {"inputs": inputs})


SCENES = {
    "listing": Scene(ball(), [1.0], [0.0], 2.0, 7),
    "elastic": Scene(ball(a1=0.0), [1.0], [0.0], 2.5, 6),
    "linear": Scene(ball(a0=1e4, a1=20.0, a2=0.0), [1.0], [0.0], 1.5, 6),
    "sliders": Scene(sliders(3, a0=1e4, a1=20.0, masses=[1.0, 3.0, 2.0]), [0.0, 0.1, 0.23], [1.0, 0.0, -0.5], 0.5, 6),
    "pendulum": Scene(wall_pendulum(5.0), LIFTED, [0.0, 0.0], 2.0, 0),
    "pendulum at a wall": Scene(wall_pendulum(0.1, drag=0.1), LIFTED, [0.0, 0.0], 1.9, 6, {"inputs": PUSH}),
    "delta robot": robot(),
}
CASES = [(name, rtol) for name in SCENES for rtol in TOLERANCES]


@cache
def run(name: str, solver: str, rtol: float, index: int = 1) -> Trajectory:
    s = SCENES[name]
    grid = np.linspace(0.0, s.t_end, 53)
    options = {"rtol": rtol, "samples": grid, "solver": solver, "ledger": True, "time_limit": 60.0}
    return simulate(s.system, s.q0, s.v0, s.t_end, index=index, **options, **s.more)


def labels(run: Trajectory) -> list[tuple[int, int, int]]:
    return [(int(e.contact), int(e.before), int(e.after)) for e in run.events]


@pytest.mark.parametrize("solver", INDEPENDENT)
@pytest.mark.parametrize(("name", "rtol"), CASES)
def test_motion_and_events_agree(name: str, rtol: float, solver: str) -> None:
    """Positions are continuous at events, so the whole grid counts; times of events are compared one by one."""
    ours, other = run(name, "compiled", rtol), run(name, solver, rtol)
    assert ours.outcome.ok, ours.message
    assert other.outcome.ok, other.message
    assert labels(ours) == labels(other)
    assert len(ours.events) == SCENES[name].events
    times = [abs(a.t - b.t) for a, b in zip(ours.events, other.events, strict=True)]
    assert max(times, default=0.0) <= WITHIN * rtol
    np.testing.assert_allclose(other.q, ours.q, rtol=0.0, atol=WITHIN * rtol * max(1.0, np.abs(ours.q).max()))


@pytest.mark.parametrize("solver", INDEPENDENT)
@pytest.mark.parametrize("name", SCENES)
def test_multipliers_agree_between_events(name: str, solver: str) -> None:
    """A shift of the time by dt moves lam by lam' dt: a row in contact is compared against its own largest value."""
    ours, other = run(name, "compiled", 1e-10), run(name, solver, 1e-10)
    largest = np.abs(ours.lam).max(axis=0)
    assert (np.abs(other.lam - ours.lam).max(axis=0) <= 1e-6 * largest).all()


@pytest.mark.parametrize("solver", ["compiled", *INDEPENDENT])
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("rtol", [1e-6, 1e-10])
def test_energy_is_accounted_for(name: str, rtol: float, solver: str) -> None:
    found = run(name, solver, rtol)
    assert found.ledger is not None
    made = found.ledger.input - found.ledger.dissipated + found.ledger.contact.sum(axis=1)
    change = found.total_energy - found.total_energy[0]
    assert np.abs(change - made).max() <= WITHIN * rtol * max(1.0, np.abs(found.energy).max())


@pytest.mark.parametrize("solver", INDEPENDENT)
@pytest.mark.parametrize("name", SCENES)
def test_every_account_agrees(name: str, solver: str) -> None:
    """Work of each row by itself, of the inputs and of damping: their sum alone could hide which did it."""
    ours, other = (run(name, each, 1e-10).ledger for each in ("compiled", solver))
    assert ours is not None
    assert other is not None
    scale = max(1.0, float(np.abs(run(name, "compiled", 1e-10).energy).max()))
    for account in ("contact", "input", "dissipated"):
        off = np.abs(getattr(other, account) - getattr(ours, account)).max(initial=0.0)
        assert off <= 1e-6 * scale, account


@pytest.mark.parametrize("name", ["pendulum", "pendulum at a wall", "delta robot"])
@pytest.mark.parametrize("rtol", TOLERANCES)
def test_rigid_bilateral_rows_give_the_motion_of_index_one(name: str, rtol: float) -> None:
    ours, rigid = run(name, "compiled", rtol), run(name, "ida", rtol, index=3)
    assert rigid.outcome.ok, rigid.message
    assert labels(ours) == labels(rigid)
    held = ~np.asarray(SCENES[name].system.unilateral, dtype=bool)
    assert np.abs(rigid.gap[:, held]).max() <= WITHIN * rtol
    np.testing.assert_allclose(rigid.q, ours.q, rtol=0.0, atol=WITHIN * rtol * max(1.0, np.abs(ours.q).max()))


STARTS = {
    "at rest on the floor": (ball(), [0.0], [0.0], 0.5, [(0, 0, 1)]),
    "below the floor": (ball(), [-0.1], [0.0], 0.5, [(0, 0, 1), (0, 1, 2), (0, 2, 0)]),
    "below the floor, rising": (ball(), [-0.1], [3.0], 0.5, [(0, 0, 1), (0, 1, 2), (0, 2, 0)]),
    "grazing inside one step": (oscillator(-0.5), [0.501], [0.0], 4.0, [(0, 0, 1), (0, 1, 2), (0, 2, 0)]),
    "passing by": (oscillator(-0.5), [0.5 - 1e-7], [0.0], 4.0, []),
    "two together": (sliders(3, a0=1e4, a1=10.0), [0.0, 0.1, 0.2], [1.0, 0.0, -1.0], 0.5, None),
    "two time scales": (ball(b0=1e6, b1=200.0, a0=1.0, a1=2.0, a2=0.0), [0.1], [0.0], 0.5, None),
}


@pytest.mark.parametrize("solver", INDEPENDENT)
@pytest.mark.parametrize("name", STARTS)
def test_machines_agree(name: str, solver: str) -> None:
    """Contacts that touch at one instant may be named in either order: the events are compared contact by contact."""
    system, q0, v0, t_end, expected = STARTS[name]
    ours, other = (simulate(system, q0, v0, t_end, solver=s, collisions="resolved") for s in ("compiled", solver))
    assert sorted(labels(ours), key=lambda e: e[0]) == sorted(labels(other), key=lambda e: e[0])
    if expected is not None:
        assert labels(other) == expected
    for i in range(system.nc):
        pairs = zip(ours.transitions(i), other.transitions(i), strict=True)
        assert max((abs(a.t - b.t) for a, b in pairs), default=0.0) < 1e-6


@pytest.mark.parametrize("solver", INDEPENDENT)
@pytest.mark.parametrize("a0", [1e4, 1e8, 1e12])
def test_a_stiff_rest_is_cheap(solver: str, a0: float) -> None:
    """Pressed into a floor of double pole for 5 s: steps do not follow the stiffness."""
    w = a0**0.5
    rest = simulate(ball(a0=a0, a1=2.0 * w, a2=0.0), [0.0], [-0.001 * 9.81 / w], 5.0, rtol=1e-6, solver=solver)
    assert rest.outcome.ok
    assert len(rest.events) == 1
    assert rest.steps < 1000
    assert rest.lam[-1, 0] == pytest.approx(9.81, rel=1e-5)


def test_equations_agree_with_the_robots_own_solution() -> None:
    """LU of the whole matrix against the blocks that the compiled loop uses, off the manifold too."""
    system, rng = delta.system(delta.LIGHT), np.random.default_rng(5)
    equations = Equations(system)
    equations.activate([5] * 6)
    pose = delta.inverse(delta.LIGHT, (0.05, 0.0, 0.6))
    for _ in range(100):
        q, v, u = pose + 0.1 * rng.normal(size=9), rng.normal(size=9), rng.normal(size=6)
        equations.u[:] = u
        vd, lam, hd = np.zeros(9), np.zeros(6), np.zeros(6)
        law = np.array(system.alpha)
        assert system.solve(0.0, q, v, u, np.array(system.p), np.zeros(18), law, np.arange(6), 6, vd, lam, hd) == 0
        ours = equations.accelerate(0.0, q, v)
        np.testing.assert_allclose(ours[0], vd, rtol=1e-9, atol=1e-9 * np.abs(vd).max())
        np.testing.assert_allclose(ours[1], lam, rtol=1e-9, atol=1e-9 * np.abs(lam).max())


@pytest.mark.parametrize("solver", INDEPENDENT)
def test_ends_are_outcomes(solver: str) -> None:
    def end(system: System, q0: list[float], v0: list[float], **options: Any) -> Trajectory:
        return simulate(system, q0, v0, 1.0, solver=solver, **options)

    assert end(ball(), [1.0], [0.0], max_steps=20).outcome is Outcome.STEP_LIMIT
    assert end(ball(), [1.0], [0.0], time_limit=1e-9).outcome is Outcome.TIME_LIMIT
    with pytest.raises(SceneError, match=r"q = \[0.0, 0.0\]"):  # the rod's direction is 0/0
        end(wall_pendulum(5.0), [0.0, 0.0], [0.0, 0.0])


@pytest.mark.parametrize("solver", ["compiled", *INDEPENDENT])
def test_rows_that_depend_on_each_other_at_the_start_are_named(solver: str) -> None:
    """Rod and wall along one line: neither can be chosen."""
    run = simulate(wall_pendulum(0.9), [1.0, 0.0], [0.1, 0.0], 1.0, solver=solver, consistent=False)
    assert run.outcome is Outcome.ILL_POSED
    assert "ows [0, 1]" in run.message


@pytest.mark.parametrize("solver", INDEPENDENT)
def test_a_run_repeats_bit_for_bit(solver: str) -> None:
    first, second = (simulate(ball(), [1.0], [0.0], 1.2, rtol=1e-6, solver=solver) for _ in range(2))
    assert np.array_equal(first.q, second.q)
    assert first.events == second.events


@pytest.mark.parametrize("solver", INDEPENDENT)
@pytest.mark.parametrize("fsm", ["edge", "memoryless"])
def test_other_machines_are_refused(solver: str, fsm: str) -> None:
    with pytest.raises(InvalidValue, match="valid: 'level'"):
        simulate(ball(), [1.0], [0.0], 1.0, solver=solver, fsm=fsm)


def test_rigid_rows_need_a_start_on_them() -> None:
    with pytest.raises(SceneError, match="index=3"):
        simulate(wall_pendulum(5.0), [0.0, -1.1], [0.0, 0.0], 1.0, solver="ida", index=3, consistent=False)
