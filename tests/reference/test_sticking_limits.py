"""The load up to which several contacts hold a body: no sharing among them that one finds at once tells it."""

from __future__ import annotations

import numpy as np
import pytest
from friction_scenes import G, linear
from scipy.optimize import minimize

from crossbody.cases import Mode, Outcome, Trajectory
from crossbody.reference import simulate

STARTS = 6
NEAR = {"compiled": 1e-3, "cvode": 0.02}  # the limit: the latter's projections take long beside it


def plate(seed: int) -> tuple[np.ndarray, np.ndarray, float, int, np.ndarray]:
    """Return rows of a plate of unit masses on feet about its centre, a way to push and turn it, mu, and its feet."""
    rng = np.random.default_rng(seed)
    count, mu = int(rng.integers(3, 7)), float(rng.uniform(0.1, 1.5))
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, count)) if count > 4 else 2.0 * np.pi * np.arange(count) / count
    feet = np.column_stack([np.cos(angles), 0.6 * np.sin(angles)]) * rng.uniform(0.5, 2.0)
    feet -= feet.mean(axis=0)
    normal = [[0, 0, 1, y, -x, 0] for x, y in feet]
    along = [row for x, y in feet for row in ([1, 0, 0, 0, 0, -y], [0, 1, 0, 0, 0, x])]
    return np.array(normal + along, dtype=float), rng.normal(size=3), mu, count, feet


def limit(push: np.ndarray, mu: float, feet: np.ndarray, loads: np.ndarray) -> float:
    """Return the least factor of a push (x, y, turn) at which some motion of the plate gains what friction takes.

    How feet that depend on each other share the weight is no law's: the loads are given.
    """

    def factor(v: np.ndarray) -> float:
        taken = loads @ np.hypot(v[0] - feet[:, 1] * v[2], v[1] + feet[:, 0] * v[2])
        return float(mu * taken / abs(push @ v)) if abs(push @ v) > 1e-12 else np.inf

    rng, options = np.random.default_rng(0), {"xatol": 1e-12, "fatol": 1e-14, "maxiter": 8000, "maxfev": 8000}
    found = [
        minimize(factor, rng.normal(size=3), method="Nelder-Mead", options=options).fun for _ in range(STARTS)
    ]  # fmt: skip
    return min(*found, *(factor(np.array([y, -x, 1.0])) for x, y in feet))


@pytest.mark.parametrize(
    ("seed", "solver"),
    [
        *((seed, "compiled") for seed in range(10)), (0, "cvode"),
        *(pytest.param(seed, "cvode", marks=pytest.mark.slow) for seed in range(1, 10)),
    ],
)  # fmt: skip
def test_feet_hold_a_plate_up_to_the_load_that_moves_it(seed: int, solver: str) -> None:
    H, push, mu, count, feet = plate(seed)

    def pushed(part: float) -> Trajectory:
        x, y, turn = part * push
        made = linear(H, np.array([x, y, -G, 0.0, 0.0, turn]), mu, count)
        found = simulate(made, np.zeros(6), np.zeros(6), 1e-3, rtol=1e-9, solver=solver)
        assert found.outcome is Outcome.FINISHED, found.message
        return found

    most = limit(push, mu, feet, pushed(0.0).lam[-1, :count])
    held, moved = pushed((1.0 - NEAR[solver]) * most), pushed(1.02 * most)
    assert np.abs(held.v[-1]).max() < 1e-12
    assert set(held.mode[-1, :count]) == {Mode.STICK}
    assert np.abs(moved.v[-1]).max() > 1e-7
