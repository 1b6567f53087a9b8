"""A body that leaves a surface smoothly is let go: no solver adds touches without end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mechanisms import flyby
from springs import springs

from crossbody.cases import Mode, Trajectory
from crossbody.reference import System, simulate

GRAVITY = 9.81


def over_the_top(seed: int, **options: Any) -> tuple[Trajectory, float]:
    """A particle that slides down a circle from beside its top, and the height at which it must leave, in radii.

    It presses with g cos - v^2 / R, and v^2 = v0^2 + 2 g R (cos0 - cos): so 3 g R cos = v0^2 + 2 g R cos0.
    """
    rng = np.random.default_rng(seed)
    radius, angle = rng.uniform(0.05, 0.3), rng.uniform(0.1, 0.6)
    speed = np.sqrt(rng.uniform(0.05, 0.8) * GRAVITY * radius * np.cos(angle))
    a0, zeta = 10.0 ** rng.uniform(3.0, 8.0), rng.uniform(0.3, 2.0)
    system = flyby(radius, GRAVITY, a0=a0, a1=2.0 * zeta * np.sqrt(a0))
    q0 = [radius * np.sin(angle), radius * np.cos(angle)]
    run = simulate(system, q0, [speed * np.cos(angle), -speed * np.sin(angle)], 0.5, **options)
    return run, (speed**2 / (2.0 * GRAVITY * radius) + np.cos(angle)) * 2.0 / 3.0


@pytest.mark.parametrize("solver", ["compiled", "cvode", "ida"])
@pytest.mark.parametrize("seed", range(6))
def test_a_particle_leaves_a_circle_where_energy_says(seed: int, solver: str) -> None:
    """It touches once and lets go once."""
    for rtol in (1e-6, 1e-9):
        run, height = over_the_top(seed, solver=solver, rtol=rtol, max_steps=5_000, time_limit=20.0)
        assert run.outcome.ok, run.message
        assert sum(event.after is Mode.CONTACT for event in run.events) == 1
        assert run.mode[-1, 0] == Mode.FREE
        left = run.q[np.searchsorted(run.t, run.events[1].t), 1] / np.hypot(*run.q[0])
        assert left == pytest.approx(height, abs=1e3 * rtol)


def stiff_walls(seed: int) -> tuple[System, np.ndarray, np.ndarray]:
    """Springs beside walls that hardly give and hold what they have caught until it is pulled off."""
    rng = np.random.default_rng([15, seed])
    n = int(rng.integers(1, 4))
    nc = int(rng.integers(1, n + 1))
    root, spring = rng.normal(size=(n, n)), rng.normal(size=(n, n))
    M, K = root @ root.T + np.eye(n), 10.0 ** rng.uniform(0.0, 2.0) * (spring @ spring.T / n + 0.1 * np.eye(n))
    g, H, c = 10.0 * rng.normal(size=n), rng.normal(size=(nc, n)), rng.uniform(0.02, 0.5, nc)
    a0 = 10.0 ** rng.uniform(4.0, 9.0)
    a1 = 2.0 * rng.uniform(0.7, 2.0) * a0**0.5
    q0, v0 = 0.2 * rng.normal(size=n), 2.0 * rng.normal(size=n)
    while (H @ q0 + c <= 0.0).any():
        q0 *= 0.5
    return springs(M, K, g, H, c, a0, a1), q0, v0


def touches(run: Trajectory) -> list[tuple[int, float, float]]:
    """Row, begin and end of every contact, row by row."""
    found: list[tuple[int, float, float]] = []
    since: dict[int, float] = {}
    for e in run.events:
        if e.after is Mode.CONTACT:
            since[e.contact] = e.t
        elif e.before is Mode.CONTACT:
            found.append((e.contact, since.pop(e.contact), e.t))
    return sorted(found)


def list_agrees(seed: int, solver: str, rtol: float) -> None:
    """The same rows touch and let go in the same order at the same times, without a touch too many."""
    system, q0, v0 = stiff_walls(seed)
    first, other = (simulate(system, q0, v0, 1.0, rtol=rtol, solver=s, max_steps=40_000) for s in ("compiled", solver))
    assert first.outcome is other.outcome, (seed, first.message, other.message)
    pairs = touches(first), touches(other)
    assert [x[0] for x in pairs[0]] == [x[0] for x in pairs[1]], seed
    for a, b in zip(*pairs, strict=True):
        assert b[1:] == pytest.approx(a[1:], abs=1e3 * rtol), seed


@pytest.mark.parametrize("solver", ["cvode", "ida"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_stiff_rows_switch_as_in_the_compiled_loop(rtol: float, solver: str) -> None:
    for seed in range(6):
        list_agrees(seed, solver, rtol)


@pytest.mark.slow
@pytest.mark.parametrize(("solver", "count"), [("cvode", 300), ("ida", 60)])
def test_many_stiff_rows_switch_as_in_the_compiled_loop(solver: str, count: int) -> None:
    for seed in range(count):
        list_agrees(seed, solver, 10.0 ** np.random.default_rng(seed).uniform(-9.0, -6.0))


def without_length(seed: int, rtol: float) -> list[tuple[int, float, float]]:
    """Contacts that end as they begin: those of a gap that rounding, or an interpolant, takes below zero."""
    system, q0, v0 = stiff_walls(seed)
    run = simulate(system, q0, v0, 1.0, rtol=rtol, max_steps=40_000)
    assert run.outcome.ok, run.message
    return [touch for touch in touches(run) if touch[2] - touch[1] < 1e-9]


@pytest.mark.parametrize(
    ("seed", "rtol"), [(4, 1e-6), (50, 1e-6), (58, 1e-6), (96, 1e-6), (168, 1e-6), (50, 1e-7), (58, 1e-7)]
)
def test_a_row_that_is_let_go_from_rest_does_not_touch_once_more(seed: int, rtol: float) -> None:
    assert not without_length(seed, rtol)


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-6, 1e-7, 1e-8, 1e-10])
def test_no_stiff_row_touches_for_an_instant(rtol: float) -> None:
    assert not {seed: found for seed in range(1000) if (found := without_length(seed, rtol))}
