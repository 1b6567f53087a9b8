"""Every located switch is found, wherever in a step it is, and where it is: against truths that share no search."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gusty import gusty
from many_contacts import constant
from mechanisms import ball
from numpy.polynomial.chebyshev import chebvander
from rippled_walls import rippled
from scipy.optimize import linprog
from springs import known, outside, parameters_outside, suite, system_of

from crossbody import cases, engines
from crossbody.cases import Law, Mode
from crossbody.reference import System, ensemble, kernels, simulate
from crossbody.reference.core import dop853_table, enclosure, esdirk, exact, filters
from crossbody.reference.core.layout import NODES


@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10, 1e-11, 1e-12])
def test_a_catch_between_the_nodes_of_a_step(rtol):
    run = simulate(*known(), 1.0, rtol=rtol)
    caught = [e for e in run.events if e.before is Mode.BALLISTIC and e.after is Mode.CONTACT]
    assert [round(e.t, 4) for e in caught] == [0.1655]
    assert run.q[-1, 0] == pytest.approx(2.238691, abs=1e-5 if rtol > 1e-7 else 1e-6)


def _worst(seeds: range, rtol: float = 1e-12) -> dict[int, float]:
    """Error of the end, over the largest coordinate, of the systems where it is above 1e-6."""
    wrong = {}
    for seed in seeds:
        case = outside(seed)
        run = simulate(system_of(case), case.q0, case.v0, case.t_end, rtol=rtol, samples=[case.t_end])
        assert run.outcome.ok, f"{seed}: {run.message}"
        error = _error(case, run.q[-1])
        if error > 1e-6:
            wrong[seed] = error
    return wrong


def test_springs_and_walls_end_where_the_exact_arcs_do():
    assert not _worst(range(20))


@pytest.mark.slow
def test_two_thousand_springs_and_walls_end_where_the_exact_arcs_do():
    assert not _worst(range(20, 2020))


def _error(case: Any, q: Any) -> float:
    """Error of the end over the largest coordinate."""
    truth = case.closed_form(np.array([0.0, case.t_end]))
    assert truth.outcome.ok, truth.message
    return float(np.abs(q - truth.q[-1]).max() / np.abs(truth.q).max())


@pytest.mark.parametrize("implicit", [True, False])
@pytest.mark.parametrize("seed", [26292, 19474, 16426, 38244, 43163])
def test_what_is_located_in_a_step_that_is_long_for_a_row_at_rest(seed, implicit):
    """A row at rest takes the integrator to the limit of its stability, where another one strikes, or it lets go.

    Let go from rest a wall is met again at the root of what its gap is off by: 1e-8 is as right as rounding can be.
    """
    case = outside(seed, 50_000)
    for rtol in (1e-9, 1e-10, 1e-11):
        run = simulate(system_of(case), case.q0, case.v0, 1.0, rtol=rtol, implicit=implicit, samples=[1.0])
        assert _error(case, run.q[-1]) < 1e-8 + 100.0 * rtol


@pytest.mark.slow
def test_fifty_thousand_springs_and_walls_are_right_to_a_millionth():
    """Against steps of 1 ms at most, at 1e-12; the exact arcs judge those that differ."""
    kernels, groups = suite(), dict[tuple[int, int], list[tuple[int, Any, Any]]]()
    for seed in range(50_000):
        given = parameters_outside(seed, 50_000)
        x = kernels.numbers(given)
        groups.setdefault((given["n"], len(x.H)), []).append((seed, given, x))
    wrong = {}
    for (n, rows), items in groups.items():
        p = np.array([np.concatenate([np.ravel(part) for part in (x.M, x.K, x.g, x.c, x.H)]) for *_, x in items])
        a0 = np.array([given["a0"] for _, given, _ in items])
        a1 = 2.0 * np.array([given["zeta"] for _, given, _ in items]) * np.sqrt(a0)
        law = Law(a0=np.ones(rows), a1=np.ones(rows), a2=np.zeros(rows), unilateral=np.ones(rows, dtype=bool))
        system = kernels.from_numbers(p[0], n, law)
        q0, v0 = np.array([x.q0 for *_, x in items]), np.array([x.v0 for *_, x in items])
        default, bounded = (
            ensemble(system, q0, v0, 1.0, parameters={f"p{i}": p[:, i] for i in range(p.shape[1])},
                     law={"a0": a0, "a1": a1}, threads=1, **options)
            for options in ({"rtol": 1e-10}, {"rtol": 1e-12, "max_step": 1e-3})
        )  # fmt: skip
        size = np.abs(np.concatenate([default.q, q0], axis=1)).max(axis=1)
        differ = ~(np.abs(default.q - bounded.q).max(axis=1) <= 1e-6 * size)
        for k in np.flatnonzero(differ | [not outcome.ok for outcome in default.outcome]):
            error = _error(outside(items[k][0], 50_000), default.q[k])
            if not (default.outcome[k].ok and error <= 1e-6):
                wrong[items[k][0]] = error
    assert not wrong


@pytest.mark.parametrize("rtol", [1e-9, 1e-12, 1e-13])
def test_a_catch_is_not_late(rtol):
    # Blown up from below the surface, then let fall there: it turns, and is caught, where v = 0.
    run = simulate(gusty(a0=1.0, a1=0.0), [-0.5], [0.0], 0.3, rtol=rtol, inputs=([0.0, 0.1], [[20.0], [0.0]]))
    assert [(e.before, e.after) for e in run.events][-1] == (Mode.BALLISTIC, Mode.CONTACT)
    assert run.events[-1].t == pytest.approx(0.1 + 0.1 * (20.0 - 9.81) / 9.81, abs=1e-14)


# Two oscillators beside a circle that is both a gap and a guard: p = (k0, k1; circle x, y, r; guards that fired).


@kernels.dynamics
def _plane_dynamics(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    M[0, 0], M[1, 0] = 1.0, 1.0
    f[0], f[1] = -p[0] * q[0], -p[1] * q[1]


@kernels.gaps
def _plane_gaps(t: float, q: Any, v: Any, p: Any, h: Any, hd: Any) -> None:
    x, y = q[0] - p[2], q[1] - p[3]
    rho = np.sqrt(x * x + y * y)
    h[0], hd[0] = rho - p[4], (x * v[0] + y * v[1]) / rho


@kernels.rows
def _plane_rows(t: float, q: Any, v: Any, p: Any, w: Any, idx: Any, na: int, H: Any, h: Any, Hdv: Any) -> None:
    x, y = q[0] - p[2], q[1] - p[3]
    rho = np.sqrt(x * x + y * y)
    rate = (x * v[0] + y * v[1]) / rho
    for j in range(na):
        H[j, 0], H[j, 1] = x / rho, y / rho
        h[j], Hdv[j] = rho - p[4], (v[0] * v[0] + v[1] * v[1] - rate * rate) / rho


@kernels.energy
def _plane_energy(q: Any, v: Any, p: Any, e: Any) -> None:
    e[0], e[1] = 0.5 * (v[0] ** 2 + v[1] ** 2), 0.5 * (p[0] * q[0] ** 2 + p[1] * q[1] ** 2)


@kernels.watch
def _plane_watch(t: float, q: Any, v: Any, p: Any, g: Any) -> None:
    g[0] = (q[0] - p[2]) ** 2 + (q[1] - p[3]) ** 2 - p[4] ** 2


@kernels.switch
def _plane_switch(t: float, q: Any, v: Any, p: Any, mode: Any, fired: int) -> int:
    if fired < 0:
        return 0
    p[5] += 1.0
    return 1


def _orbits(seed: int) -> tuple[dict[str, Any], Any, Any, Any]:
    """Parameters, start and closed form of a pass."""
    rng = np.random.default_rng([16, seed])
    k, q0, v0 = rng.uniform(1.0, 30.0, 2), rng.normal(size=2), rng.normal(size=2) * 3.0
    w = np.sqrt(k)

    def at(t: Any) -> Any:
        return q0 * np.cos(np.outer(t, w)) + v0 / w * np.sin(np.outer(t, w))

    middle = at([rng.uniform(0.2, 1.8)])[0]
    away = 10.0 ** rng.uniform(-6.0, -0.5) * rng.normal(size=2)
    radius = float(np.hypot(*away)) * (1.0 + 10.0 ** rng.uniform(-7.0, 0.0) * rng.choice([-1, 1]))
    p = {"k0": k[0], "k1": k[1], "x": middle[0] + away[0], "y": middle[1] + away[1], "r": max(radius, 1e-7)}
    return p, q0, v0, at


def _clearances(p: dict[str, Any], at: Any) -> tuple[Any, Any, Any]:
    """Minima of the distance to the circle's edge along a fine grid, closed in by parabolas; and the first entry."""
    t = np.linspace(0.0, 2.0, 40_001)

    def gap(t: Any) -> Any:
        return np.hypot(*(at(t) - [p["x"], p["y"]]).T) - p["r"]

    g = gap(t)
    low = np.flatnonzero((g[1:-1] <= g[:-2]) & (g[1:-1] <= g[2:])) + 1
    least = [gap(np.linspace(t[k - 1], t[k + 1], 4001)).min() for k in low]
    fell = np.flatnonzero((g[:-1] > 0.0) & (g[1:] <= 0.0))
    return g[0], np.array(least), t[fell]


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_passes_of_a_circle_fire_gap_and_guard(rtol):
    wrong = []
    for seed in range(60):
        p, q0, v0, at = _orbits(seed)
        start, least, _ = _clearances(p, at)
        if start < 1e-3 or np.any(np.abs(least) < 300.0 * rtol):
            continue  # it cannot be decided at this tolerance
        common = {"n": 2, "mass_block": 1, "dynamics": _plane_dynamics, "energy": _plane_energy}
        row = System(**common, parameters=p, a0=[1e4], a1=[20.0], gaps=_plane_gaps, rows=_plane_rows)
        guard = System(**common, parameters=p, discrete=[0.0], guards=1, watch=_plane_watch, switch=_plane_switch)
        touched = bool(simulate(row, q0, v0, 2.0, rtol=rtol, samples=[0.0]).events)
        entries = len(simulate(guard, q0, v0, 2.0, rtol=rtol, samples=[0.0]).switches)
        if touched != bool((least < 0.0).any()) or entries != int((least < 0.0).sum()):
            wrong.append((seed, least))
    assert not wrong


