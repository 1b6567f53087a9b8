"""Frozen collisions and discrete variables: laws that the compiled loop and the independent solvers must all keep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from many_contacts import box, constant, restless, shuttle, tower, trapdoor
from mechanisms import ball, sliders
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag
from wall_pendulum import wall_pendulum

from crossbody.cases import Event, Mode, Outcome, Trajectory
from crossbody.cases.closed_forms import damping_ratio, restitution, threshold_speed
from crossbody.reference import System, simulate

SOLVERS = ("compiled", "cvode", "ida")
INDEPENDENT = SOLVERS[1:]
RULES = ("sequential", "simultaneous")
TOLERANCES = (1e-6, 1e-9)
WITHIN = 100.0  # times the tolerance
E_BOX = 0.571740


def colliding(base: System, zeta: float, b0: float = 1e6) -> System:
    """The same mechanism with slow constants (1, 1) and fast ones."""
    kernels = {name: getattr(base, name) for name in ("dynamics", "gaps", "rows", "energy")}
    return System(
        n=base.n, mass_block=1, parameters=base.p, a0=np.ones(base.nc), a1=1.0, b0=b0, b1=2.0 * zeta * b0**0.5,
        **kernels,
    )  # fmt: skip


def damping_for(e: float) -> float:
    """The zeta whose restitution is e, by bisection."""
    low, high = 0.0, 10.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if restitution(middle) > e else (low, middle)
    return low


def chain(
    n: int, k: int, masses: list[float] | None = None, zeta: float = 0.0
) -> tuple[System, list[float], list[float]]:
    """Sliders of which the first k move at 1 m/s towards the others, which touch and rest."""
    return colliding(sliders(n, masses=masses), zeta), [-0.1] * k + [0.0] * (n - k), [1.0] * k + [0.0] * (n - k)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(("n", "k"), [(n, k) for n in range(2, 7) for k in range(1, n)])
def test_k_in_k_out(n: int, k: int, solver: str) -> None:
    system, q0, v0 = chain(n, k)
    run = simulate(system, q0, v0, 0.2, solver=solver, collisions="sequential")
    assert run.outcome.ok, run.message
    np.testing.assert_allclose(run.v[-1], v0[::-1], atol=1e-10)
    assert len(run.events) == 2 * k * (n - k)
    assert sum(e.impulse for e in run.events) == pytest.approx(k * (n - k), abs=1e-10)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("e", [1.0, 0.5])
def test_unequal_masses_one_after_the_other(e: float, solver: str) -> None:
    """v2 = (1 + e) m1 v1 / (m1 + m2) for each pair in turn; with e = 1: (1/3, 4/9, 16/9)."""
    system, q0, v0 = chain(3, 1, [4.0, 2.0, 1.0], damping_for(e))
    run = simulate(system, q0, v0, 0.1001, solver=solver, collisions="sequential")
    first = [(4.0 - 2.0 * e) / 6.0, (1.0 + e) * 4.0 / 6.0]
    wanted = [first[0], first[1] * (2.0 - e) / 3.0, first[1] * (1.0 + e) * 2.0 / 3.0]
    if wanted[0] > wanted[1]:
        centre, half = (4.0 * wanted[0] + 2.0 * wanted[1]) / 6.0, (wanted[0] - wanted[1]) * e
        wanted[0], wanted[1] = centre - half * 2.0 / 6.0, centre + half * 4.0 / 6.0
    np.testing.assert_allclose(run.v[-1], wanted, atol=1e-10)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("n", range(2, 7))
def test_simultaneous_rows_act_as_one_block(n: int, solver: str) -> None:
    system, q0, v0 = chain(n, 1)
    run = simulate(system, q0, v0, 0.2, solver=solver, collisions="simultaneous")
    np.testing.assert_allclose(run.v[-1], [(2.0 - n) / n] + [2.0 / n] * (n - 1), atol=1e-10)


@dataclass(frozen=True)
class Scene:
    system: System
    q0: list[float]
    v0: list[float]
    t_end: float
    rule: str = "sequential"
    events: int | None = None


LIFTED = [np.sin(-0.5), -np.cos(0.5)]
SCENES = {
    "sliders with gaps": Scene(
        colliding(sliders(4, masses=[1.0, 3.0, 2.0, 5.0]), 0.1), [-0.2, 0.0, 0.05, 0.3], [1.0, 0.1, 0.0, -0.7], 0.5
    ),
    "bounces until captured": Scene(colliding(ball(a2=0.0), 0.1), [0.1], [0.0], 1.5),
    "pendulum at a wall": Scene(
        wall_pendulum(0.1, drag=0.1, a0=1.0, a1=1.0, b0=[0.0, 1e6], b1=[0.0, 400.0]), LIFTED, [0.0, 0.0], 3.0
    ),
    "two balls above a floor": Scene(tower([1.0, 2.0], zeta=0.5), [0.1, 0.3], [0.0, 0.0], 0.8),
    "a stack drops": Scene(tower([2.0, 1.0], zeta=0.5), [0.1, 0.1], [0.0, 0.0], 0.8),
    "a stack drops as one": Scene(tower([2.0, 1.0], zeta=0.5), [0.1, 0.1], [0.0, 0.0], 0.8, "simultaneous"),
    "a ball on a standing stack": Scene(tower([1.0, 2.0, 0.5], zeta=0.3), [0.0, 0.0, 0.1], [0.0] * 3, 0.5),
    "a ball on a standing stack, as one": Scene(
        tower([1.0, 2.0, 0.5], zeta=0.3), [0.0, 0.0, 0.1], [0.0] * 3, 0.5, "simultaneous"
    ),
    "a flat box on its corner": Scene(box(0.05, zeta=0.2), [0.0, 0.0588, 0.1], [0.0, 0.0, 0.0], 0.3),
    "a tall box on its corner": Scene(box(0.15, zeta=0.2), [0.0, 0.162, 0.1], [0.0, 0.0, 0.0], 0.235),
    "shuttle": Scene(shuttle(), [0.0], [0.0], 5.0),
    "trapdoor": Scene(trapdoor(), [0.2], [0.0], 1.0),
    "trapdoor, frozen": Scene(trapdoor(1e6), [0.2], [0.0], 1.2),
    "trapdoor, resolved": Scene(trapdoor(1e6), [0.2], [0.0], 1.0, "resolved"),
}


@cache
def run_of(name: str, solver: str, rtol: float) -> Trajectory:
    s = SCENES[name]
    grid = np.linspace(0.0, s.t_end, 57)
    return simulate(
        s.system, s.q0, s.v0, s.t_end, rtol=rtol, samples=grid, solver=solver, collisions=s.rule, ledger=True,
        time_limit=60.0,
    )  # fmt: skip


def labels(run: Trajectory) -> list[tuple[int, int, int]]:
    return [(int(e.contact), int(e.before), int(e.after)) for e in run.events]


def transitions(name: str, run: Trajectory, i: int) -> list[Event]:
    """Those of one row; a captured row is at h = 0 within the tolerance: it parts with or without BALLISTIC."""
    may_drift = SCENES[name].system.beta[i, 0] > 0.0 and SCENES[name].rule != "resolved"
    return [e for e in run.transitions(i) if not (may_drift and e.after == Mode.BALLISTIC)]


@pytest.mark.parametrize("solver", INDEPENDENT)
@pytest.mark.parametrize("rtol", TOLERANCES)
@pytest.mark.parametrize("name", SCENES)
def test_motion_events_and_switches_agree(name: str, rtol: float, solver: str) -> None:
    """Within 100 rtol of the scene's size; rows that switch at one instant may be named in either order."""
    ours, other = run_of(name, "compiled", rtol), run_of(name, solver, rtol)
    assert ours.outcome.ok, ours.message
    assert other.outcome.ok, other.message
    for i in range(SCENES[name].system.nc):
        pairs = transitions(name, ours, i), transitions(name, other, i)
        assert [e.after for e in pairs[0]] == [e.after for e in pairs[1]]
        for a, b in zip(*pairs, strict=True):
            assert abs(a.t - b.t) <= WITHIN * rtol
            assert a.impulse == pytest.approx(b.impulse, abs=WITHIN * rtol * max(1.0, a.impulse))
    assert [(s.variable, s.before, s.after) for s in ours.switches] == [
        (s.variable, s.before, s.after) for s in other.switches
    ]
    times = [abs(a.t - b.t) for a, b in zip(ours.switches, other.switches, strict=True)]
    assert max(times, default=0.0) <= WITHIN * rtol
    np.testing.assert_allclose(other.q, ours.q, rtol=0.0, atol=WITHIN * rtol * max(1.0, np.abs(ours.q).max()))
    np.testing.assert_allclose(other.v[-1], ours.v[-1], rtol=0.0, atol=WITHIN * rtol * max(1.0, np.abs(ours.v).max()))


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", [name for name in SCENES if name != "shuttle"])  # its force has no potential
def test_the_work_of_impulses_is_in_the_ledger(name: str, solver: str) -> None:
    run = run_of(name, solver, 1e-9)
    assert run.ledger is not None
    made = run.ledger.input - run.ledger.dissipated + run.ledger.contact.sum(axis=1)
    change = run.total_energy - run.total_energy[0]
    assert np.abs(change - made).max() <= WITHIN * 1e-9 * max(1.0, np.abs(run.energy).max())


