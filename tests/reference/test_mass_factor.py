"""The factors of the mass matrix are those of any block-diagonal matrix and of any tree: against LAPACK."""

from __future__ import annotations

import numpy as np
import pytest
from bead import GOOD

from crossbody.cases import SceneError
from crossbody.reference import System
from crossbody.reference._check import check_kernels
from crossbody.reference.core.algebra import factor_mass, solve_mass


def random_mass(draw: np.random.Generator, blocks: int, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return M (n, n) of random trees, one a block, and the coordinate above each."""
    n = blocks * k
    above, M = np.full(n, -1), np.zeros((n, n))
    for i in range(n):
        if i % k and draw.random() > 0.1:
            above[i] = draw.integers(i - i % k, i)
    for i in range(n):
        path = [i]
        while above[path[-1]] >= 0:
            path.append(above[path[-1]])
        J = np.zeros((3, n))
        J[:, path] = draw.normal(size=(3, len(path)))
        M += J.T @ J + np.diag(np.eye(n)[i]) * draw.uniform(0.01, 1.0)
    return M, above


@pytest.mark.parametrize("seed", range(40))
def test_a_tree_is_solved_without_fill_in(seed: int) -> None:
    draw = np.random.default_rng(seed)
    blocks, k = int(draw.integers(1, 4)), int(draw.integers(1, 14))
    M, above = random_mass(draw, blocks, k)
    n = len(M)
    stored = np.array([M[i, i - i % k : i - i % k + k] for i in range(n)])
    L, x = np.full((n, k), np.nan), draw.normal(size=n)
    x[draw.random(n) < 0.3] = 0.0
    wanted = np.linalg.solve(M, x)
    assert factor_mass(stored, L, above, n, k) == 0
    solve_mass(L, x, above, k, 0, n)
    assert np.abs(x - wanted).max() < 1e-13 * np.linalg.cond(M) * (np.abs(wanted).max() + 1e-300)
    i = int(draw.integers(n))
    stored[i, i % k] -= 1.0 / np.linalg.inv(M)[i, i] * (1.0 + 1e-9)  # the least change that makes M singular, and more
    assert factor_mass(stored, L, above, n, k) == 1


def test_what_no_tree_has_is_refused() -> None:
    with pytest.raises(SceneError, match=r"System\.above\[1\] is 1; valid: -1, or a lower coordinate .* 0 to 0"):
        System(n=3, parameters=[1.3, 2.0, 0.7], a0=[1e4], a1=20.0, above=[-1, 1, 1], **GOOD)
    bead = System(n=3, parameters=[1.3, 2.0, 0.7], a0=[1e4], a1=20.0, above=[-1, 0, 0], **GOOD)
    with pytest.raises(SceneError, match=r"gives M\[1, 2\] = .*, though by System\.above neither"):
        check_kernels(bead, np.zeros(3), np.zeros(3))
