"""Compiled algebra of mechanisms whose mass matrices consist of blocks, beside numpy's of the whole matrices."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody.reference.linear import _blocks


def drawn(seed: int) -> tuple[np.random.Generator, int, np.ndarray, np.ndarray]:
    """A generator, the size of blocks, M (n, n) and H (na, n) without a pattern but the blocks."""
    rng = np.random.default_rng(seed)
    k, na = 1 + seed % 4, 1 + seed % 3
    n = k * int(rng.integers(1 + na // k, 5))
    M = np.zeros((n, n))
    for b in range(0, n, k):
        A = rng.normal(size=(k, k))
        M[b : b + k, b : b + k] = A @ A.T + 0.3 * np.eye(k)
    H = rng.normal(size=(na, n)) * (rng.random((na, n)) < 0.8)
    H[:, 0] += 1.0
    return rng, k, M, H


def by_rows(M: np.ndarray, k: int) -> np.ndarray:
    """The blocks of a matrix, one below the other (n, k)."""
    return np.concatenate([M[b : b + k, b : b + k] for b in range(0, len(M), k)])


@pytest.mark.parametrize("seed", range(24))
def test_blocks_are_inverted_and_rows_solved_as_the_whole_saddle_matrix_is(seed: int) -> None:
    rng, k, M, H = drawn(seed)
    (na, n), m, sign = H.shape, 1 + seed % 3, (-1.0) ** seed
    W, G = np.zeros((n, k)), np.zeros((na, na))
    assert _blocks.invert_mass(by_rows(M, k).astype(complex), W, k) == 0
    np.testing.assert_allclose(W, by_rows(np.linalg.inv(M), k), rtol=1e-10, atol=1e-10 * np.abs(W).max())
    assert _blocks.mobility(H.astype(complex), W, k, G) == 0
    np.testing.assert_allclose(G, np.linalg.inv(H @ np.linalg.solve(M, H.T)), rtol=1e-7, atol=1e-9 * np.abs(G).max())
    S = rng.normal(size=(n + na, m))
    K = np.block([[M, -H.T], [H, np.zeros((na, na))]])
    wanted = sign * np.linalg.solve(K, S)
    _blocks.resolve(W, G, H.astype(complex), k, S, sign, np.zeros((n + na, m)))
    np.testing.assert_allclose(S, wanted, rtol=1e-7, atol=1e-8 * np.abs(wanted).max())


@pytest.mark.parametrize("seed", range(8))
def test_masses_that_are_none_and_rows_that_depend_are_told(seed: int) -> None:
    _, k, M, H = drawn(seed)
    W = np.zeros((len(M), k))
    light = M.copy()
    light[: k or 1, 0] = light[0, :k] = 0.0
    assert _blocks.invert_mass(by_rows(light, k).astype(complex), W, k) == 1
    assert _blocks.invert_mass(by_rows(M, k).astype(complex), W, k) == 0
    twice = np.concatenate([H, 2.0 * H[:1]])
    assert _blocks.mobility(twice.astype(complex), W, k, np.zeros((len(twice),) * 2)) == 1