def _part_from_bounded_steps(seeds: range) -> list[int]:
    """Masses beside rippled walls whose end depends on whether a step may span many ripples."""
    differ = []
    for seed in seeds:
        system, q0, v0 = rippled(seed)
        free, bounded = (
            simulate(system, q0, v0, 0.5, rtol=1e-10, samples=[0.5], **options) for options in ({}, {"max_step": 2e-3})
        )
        if not np.abs(free.q[-1] - bounded.q[-1]).max() <= 1e-6:
            differ.append(seed)
    return differ


def test_a_rippled_wall_is_met_wherever_its_ripples_stand_in_a_step():
    assert not _part_from_bounded_steps(range(50, 80))


@pytest.mark.slow
def test_five_hundred_rippled_walls_are_met():
    assert not _part_from_bounded_steps(range(500))


def test_a_closed_form_arc_is_not_disturbed_by_what_another_row_asks():
    rng = np.random.default_rng(17)
    for _ in range(25):
        A = rng.normal(size=(2, 2))
        M, H = A @ A.T + np.eye(2), rng.normal(size=(2, 2))
        given = np.concatenate([M.ravel(), H.ravel(), rng.uniform(-0.05, 0.05, 2), 10.0 * rng.normal(size=2)])
        plain = constant(M, H, given[8:10], given[10:], zeta=0.1)
        system = System(
            n=2, parameters=given, a0=[100.0, 400.0], a1=[2.0, 5.0], constant_mass=True, affine=True,
            dynamics=plain.dynamics, gaps=plain.gaps, rows=plain.rows, energy=plain.energy,
        )  # fmt: skip
        v0 = rng.normal(size=2)
        runs = [simulate(system, [0.0, 0.0], v0, 1.0, rtol=1e-11, shortcuts=flag) for flag in (True, False)]
        assert runs[0].q[-1] == pytest.approx(runs[1].q[-1], abs=1e-7)