def landing(run: Trajectory, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Velocities before and behind the first frozen collision of a row."""
    t = next(e.t for e in run.events if e.contact == row and e.before == Mode.COLLISION)
    at = np.flatnonzero(np.abs(run.t - t) <= 1e-12)
    return run.v[at[0]], run.v[at[-1]]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(
    ("half_height", "impulses", "rates", "change"),
    [(0.05, (0.2292, 0.5567), (0.0, 0.5717), -0.1192), (0.15, (0.0, 0.8173), (0.0629, 0.5717), -0.1750)],
    ids=["flat, the row is held", "tall, the row would pull"],
)
def test_a_corner_lands_beside_a_held_one(
    half_height: float, impulses: tuple[float, ...], rates: tuple[float, ...], change: float, solver: str
) -> None:
    """Level box at 1 m/s: M (v+ - v) = H^T P and H v+ to four digits of an independent computation."""
    system = box(half_height, zeta=damping_for(E_BOX))
    tilt = 1e-7  # corner 0 stands, corner 1 is 20 nm above the floor
    q0 = [0.0, half_height * np.cos(tilt) + 0.1 * np.sin(tilt), tilt]
    H, _, _ = system.constraint(q0)
    v0 = np.linalg.pinv(H) @ np.array([0.0, -1.0])
    run = simulate(system, q0, v0, 1e-5, solver=solver, collisions="sequential")
    before, behind = landing(run, 1)
    M = system.mass_matrix(q0)
    found = np.linalg.lstsq(H.T, M @ (behind - before), rcond=None)[0]
    np.testing.assert_allclose(found, impulses, atol=6e-5)
    np.testing.assert_allclose(H @ behind, rates, atol=6e-5)
    assert 0.5 * (behind @ M @ behind - before @ M @ before) == pytest.approx(change, abs=6e-5)
    assert ((0, Mode.CONTACT, Mode.FREE) in labels(run)) == (impulses[0] == 0.0)


def complementary(G: np.ndarray, press: np.ndarray, n: int) -> np.ndarray:
    """Lam >= 0 of the held rows with h'' >= 0 and lam h'' = 0, beside row n whose h'' is given; all subsets tried."""
    held = [i for i in range(len(G)) if i != n]
    for size in range(len(held), -1, -1):
        for subset in combinations(held, size):
            rows = [*subset, n]
            lam = np.zeros(len(G))
            lam[rows] = np.linalg.solve(G[np.ix_(rows, rows)], press[rows])
            if (lam[list(subset)] >= -1e-9 * np.abs(lam).max()).all() and (G @ lam)[held].min() >= -1e-9 * abs(
                press[n]
            ):
                return lam
    raise AssertionError("no solution")


def fast_velocity(M: np.ndarray, H: np.ndarray, v: np.ndarray, n: int, b0: float, b1: float) -> np.ndarray:
    """Integrate M v' = H^T lam, M and H frozen, until lam_n = 0: row n obeys the fast law, held rows may not pull."""
    G, nv = H @ np.linalg.solve(M, H.T), len(v)

    def lam(y: np.ndarray) -> np.ndarray:
        wanted = np.zeros(len(H))
        wanted[n] = -b1 * (H[n] @ y[nv:]) - b0 * (H[n] @ y[:nv])
        return complementary(G, wanted, n) if wanted[n] > 0.0 else np.zeros(len(H))

    def spent(t: float, y: np.ndarray) -> float:
        return float(-b1 * (H[n] @ y[nv:]) - b0 * (H[n] @ y[:nv])) + (1e-9 if t == 0.0 else 0.0)

    spent.terminal, spent.direction = True, -1.0  # type: ignore[attr-defined]
    start = np.concatenate([np.zeros(nv), v])
    begin = solve_ivp(lambda t, y: np.concatenate([y[nv:], np.linalg.solve(M, H.T @ lam(y))]), (0.0, 1e-6 / b0**0.5),
                      start, rtol=1e-11, atol=1e-14)  # fmt: skip
    done = solve_ivp(lambda t, y: np.concatenate([y[nv:], np.linalg.solve(M, H.T @ lam(y))]), (0.0, 1e3 / b0**0.5),
                     begin.y[:, -1], rtol=1e-10, atol=1e-13, events=spent)  # fmt: skip
    assert done.status == 1
    behind: np.ndarray = done.y[nv:, -1]
    return behind


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("zeta", [0.0, 0.2, 1.0, 2.0])
@pytest.mark.parametrize("seed", range(4))
def test_the_map_is_the_solution_of_the_fast_system(seed: int, zeta: float, solver: str) -> None:
    """Two rows pressed together, a third collides: against a numerical integration of the frozen fast system."""
    rng = np.random.default_rng(seed)
    root, H = rng.normal(size=(4, 4)), rng.normal(size=(3, 4))
    M = root @ root.T + np.eye(4)
    v0 = np.linalg.pinv(H) @ np.array([0.0, 0.0, -1.0]) + 0.1 * (np.eye(4) - np.linalg.pinv(H) @ H) @ rng.normal(size=4)
    system = constant(M, H, [0.0, 0.0, 1e-3], -H[:2].T @ [5.0, 7.0], zeta=zeta)
    run = simulate(system, np.zeros(4), v0, 1.001e-3, solver=solver, collisions="sequential", rtol=1e-10)
    assert run.outcome.ok, run.message
    _, behind = landing(run, 2)
    wanted = fast_velocity(M, H, v0, 2, 1e6, 2.0 * zeta * 1e3)
    np.testing.assert_allclose(behind, wanted, atol=2e-7 * np.abs(v0).max())


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("zeta", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("part", [0.99, 1.01])
def test_capture_below_the_threshold_speed(part: float, zeta: float, rule: str, solver: str) -> None:
    """v* = g / (w e^(3/2)) separates CONTACT from a bounce with e."""
    v = part * threshold_speed(1e6, 2e3 * zeta, 9.81)
    run = simulate(colliding(ball(a2=0.0), zeta), [0.0], [-v], 1e-5, solver=solver, collisions=rule)
    assert labels(run)[:2] == [(0, 0, 3), (0, 3, 1 if part < 1.0 else 0)]
    e = 0.0 if part < 1.0 else restitution(damping_ratio(1e6, 2e3 * zeta))
    assert run.events[1].impulse == pytest.approx((1.0 + e) * v, rel=1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("rule", RULES)
def test_rest_that_presses_is_contact_and_rest_without_pressure_is_free(rule: str, solver: str) -> None:
    run = simulate(tower([1.0, 2.0, 0.5]), [0.0] * 3, [0.0] * 3, 0.1, solver=solver, collisions=rule)
    assert sorted(labels(run)) == [(0, 0, 1), (1, 0, 1), (2, 0, 1)]
    np.testing.assert_allclose(run.lam[-1], [3.5 * 9.81, 2.5 * 9.81, 0.5 * 9.81], rtol=1e-9)
    falling = simulate(tower([0.1, 0.3, 0.7]), [1.0] * 3, [0.0] * 3, 0.1, solver=solver, collisions=rule)
    assert falling.events == ()


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("half_height", [0.05, 0.15])
def test_a_row_at_rest_is_held_from_the_first_instant(half_height: float, solver: str) -> None:
    """A start with one corner pressed to the floor while the other lands: contact first, then the collision."""
    system = box(half_height, zeta=damping_for(E_BOX))
    run = simulate(system, [0.0, half_height, 0.0], [0.0, -0.5, -5.0], 1e-6, solver=solver)
    assert labels(run)[0] == (0, Mode.FREE, Mode.CONTACT)
    h_rate = system.gap(run.q[0], run.v[0])[1]
    assert h_rate == pytest.approx([0.0 if half_height < 0.1 else 0.0629, E_BOX], abs=6e-5)


@pytest.mark.parametrize("solver", SOLVERS)
def test_rocking_comes_to_rest(solver: str) -> None:
    """A captured corner lets the other go, ever faster and lower: an end in CONTACT, not collisions for ever."""
    tall = SCENES["a tall box on its corner"]
    run = simulate(tall.system, tall.q0, tall.v0, 0.3, solver=solver, rtol=1e-8, max_steps=5000)
    assert run.outcome.ok, run.message
    assert run.mode[-1].tolist() == [Mode.CONTACT] * 2
    np.testing.assert_allclose(run.lam[-1], 0.5 * 9.81, rtol=1e-6)


def falling_box(seed: int) -> tuple[System, list[float], float]:
    """A box of any height over the floor, tilted, somewhere along it; the tolerance to run it with."""
    rng = np.random.default_rng([43, seed])
    half_height, tilt = rng.uniform(0.06, 0.25), rng.uniform(-0.15, 0.15)
    system = box(half_height, zeta=rng.uniform(0.15, 1.0))
    above = half_height * np.cos(tilt) + 0.1 * abs(np.sin(tilt)) + rng.uniform(0.0, 0.01)
    return system, [rng.uniform(-2.0, 2.0), above, tilt], 10.0 ** np.random.default_rng(seed).uniform(-10.0, -6.0)


def falling_tables(seed: int) -> tuple[System, list[float], float]:
    """Up to three beams on two legs and plates on three, each over a floor of its own height."""
    rng = np.random.default_rng([41, seed])
    masses, planes, heights, start = [], [], [], []
    for _ in range(int(rng.integers(1, 4))):
        legs, mass, floor = int(rng.integers(2, 4)), rng.uniform(0.5, 3.0), rng.uniform(-3.0, 3.0)
        angles = 2.0 * np.pi / legs * np.arange(legs) + rng.uniform(-0.3, 0.3, legs)
        arms = rng.uniform(0.05, 0.3, legs)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])[:, : legs - 1]
        masses.append(np.array([mass, *(mass * (arms**2).mean() * rng.uniform(0.5, 1.3, legs - 1))]))
        planes.append(np.column_stack([np.ones(legs), arms]))
        heights.append(np.full(legs, -floor))
        start.append(np.array([floor + rng.uniform(0.03, 0.06), *rng.uniform(-0.1, 0.1, legs - 1)]))
    M = np.diag(np.concatenate(masses))
    force = np.concatenate([np.array([-9.81 * m[0], *(0.0 * m[1:])]) for m in masses])
    system = constant(M, block_diag(*planes), np.concatenate(heights), force, zeta=rng.uniform(0.2, 1.0))
    return system, np.concatenate(start).tolist(), 10.0 ** rng.uniform(-10.0, -6.0)


def comes_to_rest(drawn: tuple[System, list[float], float]) -> None:
    """Every solver ends with all corners in CONTACT, at one place, within a bounded number of steps.

    Bounces lower than the tolerance cannot be timed: the last one lasts sqrt(8 rtol / g) at most.
    """
    system, q0, rtol = drawn
    runs = [
        simulate(system, q0, np.zeros(system.n), 1.0, rtol=rtol, solver=solver, max_steps=20_000, samples=[1.0])
        for solver in SOLVERS
    ]
    for run in runs:
        assert run.outcome.ok, run.message
        assert run.mode[-1].tolist() == [Mode.CONTACT] * system.nc
        assert run.steps <= 40 * len(run.events) + 1000
        assert run.events[-1].t == pytest.approx(runs[0].events[-1].t, abs=np.sqrt(8.0 * rtol / 9.81))
        np.testing.assert_allclose(run.q[-1], runs[0].q[-1], atol=WITHIN * rtol)


@pytest.mark.parametrize("drawn", [falling_box(1), falling_box(9), falling_tables(1)], ids=["box", "flat", "tables"])
def test_corners_come_to_rest_at_once(drawn: tuple[System, list[float], float]) -> None:
    comes_to_rest(drawn)


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "count"), [(falling_box, 100), (falling_tables, 15)])
def test_many_random_bodies_come_to_rest(scene: Callable[[int], tuple[System, list[float], float]], count: int) -> None:
    for seed in range(count):
        comes_to_rest(scene(seed))


