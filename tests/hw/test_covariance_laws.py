"""Scatter of estimates beside the same with whole matrices, over designs, layouts and residuals at random."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import block_diag, toeplitz

from crossbody.hw.fitting.covariance import Layout, _contributions, noise_correlation, scatter
from crossbody.hw.fitting.difference import Differences
from crossbody.hw.fitting.doubts import agreement
from crossbody.hw.fitting.information import information, weak

LAYOUTS = (
    Layout(samples=(40,), k=1), Layout(samples=(25, 31), k=2), Layout(samples=(30,) * 5, k=1),
    Layout(samples=(24,) * 6, k=2, overlap=1),
)  # fmt: skip


def drawn(seed: int, layout: Layout, correlation: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An orthonormal basis (N, 3), weights of estimates (N, 3) and residuals (N,) that the fit has left."""
    random, count = np.random.default_rng(seed), layout.k * sum(layout.samples)
    J = np.column_stack([np.cumsum(random.normal(size=count)) for _ in range(3)])
    Q = np.linalg.qr(J)[0]
    noise = np.linalg.cholesky(correlated(layout, correlation)) @ random.normal(size=count)
    return Q, np.linalg.pinv(J).T, noise - Q @ (Q.T @ noise)


def lengths(layout: Layout) -> list[int]:
    """Of every channel of every window, as residuals follow each other."""
    return [m for m in layout.samples for _ in range(layout.k)]


def correlated(layout: Layout, rho: float) -> np.ndarray:
    """V_ij = rho^|i - j| within each channel of each window (N, N)."""
    return block_diag(*(toeplitz(rho ** np.arange(m)) for m in lengths(layout)))


@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
def test_contributions_are_independent_and_as_large_as_each_other(layout: Layout) -> None:
    """Of steady weights, window by window: what one says of white noise no other does, so that they count as many."""
    parts = _contributions(np.ones(layout.k * sum(layout.samples)), layout)
    total = float(layout.k * sum(layout.samples))
    each = parts.shape[1] // (1 if layout.overlap else len(layout.samples))
    if layout.overlap:  # half a wave is at least as long as windows have samples in common
        assert each * (layout.overlap + 1) <= len(layout.samples)
    own = np.full(each, total) if layout.overlap else np.repeat(layout.k * np.array(layout.samples, dtype=float), each)
    np.testing.assert_allclose(parts.T @ parts, np.diag(own / each), atol=1e-9 * total)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
def test_the_correlation_of_the_noise_is_the_one_that_leaves_what_is_seen(layout: Layout, seed: int) -> None:
    Q, _, residual = drawn(seed, layout, 0.6)
    rho = noise_correlation(Q, residual, layout)
    next_ = block_diag(*(0.5 * (np.eye(m, k=1) + np.eye(m, k=-1)) for m in lengths(layout)))
    left = np.eye(len(residual)) - Q @ Q.T
    meant = left @ correlated(layout, rho) @ left
    seen = residual @ next_ @ residual / (residual @ residual)
    assert np.trace(next_ @ meant) / np.trace(meant) == pytest.approx(seen, abs=1e-3)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
def test_estimates_scatter_together_as_the_noise_goes_through_their_weights(layout: Layout, seed: int) -> None:
    """Their correlations are those of L^T V L; overlapping windows are never taken for white."""
    for correlation in (0.0, 0.7):
        Q, L, residual = drawn(seed, layout, correlation)
        found, smaller = scatter(Q, L, residual, layout), scatter(Q, 1e-3 * L, residual, layout)
        np.testing.assert_allclose(found.half, stats.t.ppf(0.975, found.freedom) * found.std)  # 95 % on both sides
        assert smaller.freedom == pytest.approx(found.freedom, rel=1e-9), "units of estimates tell nothing"
        assert smaller.half == pytest.approx(1e-3 * found.half, rel=1e-9)
        if layout.overlap:
            assert "overlap" in found.how
        if found.how == "white residuals":
            channel = np.concatenate([np.repeat(np.arange(layout.k), m) for m in layout.samples])
            free = 1.0 - (Q * Q).sum(axis=1)
            own = [channel == c for c in range(layout.k)]
            sizes = [residual[rows] @ residual[rows] / free[rows].sum() for rows in own]
            whole = L.T @ (np.array(sizes)[channel][:, None] * L)
            np.testing.assert_allclose(found.covariance, whole, rtol=1e-9)
            assert found.std == pytest.approx(np.sqrt(np.diag(whole)), rel=1e-9)
            continue
        whole = L.T @ correlated(layout, found.correlation) @ L
        size = np.sqrt(np.diag(whole))
        np.testing.assert_allclose(
            found.covariance / np.outer(found.std, found.std), whole / np.outer(size, size), rtol=1e-6
        )