def _most(C, degree, zeros=()):
    """How far a polynomial goes below zero that lies in [0, 1] at C, or in [-1, 1] and is zero at `zeros`."""
    x = np.linspace(0.0, 1.0, 41)
    at, places, held = (chebvander(2.0 * np.asarray(c, dtype=float) - 1.0, degree) for c in (x, C, zeros))
    low = 1.0 if len(zeros) else 0.0
    return max(
        -linprog(
            row, A_ub=np.vstack([places, -places]), b_ub=np.r_[np.ones(len(C)), np.full(len(C), low)],
            A_eq=held if len(zeros) else None, b_eq=np.zeros(len(zeros)) if len(zeros) else None, bounds=(None, None),
        ).fun
        for row in at
    )  # fmt: skip


def test_what_the_stages_say_holds_for_every_polynomial_of_the_methods_degree():
    explicit, implicit = np.unique(dop853_table.C[:12]), esdirk.C
    assert _most(explicit, 6) <= filters.STAGES_RANGE
    assert _most(implicit, 4) <= filters.STAGES_RANGE
    assert _most(explicit, 6, (0.0, dop853_table.C[9], 1.0)) <= filters.STAGES_OFF
    assert _most(implicit, 4, (0.0, esdirk.C[1], 1.0)) <= filters.STAGES_OFF
    x = np.linspace(0.0, 1.0, 401)
    for places in (dop853_table.C[[4, 8, 10]], esdirk.C[[2, 3, 4]]):
        lagrange = np.vander(x, 3) @ np.linalg.inv(np.vander(places, 3))
        assert 2.0 * float(((x * (1.0 - x)) ** 2 * np.abs(lagrange).sum(axis=1)).max()) <= filters.GAPS_OFF