@pytest.mark.parametrize("solver", SOLVERS)
def test_lost_is_an_outcome_with_its_place(solver: str) -> None:
    run = simulate(shuttle(bound=0.35), [0.0], [0.0], 5.0, solver=solver, rtol=1e-9)
    assert run.outcome is Outcome.LOST
    assert run.q[-1, 0] == pytest.approx(0.35, abs=1e-9)
    assert "t = 0.854162" in run.message


@pytest.mark.parametrize("solver", SOLVERS)
def test_switches_belong_to_the_run(solver: str) -> None:
    """A run works on a copy of the parameters: the mechanism is as before, and the run repeats."""
    system = shuttle()
    first, second = (simulate(system, [0.0], [0.0], 3.0, solver=solver) for _ in range(2))
    assert first.switches == second.switches
    assert [(s.variable, s.before, s.after) for s in first.switches] == [
        (0, 0, 1), (0, 1, -1), (1, 0, 1), (0, -1, 1), (1, 1, 2)
    ]  # fmt: skip
    assert np.array_equal(system.p, shuttle().p)


@pytest.mark.parametrize("solver", SOLVERS)
def test_what_never_settles_ends(solver: str) -> None:
    endless = simulate(restless(), [0.1], [0.0], 1.0, solver=solver)
    assert endless.outcome is Outcome.MODE_CYCLE
    # A light ball between two heavy ones at one place: about pi sqrt(M / m) collisions at one instant.
    squeezed = colliding(sliders(3, masses=[1e12, 1.0, 1e12]), 0.0)
    run = simulate(squeezed, [0.0] * 3, [1.0, 0.0, -1.0], 0.1, solver=solver, collisions="sequential")
    assert run.outcome is Outcome.MODE_CYCLE
    assert "Rows [0, 1]" in run.message


