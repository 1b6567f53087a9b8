"""The profile of a parameter's cost: of a linear model it is the least cost that the others can reach, exactly."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from crossbody.hw.fitting.doubts import POINTS, SPAN, profiles

FREE = (np.full(3, -np.inf), np.full(3, np.inf))


def problem(seed: int, bend: float = 0.0) -> tuple[SimpleNamespace, np.ndarray, np.ndarray, np.ndarray]:
    """Residuals of three unknowns, their estimate, A and b; with `bend` they are no line."""
    random = np.random.default_rng(seed)
    A = random.standard_normal((40, 3)) @ np.diag(10.0 ** random.uniform(-2.0, 2.0, 3))
    b = random.standard_normal(40)
    x = np.linalg.lstsq(A, b, rcond=None)[0]
    return SimpleNamespace(residual=lambda z: A @ z - b + bend * (A[:, 0] * (z[0] - x[0])) ** 2), x, A, b


@given(seed=st.integers(0, 10**6), i=st.integers(0, 2))
def test_of_a_linear_model_it_is_the_least_cost_of_all_others(seed: int, i: int) -> None:
    residuals, x, A, b = problem(seed)
    std = float(np.sqrt(np.linalg.inv(A.T @ A)[i, i]))
    values, costs = profiles(residuals, x, A, np.abs(x) + 1e-6, {i: std}, FREE)[i]
    np.testing.assert_allclose(values, x[i] + SPAN * std * np.linspace(-1.0, 1.0, POINTS))
    others = np.delete(np.arange(3), i)
    best = np.sum((A @ x - b) ** 2)
    for value, cost in zip(values, costs, strict=True):
        left = b - A[:, i] * value
        least = np.sum((A[:, others] @ np.linalg.lstsq(A[:, others], left, rcond=None)[0] - left) ** 2)
        assert abs(cost - least / best) <= 1e-9 * cost
    np.testing.assert_allclose((costs - 1.0) * best, ((values - x[i]) / std) ** 2, rtol=1e-6, atol=1e-9 * best)


def test_of_a_model_that_bends_it_is_no_parabola() -> None:
    residuals, x, A, _ = problem(3, bend=0.5)
    std = float(np.sqrt(np.linalg.inv(A.T @ A)[0, 0]))
    _, costs = profiles(residuals, x, A, np.abs(x), {0: 3.0 * std}, FREE)[0]
    assert abs(costs[0] - costs[-1]) > 1e-3 * (costs[0] - 1.0)


def test_values_beyond_a_bound_are_left_out() -> None:
    residuals, x, A, _ = problem(5)
    std = float(np.sqrt(np.linalg.inv(A.T @ A)[1, 1]))
    low = np.array([-np.inf, x[1] - std, -np.inf])
    values, _ = profiles(residuals, x, A, np.abs(x), {1: std}, (low, FREE[1]))[1]
    assert values.min() >= low[1]
    assert len(values) < POINTS