def test_a_rate_that_a_band_was_added_to_agrees_with_its_gap():
    """The bound on a rate measures what is not a polynomial in it; the band, which its gap knows nothing of, is one."""
    rng, places = np.random.default_rng(23), np.linspace(0.0, 1.0, NODES)
    row = np.zeros(2 * NODES)
    for _ in range(200):
        rate, width, band = np.polynomial.Polynomial(rng.normal(size=NODES)), rng.uniform(0.01, 1.0), rng.normal()
        ripple = 1e-3 * rng.normal() * np.polynomial.Polynomial.fromroots(places)
        row[NODES:] = rate(places) + band
        for part, bound in ((rate, 0.0), (rate + ripple, abs(ripple.coef[-1]))):
            row[:NODES] = width * part.integ()(places)
            g = enclosure.from_gaps.py_func(row, NODES, 0, width, band)
            assert g == pytest.approx(enclosure.SAFETY * bound, rel=1e-6, abs=1e-8)


def test_what_moves_a_colliding_gap_is_bounded_by_its_end():
    """h'^2 + b0 h^2 only falls under a linear law: the elastic part of a multiplier is least at the end of a step."""
    rng = np.random.default_rng(29)
    for _ in range(200):
        b0, b1 = 10.0 ** rng.uniform(0.0, 8.0), 10.0 ** rng.uniform(-3.0, 5.0)
        h, hd = rng.normal() / np.sqrt(b0), rng.normal()
        arc = exact.linear_arc.py_func
        path = np.array([arc(b0, b1, h, hd, t) for t in np.linspace(0.0, rng.uniform(0.1, 3.0) / np.sqrt(b0), 60)])
        elastic = max(b1, np.sqrt(b0)) * np.abs(path[:, 1]) + b0 * np.abs(path[:, 0])
        assert elastic.min() >= np.sqrt(b0 * (path[-1, 1] ** 2 + b0 * path[-1, 0] ** 2)) * (1.0 - 1e-9)


def test_rows_at_rest_beside_each_other_are_not_searched():
    """Balls that touch and hang still are told apart from balls that close in by bounds of the nodes alone."""
    case = cases.load("newtons_cradle", variant="pendulums")
    run = engines.load("reference").prepare(case, "compiled", rtol=1e-6).run()
    assert run.counts["guards"] < 20 * run.steps


def test_events_that_are_not_kept_are_counted():
    """More of them than the record has room for at once."""
    bouncing = ball(b0=1e6, b1=0.0, a0=1e4, a1=200.0, a2=0.0)
    kept, dropped = (simulate(bouncing, [0.01], [0.0], 150.0, events=events, samples=[0.0]) for events in (True, False))
    assert not dropped.events
    assert dropped.counts["events"] == kept.counts["events"] == len(kept.events) > 2000