@pytest.mark.parametrize("seed", range(6))
def test_halves_are_compared_in_what_both_of_them_tell(seed: int) -> None:
    """Not in what one of them does not see, or sees of two together alone."""
    random, layout, names = np.random.default_rng(seed), Layout(samples=(40,) * 10, k=1), tuple("abcde")
    J = random.normal(size=(400, 5))
    late = layout.windows() >= 5
    place = random.permutation(5)
    unseen, one, other = place[:3]
    J[late, unseen] = 0.0
    J[~late, other] = J[~late, one]
    residual = random.normal(size=400)
    residual -= J @ np.linalg.lstsq(J, residual, rcond=None)[0]
    found = agreement(J, residual, layout, np.zeros(5), np.ones(5), names, ())
    assert [half.name for half in found] == [names[i] for i in sorted(place[3:])]
    for half in found:
        i = names.index(half.name)
        for rows, value, std in zip((~late, late), half.values, half.stds, strict=True):
            weights = np.linalg.pinv(J[rows])
            assert value == pytest.approx((weights @ residual[rows])[i], abs=1e-9)
            assert std == pytest.approx(np.linalg.norm(weights[i]), rel=0.5)  # of noise of size 1


@pytest.mark.parametrize("seed", range(6))
def test_weights_of_residuals_are_the_pseudoinverse_whatever_the_unknowns_sizes(seed: int) -> None:
    """And the basis is of what the unknowns can change: sizes only say what is told apart from nothing."""
    random = np.random.default_rng(seed)
    sizes = 10.0 ** random.uniform(-3.0, 3.0, 4)
    J = random.normal(size=(30, 4)) / sizes
    told = information(J, sizes)
    np.testing.assert_allclose(told.weights.T * sizes[:, None] ** -1, np.linalg.pinv(J * sizes), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(told.basis @ told.basis.T @ J, J, rtol=1e-9)


def test_central_differences_are_held_against_those_at_half_their_step() -> None:
    """Of x^3 the one is 3 x^2 + h^2, the other 3 x^2 + h^2/4: they tell each other's error."""

    class Cubes(Differences):
        def __init__(self) -> None:
            self.free = ("a", "b")

        def residual(self, x: np.ndarray) -> np.ndarray:
            return np.array([x[0] ** 3, 0.0, x[1]])

    x, h = np.array([2.0, 5.0]), 0.1 * 2.0
    J = Cubes().jacobian(x)
    np.testing.assert_allclose(J, [[3.0 * x[0] ** 2 + h**2, 0.0], [0.0, 0.0], [0.0, 1.0]], rtol=1e-12)
    found = Cubes().checked(x, J, x, np.zeros(2))
    assert found == pytest.approx(0.75 * h**2 / (3.0 * x[0] ** 2 + h**2))


@pytest.mark.parametrize("seed", range(4))
def test_directions_are_weak_that_may_be_as_large_as_the_unknowns(seed: int) -> None:
    """Of relative changes with known deviations along axes at random: those of 1 and more within the interval."""
    random = np.random.default_rng(seed)
    axes = np.linalg.qr(random.normal(size=(4, 4)))[0]
    sizes, told = 10.0 ** random.uniform(-3.0, 3.0, 4), np.array([1e-3, 0.49, 0.51, 40.0])
    found = weak((axes * told**2) @ axes.T * np.outer(sizes, sizes), sizes, 2.0)
    assert len(found) == 2
    np.testing.assert_allclose(np.abs(found @ axes), [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]], atol=1e-6)
