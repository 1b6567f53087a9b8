"""Derivatives through switches at which forces jump, or that time brings about; and starts that have none."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from friction_scenes import ON_TOP, RIDES, G, ball_on_solid, box_on_floor, point, sphere_on_floor

from crossbody.cases import Mode, Outcome
from crossbody.cases.files.case import case_of
from crossbody.reference import System, kernels, simulate
from crossbody.reference.linear import Sensitivity, sensitivity
from crossbody.reference.linear.differences import differences
from crossbody.reference.tree.system import system

ALPHA = float(np.arctan(0.4))
GROWS = 3.0  # N/s


def ends(one: System, q: Any, v: Any, t_end: float, solver: str = "cvode") -> np.ndarray:
    run = simulate(one, q, v, t_end, rtol=1e-12, solver=solver)
    assert run.outcome is Outcome.FINISHED, run.message
    return np.concatenate([run.q[-1], run.v[-1]])


def agree(found: Sensitivity, end: Any, q: Any, v: Any, steps: tuple[float, ...], close: float) -> None:
    """Hold derivatives by the start to differences, by the step that agrees best with the one before it."""
    assert is_known(found), found.message
    n, x = len(q), np.concatenate([q, v])
    tried = [differences(lambda x: end(x[:n], x[n:]), x, step) for step in steps]
    best = min(pairwise(tried), key=lambda two: np.abs(two[0] - two[1]).max())[1]
    assert np.nanmax(np.abs(found.by_start - best)) <= close * max(np.abs(best).max(), 1.0)


def is_known(found: Sensitivity) -> bool:
    """Return whether there are derivatives by all that does not lift what only touches at the start."""
    return found.outcome is Outcome.FINISHED or "only touch" in found.message


@pytest.mark.parametrize("name", RIDES)
@pytest.mark.parametrize("mu", [0.0, 0.05])
def test_the_curvature_of_a_gap_jumps_at_the_end_of_a_face(name: str, mu: float) -> None:
    """With it the acceleration: a ball that comes there later falls later."""
    scene, q, v = ball_on_solid(name, mu), [*ON_TOP], [0.8, 0.0]
    one = system(scene, case_of(scene).law)
    found = sensitivity(one, q, v, 0.5)
    assert any(switch.t > 0.1 for switch in found.run.switches)
    solver = "compiled" if mu else "cvode"  # which takes a minute for each such difference with friction
    agree(found, lambda q, v: ends(one, q, v, 0.5, solver), q, v, (1e-4, 3e-5, 1e-5), 1e-6)


@kernels.dynamics
def _growing(t, q, v, u, p, M, f, w):  # type: ignore[no-untyped-def]
    """As `linear` has it, with a force along x that grows with time, by p[-1]."""
    for i in range(2):
        M[i, 1 - i], M[i, i] = 0.0, 1.0
        f[i] = p[1 + i] - p[3 + i] * q[i]
    f[0] += p[len(p) - 1] * t


@kernels.dynamics
def _lifting(t, q, v, u, p, M, f, w):  # type: ignore[no-untyped-def]
    """The same along y: it lifts."""
    for i in range(2):
        M[i, 1 - i], M[i, i] = 0.0, 1.0
        f[i] = p[1 + i] - p[3 + i] * q[i]
    f[1] += p[len(p) - 1] * t


def pushed(dynamics: Any, mu: float = 0.5, alpha: float = ALPHA) -> System:
    """Return the point of `point` under a force that grows with time: its last parameter."""
    one = point(mu, alpha)
    return replace(one, dynamics=dynamics, parameters=[*one.p, GROWS])


def test_a_block_that_a_growing_force_pushes_over_its_limit() -> None:
    """It holds to t1 = (mu N - F)/c, and then x = c (T - t1)^3/6: at rest nothing but time moves the limit."""
    mu, T = 0.5, 1.2
    one = pushed(_growing, mu)
    found = sensitivity(one, [0, 0], [0, 0], T, parameters=["mu[0]", "p[1]", f"p[{len(one.p) - 1}]"])
    assert is_known(found), found.message

    def end(y: Any) -> Any:
        mu, down, c = y
        t1 = (mu * G * np.cos(ALPHA) - down) / c
        return np.array([c * (T - t1) ** 3 / 6.0, 0.5 * c * (T - t1) ** 2])

    y = np.array([mu, G * np.sin(ALPHA), GROWS])
    expected = np.stack([end(y + 1e-30j * e).imag / 1e-30 for e in np.eye(3)], axis=-1)
    np.testing.assert_allclose(found.state[[0, 2]], end(y), atol=1e-9)
    np.testing.assert_allclose(found.by_parameters[[0, 2]], expected, atol=1e-7)


def test_a_block_that_stops_and_is_pushed_again() -> None:
    """It slides with 1 m/s and stops, holds, and goes on when the growing force has come to what friction bears."""
    one, T = pushed(_growing, 1.0), 2.4
    found = sensitivity(one, [0, 0], [1.0, 0], T, parameters=["mu[0]"])
    assert [e.after for e in found.run.events if e.t > 0.0] == [Mode.STICK, Mode.SLIP]

    def end(y: Any) -> Any:
        v, mu = y
        brake = G * (mu * np.cos(ALPHA) - np.sin(ALPHA))
        stop, again = (brake - np.sqrt(brake**2 - 2.0 * GROWS * v)) / GROWS, brake / GROWS
        slid = v * stop - brake * stop**2 / 2.0 + GROWS * stop**3 / 6.0
        return np.array([slid + GROWS * (T - again) ** 3 / 6.0, GROWS * (T - again) ** 2 / 2.0])

    expected = np.stack([end(np.array([1.0, 1.0]) + 1e-30j * e).imag / 1e-30 for e in np.eye(2)], axis=-1)
    np.testing.assert_allclose(found.state[[0, 2]], end(np.ones(2)), atol=1e-9)
    got = np.stack([found.by_start[[0, 2], 2], found.by_parameters[[0, 2], 0]], axis=-1)
    np.testing.assert_allclose(got, expected, atol=1e-7)


def test_a_weight_that_a_growing_force_lifts() -> None:
    """At rest it lets go at t1 = N/c, whatever its state was before: y = c (T - t1)^3/6."""
    one = pushed(_lifting, 0.5, 0.0)
    t1, T = G / GROWS, 4.0
    found = sensitivity(one, [0, 0], [0, 0], T, parameters=[f"p[{len(one.p) - 1}]"])
    assert is_known(found), found.message
    expected = [(T - t1) ** 3 / 6.0 + 0.5 * (T - t1) ** 2 * t1, 0.5 * (T - t1) ** 2 + (T - t1) * t1]
    np.testing.assert_allclose(found.by_parameters[[1, 3], 0], expected, atol=1e-7)


@pytest.mark.parametrize("seed", range(6))
def test_blocks_under_a_growing_force_slide_stop_and_go_on(seed: int) -> None:
    """Downhill, uphill, on a belt, or from rest: whatever is called finished has the derivative of runs."""
    rng = np.random.default_rng(seed)
    one = pushed(_growing, float(rng.uniform(0.2, 1.2)), float(rng.uniform(0.0, 0.5)))
    v, T = [float(rng.normal()), 0.0], 1.5
    found = sensitivity(one, [0, 0], v, T, parameters=["mu[0]", f"p[{len(one.p) - 1}]"])
    assert is_known(found), found.message

    def end(y: np.ndarray) -> np.ndarray:
        moved = replace(one, mu=np.where(np.isfinite(one.mu), y[1], one.mu), parameters=[*one.p[:-1], y[2]])
        return ends(moved, [0, 0], [y[0], 0.0], T, "compiled")

    y = np.array([v[0], float(one.mu[1]), GROWS])
    tried = [differences(end, y, step) for step in (1e-4, 3e-5, 1e-5)]
    best = min(pairwise(tried), key=lambda two: np.abs(two[0] - two[1]).max())[1]
    got = np.column_stack([found.by_start[:, 2], found.by_parameters])
    np.testing.assert_allclose(got, best, atol=1e-6)


@pytest.mark.parametrize("space", [False, True])
def test_a_slide_from_rest_has_one_sided_derivatives_by_its_start(space: bool) -> None:
    """Thrown uphill it comes back later than it was thrown downhill; by friction there is one derivative."""
    n, T, mu = 3 if space else 2, 0.2, 0.3
    found = sensitivity(point(mu, ALPHA, space=space), np.zeros(n), np.zeros(n), T, parameters=["mu[0]"])
    assert found.outcome is Outcome.ILL_POSED
    assert "Row 0" in found.message
    assert "t = 0 s" in found.message
    lost = np.isnan(found.by_start).all(axis=0)
    assert lost.tolist() == [False] * (n - 1) + [True] * (n + 1)  # by the height too: it only touches
    assert np.isfinite(found.by_start[:, ~lost]).all()
    by_mu = -G * np.cos(ALPHA)
    np.testing.assert_allclose(found.by_parameters[[0, n], 0], [0.5 * by_mu * T * T, by_mu * T], rtol=1e-8)
    assert np.isnan(found.multipliers).all()


def test_a_sphere_that_slides_from_rest_in_space_takes_no_age() -> None:
    scene = sphere_on_floor(0.5, 0.1, tilt=1.2)
    found = sensitivity(
        system(scene, case_of(scene).law), [0, 0, 0.1, 1, 0, 0, 0], np.zeros(6), 0.2, parameters=["mu[0]"],
        time_limit=10.0,
    )  # fmt: skip
    assert found.outcome is Outcome.ILL_POSED
    assert "Row 0 begins to slide from rest at t = 0 s" in found.message
    N = G * np.cos(1.2)
    np.testing.assert_allclose(found.by_parameters[[0, 4], 0], [-0.02 * N, 0.02 * N / (0.4 * 0.1)], rtol=1e-7)


@pytest.mark.parametrize("tilt", [0.0, 0.2])
def test_a_box_at_rest_stays(tilt: float) -> None:
    """A force below mu N moves nothing, on either side: four corners stick, and no size of the motion is known."""
    scene = box_on_floor(0.5, tilt=tilt)
    found = sensitivity(system(scene, case_of(scene).law), [0, 0, 0.1, 1, 0, 0, 0], np.zeros(6), 0.2)
    assert is_known(found), found.message
    np.testing.assert_allclose(found.by_start[:2, :2], np.eye(2), atol=1e-9)
    known = np.isfinite(found.by_start).all(axis=0)
    assert known.tolist() == [True, True, False, False, False, True] * 2  # what lifts no corner
    np.testing.assert_allclose(found.by_start[6:, 6:][:, known[6:]], 0.0, atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_by_what_lifts_a_block_that_only_touches_there_is_no_derivative(seed: int) -> None:
    """Lifted it falls first, for sqrt(2 eps/g), without friction: differences grow as eps falls; the others hold."""
    rng = np.random.default_rng(seed)
    mu, T = float(rng.uniform(0.1, 1.0)), 0.02
    one, v = point(mu, ALPHA), [float(rng.uniform(0.5, 2.0)), 0.0]
    found = sensitivity(one, [0, 0], v, T)
    assert found.outcome is Outcome.ILL_POSED
    assert "Row 0 only touches at the start, t = 0 s: by what lifts it off" in found.message
    lost = np.isnan(found.by_start).all(axis=0)
    assert lost.tolist() == [False, True, False, True]
    grown = [(ends(one, [0, eps], v, T, "compiled")[3] - found.state[3]) / eps for eps in (1e-4, 1e-6)]
    assert grown[1] / grown[0] > 5.0
    tried = differences(lambda x: ends(one, [x[0], 0], [x[1], 0], T, "compiled"), np.array([0.0, v[0]]), 1e-5)
    np.testing.assert_allclose(found.by_start[:, ~lost], tried, atol=1e-6)
    deep = sensitivity(one, [0, -1e-4], v, T)
    assert deep.outcome is Outcome.FINISHED, deep.message
