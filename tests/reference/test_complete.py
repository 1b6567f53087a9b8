"""Solutions of systems whose rows depend on each other, against numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody.reference.core.complete import factor_complete, solve_complete


def solved(A: np.ndarray, rank: int, weight: np.ndarray, b: np.ndarray) -> np.ndarray:
    n, factors, x = len(b), A.copy(), b.copy()
    down, across = np.zeros(n, int), np.zeros(n, int)
    assert factor_complete(factors, n, n, down, across, n) == rank
    solve_complete(factors, n, rank, down, across, weight, np.zeros((n, n)), np.zeros(n), x)
    return x


def piled(rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """Return how four corners each of boxes on each other move in the plane by forces at them, and its rank."""
    boxes = int(rng.integers(1, 4))
    rows = np.zeros((8 * boxes, 3 * boxes))
    for box in range(boxes):
        for c, (x, y) in enumerate(((-0.2, -0.15), (0.2, -0.15), (-0.2, 0.15), (0.2, 0.15))):
            at = slice(8 * box + 2 * c, 8 * box + 2 * c + 2)
            rows[at, 3 * box : 3 * box + 3] = ((1, 0, -y), (0, 1, x))
            if box > 0:
                rows[at, 3 * box - 3 : 3 * box] = ((-1, 0, y), (0, -1, -x))
    made = rows * rng.uniform(0.5, 10.0, 3 * boxes) @ rows.T
    size = np.sqrt(np.diag(made))
    return made / np.outer(size, size), 3 * boxes


@pytest.mark.parametrize("seed", range(100))
def test_least_norm_of_loads_some_of_which_are_almost_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A, rank = piled(rng)
    weight = np.repeat(np.where(rng.random(len(A) // 2) < 0.5, 1e-12, 1.0) * rng.uniform(0.9, 1.1), 2)
    b = A @ rng.normal(size=len(A))
    x, root = solved(A, rank, weight, b), np.sqrt(weight)
    least = np.linalg.lstsq(A * root, b, rcond=None)[0]
    assert np.linalg.norm(A @ x - b) <= 1e-12 * np.linalg.norm(b)
    assert np.linalg.norm(x / root) <= (1.0 + 1e-6) * np.linalg.norm(least)


@pytest.mark.parametrize("seed", range(100))
def test_least_squares_and_least_norm(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    rank = int(rng.integers(1, n))
    A, b = rng.normal(size=(n, rank)) @ rng.normal(size=(rank, n)), rng.normal(size=n)
    expected = np.linalg.lstsq(A, b, rcond=1e-10)[0]
    np.testing.assert_allclose(solved(A, rank, np.ones(n), b), expected, atol=1e-7 * np.abs(expected).max())
