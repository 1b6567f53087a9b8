"""Newton's cradle in the reference: frozen rules against their exact motion, real time against formulas of the law."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk

from crossbody.cases import Case, Outcome, Tier, Trajectory, load
from crossbody.cases import closed_forms as cf
from crossbody.cases.mechanisms.cradle.claims import row
from crossbody.cases.mechanisms.cradle.motion import Motion
from crossbody.cases.mechanisms.cradle.rules import answer
from crossbody.engines import load as engine
from crossbody.reference import Options, prepare
from crossbody.reference.systems import sliders
from crossbody.reports import metrics
from crossbody.reports.judging.truth import PARTED, truth_of
from crossbody.reports.maps.gapmap import over
from crossbody.reports.measuring.switching import made
from crossbody.reports.measuring.truth import from_run


def run(case: Case, **settings: Any) -> Trajectory:
    motion = engine("reference").prepare(case, "compiled", **settings).run()
    assert motion.outcome is Outcome.FINISHED, motion.message
    return motion


def exact(case: Case) -> Motion:
    assert isinstance(case.closed_form, Motion)
    return case.closed_form


def assert_same_events(found: Trajectory, motion: Motion) -> None:
    assert [(e.contact, e.before, e.after) for e in found.events] == [
        (e.contact, e.before, e.after) for e in motion.events
    ]
    np.testing.assert_allclose([e.t for e in found.events], [e.t for e in motion.events], atol=1e-11)
    np.testing.assert_allclose([e.impulse for e in found.events], [e.impulse for e in motion.events], atol=1e-11)


@pytest.mark.parametrize("gap", [0.0, 1e-3])
@pytest.mark.parametrize("n", range(2, 11))
def test_as_many_out_as_in(n: int, gap: float) -> None:
    for k in range(1, n):
        case = load("newtons_cradle", n=n, lifted=k, gap=gap)
        found = run(case)
        np.testing.assert_allclose(found.v[-1], np.where(np.arange(n) < n - k, 0.0, 1.0), atol=1e-10)
        masses = row(case).masses
        np.testing.assert_allclose(found.v @ masses, k * masses[0], atol=1e-10 * k * masses[0])
        np.testing.assert_allclose(found.total_energy, found.total_energy[0], rtol=1e-10)
        assert_same_events(found, exact(case))


def test_unequal_masses() -> None:
    found = run(load("newtons_cradle", n=3, masses="4,2,1"))
    np.testing.assert_allclose(found.v[-1], [1 / 3, 4 / 9, 16 / 9], atol=1e-10)


@pytest.mark.parametrize("n", range(2, 11))
def test_all_at_once_is_two_nths(n: int) -> None:
    found = run(load("newtons_cradle", n=n, collisions="simultaneous"))
    np.testing.assert_allclose(found.v[-1], np.r_[(2 - n) / n, np.full(n - 1, 2 / n)], atol=1e-10)


@pytest.mark.parametrize("rule", ["sequential", "simultaneous"])
@pytest.mark.parametrize("gap", [0.0, 1e-3])
@pytest.mark.parametrize("zeta", [0.0, 0.1, 0.3])
def test_a_frozen_run_is_the_exact_motion(rule: str, gap: float, zeta: float) -> None:
    case = load("newtons_cradle", lifted=2, gap=gap, zeta=zeta, masses="4,2,1,3,0.5", collisions=rule)
    found, motion = run(case), exact(case)
    np.testing.assert_allclose(found.v[-1], motion.final, atol=1e-10)
    assert_same_events(found, motion)
    ledger, told = found.ledger, motion(found.t).ledger
    assert ledger is not None
    assert told is not None
    np.testing.assert_allclose(ledger.contact[-1], told.contact[-1], atol=1e-12)


@pytest.mark.parametrize("gap", [0.0, 1e-3])
def test_two_hundred_balls(gap: float) -> None:
    case = load("newtons_cradle", n=200, gap=gap)
    found = run(case, samples=2)
    np.testing.assert_allclose(found.v[-1], np.arange(200) == 199, atol=1e-10)
    assert len(found.events) == 2 * 199


@pytest.mark.parametrize("a0", [1e0, 1e4, 1e8, 1e12])
@pytest.mark.parametrize("zeta", [0.0, 0.2])
def test_two_sliders_in_real_time_are_exact_at_every_stiffness(a0: float, zeta: float) -> None:
    case = load("newtons_cradle", n=2, masses="2,1", a0=a0, zeta=zeta, collisions="resolved")
    found, e = run(case), cf.restitution(zeta)
    np.testing.assert_allclose(found.v[-1], [(2 - e) / 3, 2 * (1 + e) / 3], atol=1e-8)
    touch, release = (event.t for event in found.events[:2])
    assert release - touch == pytest.approx(cf.contact_time(a0, 2.0 * zeta * math.sqrt(a0)), rel=1e-8)


def resolved(n: int, s: float, machine: str = "level", **more: Any) -> tuple[Case, Trajectory]:
    """One unit ball into n - 1 others with gaps of s v/w, until they part."""
    plain = load("newtons_cradle", n=n, gap=s / 1e3, masses=1.0, a0=1e6, collisions="resolved", **more)
    case = replace(plain, fsm=machine)
    found = run(case, rtol=1e-11)
    while not over(found):
        case = replace(case, t_end=2.0 * case.t_end)
        found = run(case, rtol=1e-11)
    return case, found


def created(n: int, s: float, machine: str) -> float:
    return float(2.0 * resolved(n, s, machine)[1].total_energy[-1] - 1.0)


def test_touching_balls_in_real_time_are_one_block() -> None:
    for n in (3, 5):
        found = resolved(n, 0.0)[1]
        np.testing.assert_allclose(found.v[-1], np.r_[(2 - n) / n, np.full(n - 1, 2 / n)], atol=1e-8)
        assert 2.0 * found.total_energy[-1] == pytest.approx(1.0, abs=1e-8)


def test_energy_of_one_activation_has_its_published_digits() -> None:
    case, found = resolved(3, 0.5)
    assert made(found, case) == pytest.approx(0.0727840329, abs=1e-10)
    assert found.total_energy[-1] - 0.5 == pytest.approx(0.0727840329, abs=1e-9)
    # The same by hand: with h_0 = -sin(w t)/w ball 1 has gone (w t - sin w t)/(2 w); it touches ball 2 at 0.5/w.
    h = -math.sin(brentq(lambda t: 0.5 * (t - math.sin(t)) - 0.5, 0.0, math.pi, xtol=1e-15)) / 1e3
    inverse = np.linalg.inv(np.array([[2.0, -1.0], [-1.0, 2.0]]))
    assert 0.5 * 1e6 * h * h * (inverse[0, 0] - 0.5) == pytest.approx(0.0727840329, abs=1e-9)


@pytest.mark.parametrize("s", [0.1, 0.285, 0.5, 0.9, 1.3, 1.7])
@pytest.mark.parametrize("machine", ["level", "memoryless"])
@pytest.mark.parametrize("n", [3, 5])
def test_energy_made_by_switching_is_its_formula(n: int, machine: str, s: float) -> None:
    case, found = resolved(n, s, machine)
    truth = from_run(found, Tier.D, "itself")
    assert metrics.load("energy_switching_error").measure(truth, found, case) == pytest.approx(0.0, abs=1e-6)
    assert metrics.load("energy_integrator").measure(truth, found, case) == pytest.approx(0.0, abs=1e-6)
    assert made(found, case) == pytest.approx(created(n, s, machine) / 2.0, abs=1e-6)


@pytest.mark.parametrize(
    ("n", "machine", "at", "most"),
    [(3, "level", 0.285, 0.167), (5, "level", 0.3, 0.45), (3, "memoryless", 0.2, 0.135), (5, "memoryless", 0.1, 0.27)],
)
def test_most_energy_over_the_gap(n: int, machine: str, at: float, most: float) -> None:
    grid = np.round(np.arange(0.05, 1.6, 0.05), 3)
    values = np.array([created(n, s, machine) for s in grid])
    assert grid[values.argmax()] == pytest.approx(at, abs=0.051)
    assert values.max() == pytest.approx(most, abs=3e-3)
    assert created(n, at, machine) == pytest.approx(most, abs=3e-3)


@pytest.mark.parametrize("n", [3, 5])
@pytest.mark.parametrize("machine", ["level", "memoryless"])
def test_the_pattern_is_ideal_once_collisions_do_not_overlap(n: int, machine: str) -> None:
    """A pair parts after pi/w; until then the struck ball has gone pi/2 v/w."""
    ideal = np.arange(n) == n - 1
    assert np.abs(resolved(n, 0.5 * math.pi + 1e-3, machine)[1].v[-1] - ideal).max() < 1e-8
    assert np.abs(resolved(n, 0.5 * math.pi - 0.1, machine)[1].v[-1] - ideal).max() > 1e-4


@pytest.mark.parametrize(("n", "s", "zeta"), [(3, 0.2, 0.0), (5, 0.1, 0.0), (3, 0.4, 0.3)])
def test_the_memoryless_machine_against_an_independent_integration(n: int, s: float, zeta: float) -> None:
    case, found = resolved(n, s, "memoryless", zeta=zeta)
    independent = answer("memoryless", row(case))
    assert independent is not None
    np.testing.assert_allclose(found.v[-1], independent, atol=1e-7)


def quarter(case: Case) -> float:
    """A quarter of a pendulum's period, s: K(sin(angle/2)) sqrt(L/g)."""
    k = math.sin(0.5 * case.number("angle"))
    return float(ellipk(k * k)) * math.sqrt(case.number("length") / case.number("gravity"))


