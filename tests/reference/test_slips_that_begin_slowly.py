"""Slips in space that begin without an acceleration: a push across a slope that grows until a point no longer holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from friction_scenes import G, point
from scipy.integrate import solve_ivp

from crossbody.cases import Mode
from crossbody.reference import System, kernels, simulate

PUSH = 8.0  # N/s, of 1 kg
LATER = 0.1  # s
AFTER = 1e-6  # s: so long the slip follows its series


@kernels.dynamics
def _pushed(t, q, v, u, p, M, f, w):  # type: ignore[no-untyped-def]
    for i in range(3):
        for j in range(3):
            M[i, j] = 1.0 if i == j else 0.0
        f[i] = p[1 + i]
    f[1] += PUSH * t


def slope(mu: float, alpha: float) -> tuple[System, float]:
    """Return a point on a slope that falls in x, pushed across it, and when it begins to slide."""
    bound, down = mu * G * np.cos(alpha), G * np.sin(alpha)
    return replace(point(mu, alpha, space=True), dynamics=_pushed), float(np.sqrt(bound**2 - down**2) / PUSH)


def end(mu: float, alpha: float) -> np.ndarray:
    """Return x, y and their rates at `LATER`, by the equations of the slip alone.

    Along s, the direction of the force at the limit, it grows as c tau^2/2, c = PUSH s_y; across it friction b over
    that slip keeps z = PUSH n_y tau (c tau^2/2)/b.
    """
    (_, begins), b, d = slope(mu, alpha), mu * G * np.cos(alpha), G * np.sin(alpha)
    s = np.array([d, PUSH * begins]) / b
    n, c = np.array([-s[1], s[0]]), PUSH * s[1]
    rate = 0.5 * c * AFTER**2 * (s + PUSH * n[1] * AFTER / b * n)

    def slip(t: float, y: np.ndarray) -> np.ndarray:
        friction = b * y[2:] / np.linalg.norm(y[2:])
        return np.array([y[2], y[3], d - friction[0], PUSH * t - friction[1]])

    start = np.concatenate([c * AFTER**3 / 6.0 * s, rate])
    done = solve_ivp(slip, (begins + AFTER, begins + LATER), start, method="Radau", rtol=1e-12, atol=1e-18)
    found: np.ndarray = done.y[:, -1]
    return found


@pytest.mark.parametrize("solver", ["compiled", "cvode"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize(("mu", "alpha"), [(0.5, 0.3), (0.9, 0.6), (0.3, 0.05)])
def test_a_slip_that_begins_without_acceleration(mu: float, alpha: float, rtol: float, solver: str) -> None:
    """Its error follows the tolerance: nothing holds it where it begins."""
    (made, begins), found = slope(mu, alpha), end(mu, alpha)
    run = simulate(made, np.zeros(3), np.zeros(3), begins + LATER, rtol=rtol, solver=solver)
    (slides,) = (e for e in run.events if e.after is Mode.SLIP)
    assert slides.t == pytest.approx(begins, abs=1e-12)
    assert np.abs(run.q[-1, :2] - found[:2]).max() < 1e-2 * rtol
    assert np.abs(run.v[-1, :2] - found[2:]).max() < 1e-1 * rtol