@pytest.mark.parametrize("solver", INDEPENDENT)
def test_of_touching_rows_the_fastest_collides_first_however_near_the_others_are(solver: str) -> None:
    """Rates of approach within some percent of each other: every collision and its impulse, in their order."""
    for seed in range(12):
        rng = np.random.default_rng([51, seed])
        system = colliding(sliders(5, masses=rng.uniform(0.5, 2.0, 5).tolist()), 0.2)
        v0 = -np.cumsum(rng.uniform(0.9, 1.1, 5))
        ours, other = (
            simulate(system, 0.0 * v0, v0, 1e-6, solver=each, collisions="sequential") for each in ("compiled", solver)
        )
        assert labels(ours) == labels(other), seed
        assert [e.impulse for e in ours.events] == pytest.approx([e.impulse for e in other.events], rel=1e-9), seed


@pytest.mark.parametrize("solver", SOLVERS)
def test_kernels_may_leave_out_the_zeros_of_their_rows(solver: str) -> None:
    """Whatever rows stood in their places before."""
    ends = []
    for zeros in (True, False):
        made = tower([1.0, 2.0, 0.5], zeta=0.3, zeros=zeros)
        ends.append(simulate(made, [0.0, 0.05, 0.1], [0.0] * 3, 0.3, solver=solver))
        assert ends[-1].outcome.ok, ends[-1].message
    assert len(ends[0].events) > 4
    assert ends[0].events == ends[1].events
    assert np.array_equal(ends[0].q[-1], ends[1].q[-1])