@pytest.mark.parametrize("k", [1, 2, 4])
def test_touching_pendulums_collide_at_quarters_of_the_period(k: int) -> None:
    """All collisions of a side fall on one instant, when everything hangs; then the other side swings."""
    case = load("newtons_cradle", "pendulums", lifted=k)
    found = run(case, rtol=1e-12)
    times = [t for t, _ in groupby(event.t for event in found.events)]
    clusters = np.array(times)[np.r_[True, np.diff(times) > 0.1]]
    expected = quarter(case) * np.arange(1, 2 * len(clusters), 2)
    assert len(clusters) == 10
    np.testing.assert_allclose(clusters, expected, atol=1e-9)
    np.testing.assert_allclose(found.total_energy, found.total_energy[0], rtol=1e-9)
    assert metrics.of(case)["balls_out"].measure(from_run(found, Tier.D, ""), found, case) == k
    pattern = metrics.of(case)["pattern_distance"].measure(from_run(found, Tier.D, ""), found, case)
    assert pattern == pytest.approx(0.0, abs=1e-8)


def test_first_collisions_of_pendulums_with_gaps_against_an_independent_integration() -> None:
    """The strings alone by scipy, touches by its root finding, collisions by the map of two balls along their line."""
    case = load("newtons_cradle", "pendulums", n=3, gap=2e-3, masses="2,1,1")
    found = run(case, rtol=1e-12)
    expected = list(independent_collisions(case, 8))
    touches = [event for event in found.events if event.impulse == 0.0]
    assert [event.contact for event in touches[:8]] == [i for _, i in expected]
    np.testing.assert_allclose([event.t for event in touches[:8]], [t for t, _ in expected], atol=1e-9)