@pytest.mark.parametrize("solver", ["compiled", pytest.param("cvode", marks=pytest.mark.slow)])
def test_as_many_collisions_as_an_instant_may_have_are_no_cycle_where_each_has_its_own(solver):
    bouncing = ball(b0=1e6, b1=0.0, a0=1e4, a1=200.0, a2=0.0)
    run = simulate(bouncing, [0.001], [0.0], 32.0, solver=solver, samples=[0.0])
    assert run.outcome.ok, run.message
    assert len(run.events) > 2 * 1064


@pytest.mark.parametrize("seed", range(12))
def test_an_interval_holds_an_event_if_no_function_is_open_and_not_if_one_stays_above(seed: int) -> None:
    x = np.linspace(0.0, 1.0, NODES)
    ways = {
        enclosure.ABOVE: 1.0 + x, enclosure.BELOW: -1.0 - x, enclosure.FALLS: 0.4 - x,
        enclosure.MIXED: np.cos(2.0 * np.pi * x),
    }  # fmt: skip
    lies = np.random.default_rng(seed).permutation(list(ways)[seed % 2 :])
    row = np.zeros(enclosure.BESIDE + NODES)
    for j, way in enumerate(lies.tolist()):
        row[j * NODES : (j + 1) * NODES] = ways[way]
    for count in range(1, len(lies) + 1):
        seen = set(lies[:count].tolist())
        wanted = enclosure.HALVE if enclosure.MIXED in seen else enclosure.HERE
        assert enclosure.judge.py_func(row, count) == (enclosure.NOWHERE if enclosure.ABOVE in seen else wanted)


@kernels.dynamics
def _thrown(t, q, v, u, p, M, f, w):
    for i in range(2):
        M[i, 0], f[i] = 1.0, p[i]


@kernels.gaps
def _ring_gap(t, q, v, p, h, hd):
    r = np.sqrt(q[0] * q[0] + q[1] * q[1])
    h[0], hd[0] = 1.0 - r, -(q[0] * v[0] + q[1] * v[1]) / r


@kernels.rows
def _ring_row(t, q, v, p, w, idx, na, H, h, Hdv):
    r = np.sqrt(q[0] * q[0] + q[1] * q[1])
    for j in range(na):
        H[j, 0], H[j, 1] = -q[0] / r, -q[1] / r
        along = (q[0] * v[0] + q[1] * v[1]) / r
        h[j], Hdv[j] = 1.0 - r, -(v[0] * v[0] + v[1] * v[1] - along * along) / r


def _touches(seed: int, **options: float) -> list[float]:
    """When a point that is thrown about in a ring first meets it."""
    rng = np.random.default_rng(seed)
    pull = rng.normal(size=2) * 10 ** rng.uniform(-2, 1)
    made = System(
        n=2, mass_block=1, dynamics=_thrown, gaps=_ring_gap, rows=_ring_row, parameters=pull,
        a0=[10 ** rng.uniform(3, 5)], a1=[10 ** rng.uniform(1, 2.8)], unilateral=[True],
    )  # fmt: skip
    start, speed = rng.normal(size=2) * 0.3, rng.normal(size=2) * 10 ** rng.uniform(-1, 0.5)
    run = simulate(made, start, speed, 60.0, rtol=1e-9, max_steps=20_000, **options)
    return [e.t for e in run.events if e.before is Mode.FREE][:3]


@pytest.mark.parametrize("seeds", [[210], range(10), pytest.param(range(10, 300), marks=pytest.mark.slow)], ids=str)
def test_a_long_flight_meets_a_ring_as_short_steps_do(seeds):
    """Steps of a flight have no errors, and grow as long as the run; from its ends a ring looks like a line."""
    for seed in seeds:
        assert _touches(seed) == pytest.approx(_touches(seed, max_step=0.02), abs=1e-4), seed


def test_a_ball_that_hops_at_the_start_of_a_long_flight_leaves_its_ring():
    """It rises by 35 um for 31 ms, in a step of 17 s."""
    case = cases.load("ball_maze", "outside", t_end=21.0)
    run = engines.load("reference").prepare(case, rtol=1e-11, samples=np.linspace(4.2, 4.4, 201)).run()
    passing = run.mode[:, 0] == Mode.BALLISTIC
    assert passing.any()
    assert run.gap[passing, 0].max() < 1e-9