def independent_collisions(case: Case, count: int) -> Any:
    n, L, g, r = len(case.q0), case.number("length"), case.number("gravity"), case.number("radius")
    masses, pivots = row(case).masses, np.arange(len(case.q0)) * (2 * r + case.number("gap"))

    def distance(i: int) -> Any:
        def event(_t: float, y: Any) -> float:
            x, z = pivots[:n] + L * np.sin(y[:n]), -L * np.cos(y[:n])
            return float(np.hypot(x[i + 1] - x[i], z[i + 1] - z[i]) - 2 * r)

        event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
        return event

    t, y = 0.0, np.r_[case.q0, case.v0]
    for _ in range(count):
        swing = solve_ivp(
            lambda _t, s: np.r_[s[n:], -g / L * np.sin(s[:n])], (t, t + 5.0), y, method="DOP853",
            events=[distance(i) for i in range(n - 1)], rtol=1e-12, atol=1e-14, max_step=0.01,
        )  # fmt: skip
        i = next(j for j in range(n - 1) if len(swing.t_events[j]))
        t, y = float(swing.t[-1]), swing.y[:, -1].copy()
        yield t, i
        turn = y[i : i + 2]
        d = np.array([pivots[1] + L * (np.sin(turn[1]) - np.sin(turn[0])), -L * (np.cos(turn[1]) - np.cos(turn[0]))])
        along = L * (np.stack([np.cos(turn), np.sin(turn)], axis=1) @ d) / np.linalg.norm(d) * [-1, 1]
        G = (along**2 / (masses[i : i + 2] * L * L)).sum()
        impulse = -2.0 * (along @ y[n + i : n + i + 2]) / G
        y[n + i : n + i + 2] += along * impulse / (masses[i : i + 2] * L * L)


@pytest.mark.parametrize("parameters", [{}, {"gap": 1e-3}])
def test_pendulums_are_trusted_for_all_their_five_seconds(parameters: dict[str, float]) -> None:
    """Two independent integrators agree to the horizon under the frozen rule."""
    truth = truth_of(load("newtons_cradle", "pendulums", **parameters))
    assert truth.tier is Tier.C
    assert truth.trusted == math.inf
    assert truth.agreement["event_times"] < 1e-9


@pytest.mark.slow
def test_overlapping_collisions_of_pendulums_part_and_the_time_is_told() -> None:
    """In real time hundreds of touches amplify rounding: two integrators part, and nothing is judged behind that."""
    truth = truth_of(load("newtons_cradle", "pendulums", collisions="resolved", gap=1e-3, t_end=7.0))
    assert 3.0 < truth.trusted < 7.0
    assert f"they diverge at t = {truth.trusted:.4g} s" in truth.source
    assert PARTED == 1e-6


@pytest.mark.bench
@pytest.mark.parametrize(("gap", "ratio"), [(0.0, 3.0), (1e-3, 10.0)])
def test_time_per_collision_hardly_grows_with_the_row(gap: float, ratio: float) -> None:
    runs = []
    for n in (5, 200):
        case = load("newtons_cradle", n=n, gap=gap)
        options = Options(t_end=case.t_end, samples=[case.t_end], collisions="sequential")
        runs.append((prepare(sliders.build(case.parameters, case.law), case.q0, case.v0, options), n - 1))
        runs[-1][0].warm()
    times: list[list[float]] = [[], []]
    for _ in range(15):
        for i, (prepared, count) in enumerate(runs):
            began = time.perf_counter()
            prepared.go()
            times[i].append((time.perf_counter() - began) / count)
    short, long = (float(np.median(each)) for each in times)
    print(
        f"gap {gap}: {1e6 * short:.2f} us a collision with 5 balls, {1e6 * long:.2f} with 200, ratio {long / short:.2f}"
    )
    assert long < ratio * short
