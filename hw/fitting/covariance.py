"""Covariance of least-squares estimates from residuals that may be correlated in time and between channels.

White residuals have the covariance sum_c s_c^2 L_c L_c^T, L = (J^T J)^-1 J^T, with a noise s_c of every
channel. For others the variance of an estimate l^T r is found from its own contributions: the parts
l_j^T r with l_j = l f_j(t) on one window, f_j cosines over it (of order 0 alone: the windows' own
scores, Liang and Zeger 1986; several: the orthonormal series of Lazarus, Lewis, Stock and Watson 2018,
which needs no bandwidth). A fit makes residuals smaller and less correlated than the noise; what that
takes from the mean of the parts, and how many independent parts they are worth, follows from a working
covariance V of the noise (Bell and McCaffrey 2002): with a_j = (I - Q Q^T) l_j and A = a^T V a,

    var = mean (l_j^T r)^2  l^T V l / mean A_jj,    degrees of freedom = (sum A_jj)^2 / sum A_jk^2.

V is a first-order autoregression with the lag-1 correlation of which the fit leaves the observed
one in the mean. Where it is right the variance is unbiased; where it is not, the parts still tell
the variance at low frequencies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal, stats
from scipy.optimize import brentq

from crossbody.cases.arrays import Floats

LEVEL = 0.95
PARTS = 16
"""Contributions that a variance is found from, at least: cosines of each where windows are fewer."""
WHITE = 0.05  # probability below which residuals do not count as white
LAGS = 10  # lags of the test for white residuals
STRONGEST = 0.999  # largest lag-1 correlation of the noise that is told from a drift


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How residuals follow each other: window by window, in each channel by channel, in each by time.

    Attributes:
        samples: of every window.
        k: number of channels.
        overlap: how many of the windows behind it a window has samples in common with, at most.
    """

    samples: tuple[int, ...]
    k: int
    overlap: int = 0

    def series(self) -> tuple[slice, ...]:
        """Rows of every channel of every window, window by window."""
        ends = np.cumsum(np.repeat(self.samples, self.k))
        return tuple(slice(int(b - m), int(b)) for b, m in zip(ends, np.repeat(self.samples, self.k), strict=True))

    def windows(self) -> NDArray[np.int64]:
        """Window of every residual (N,)."""
        return np.repeat(np.arange(len(self.samples)), self.k * np.array(self.samples))

    def channels(self) -> NDArray[np.int64]:
        """Channel of every residual (N,)."""
        return np.concatenate([np.repeat(np.arange(self.k), m) for m in self.samples])

    def times(self) -> Floats:
        """Place of every residual in its window, 0 to 1 (N,)."""
        return np.concatenate([np.tile((np.arange(m) + 0.5) / m, self.k) for m in self.samples])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scatter:
    """How far estimates scatter.

    Attributes:
        std (P,): standard deviations.
        half (P,): half of each 95 % interval.
        freedom (P,): degrees of freedom that each is known with.
        covariance (P, P): with the variances std^2.
        correlation: lag-1 correlation of the noise; 0 for white.
        how: in words.
    """

    std: Floats
    half: Floats
    freedom: Floats
    covariance: Floats
    correlation: float
    how: str


def scatter(Q: Floats, L: Floats, residual: Floats, layout: Layout) -> Scatter:
    """Scatter of estimates L^T noise.

    Args:
        Q: orthonormal basis of what the fit took from the noise (N, R).
        L: weight of every residual in every estimate (N, P).
        residual: (N,), what the fit left.
        layout: of the residuals.
    """
    if not layout.overlap and whiteness(Q, residual, layout) >= WHITE:
        variance, freedom, base = _white(Q, L, residual, layout)
        rho, how = 0.0, "white residuals"
    else:
        rho = noise_correlation(Q, residual, layout)
        variance, freedom, base = _correlated(Q, L, residual, layout, rho)
        how = f"residuals correlated from sample to sample by {rho:.3f}, {_parts(layout)}"
    std = np.sqrt(variance)
    spread = np.sqrt(np.diag(base))
    with np.errstate(invalid="ignore", divide="ignore"):
        factor = np.where(spread > 0.0, std / spread, 0.0)
    covariance = base * np.outer(factor, factor)
    return Scatter(
        std=std, half=stats.t.ppf(0.5 + 0.5 * LEVEL, freedom) * std, freedom=freedom, covariance=covariance,
        correlation=rho, how=how,
    )  # fmt: skip


def whiteness(Q: Floats, residual: Floats, layout: Layout) -> float:
    """Probability of correlations at least as large if the noise is white, the lower of lag 1 and of all lags, doubled.

    Correlations are pooled over all windows, so that short ones count too; what white noise of
    this fit has in the mean is taken off.
    """
    if not np.any(residual):
        return 1.0
    channel = layout.channels()
    size = np.sqrt(np.bincount(channel, residual**2) / np.bincount(channel))
    r = residual / np.where(size > 0.0, size, 1.0)[channel]
    shortest = min(layout.samples)
    lags = np.arange(1, max(2, min(LAGS, shortest // 4) + 1))
    scores = np.array([_lagged(r, Q, layout, int(lag)) for lag in lags])
    one = 2.0 * stats.norm.sf(abs(scores[0]))
    every = stats.chi2.sf(float(scores @ scores), len(scores))
    return float(min(1.0, 2.0 * min(one, every)))


def _lagged(r: Floats, Q: Floats, layout: Layout, lag: int) -> float:
    """Correlation at one lag, less its mean, over its standard deviation for white noise."""
    found = mean = pairs = 0.0
    for rows in layout.series():
        x, basis = r[rows], Q[rows]
        found += float(x[:-lag] @ x[lag:])
        mean -= float(np.sum(basis[:-lag] * basis[lag:]))
        pairs += max(len(x) - lag, 0)
    total = float(r @ r)
    return float((found / total - mean / max(len(r) - Q.shape[1], 1)) * len(r) / np.sqrt(max(pairs, 1.0)))


def noise_correlation(Q: Floats, residual: Floats, layout: Layout) -> float:
    """Lag-1 correlation of an autoregressive noise of which this fit leaves the observed one in the mean."""
    series = layout.series()
    seen = sum(float(residual[s][:-1] @ residual[s][1:]) for s in series) / float(residual @ residual)

    def excess(rho: float) -> float:
        VQ = _through(Q, rho, series)
        inner = Q.T @ VQ
        left = len(residual) - float(np.trace(inner))
        pairs = rho * sum(s.stop - s.start - 1 for s in series)
        cross = float(np.sum(_shifted(Q, series) * VQ))
        own = float(np.sum((Q.T @ _shifted(Q, series)) * inner))
        return float((pairs - 2.0 * cross + own) / max(left, 1e-300)) - seen

    low, high = 0.0, STRONGEST
    if excess(high) <= 0.0:
        return high
    if excess(low) >= 0.0:
        return low
    return np.float64(brentq(excess, low, high, xtol=1e-4)).item()


def _shifted(X: Floats, series: tuple[slice, ...]) -> Floats:
    """Half of what stands a sample before and behind, in each series: x^T S x sums products of neighbours."""
    found = np.zeros_like(X)
    for rows in series:
        found[rows][1:] += 0.5 * X[rows][:-1]
        found[rows][:-1] += 0.5 * X[rows][1:]
    return found


def _through(X: Floats, rho: float, series: tuple[slice, ...]) -> Floats:
    """V X for V_ij = rho^|i - j| within each series, by one pass forward and one back."""
    found = np.empty_like(X)
    for rows in series:
        part = X[rows]
        ahead = signal.lfilter([1.0], [1.0, -rho], part, axis=0)
        behind = signal.lfilter([1.0], [1.0, -rho], part[::-1], axis=0)[::-1]
        found[rows] = ahead + behind - part
    return found


def _white(Q: Floats, L: Floats, residual: Floats, layout: Layout) -> tuple[Floats, Floats, Floats]:
    """Variances, degrees of freedom and covariance for noise of a size of its own in every channel."""
    channel = layout.channels()
    taken = np.sum(Q * Q, axis=1)
    variance, cut, base = np.zeros(L.shape[1]), np.zeros(L.shape[1]), np.zeros((L.shape[1], L.shape[1]))
    for c in range(layout.k):
        own = channel == c
        free = max(float(np.sum(1.0 - taken[own])), 1.0)
        noise = float(residual[own] @ residual[own]) / free
        part = noise * (L[own].T @ L[own])
        base += part
        variance += np.diag(part)
        cut += np.diag(part) ** 2 / free
    with np.errstate(invalid="ignore", divide="ignore"):
        freedom = np.where(cut > 0.0, variance**2 / cut, float(max(len(residual) - Q.shape[1], 1)))
    return variance, np.maximum(freedom, 1.0), base


def _correlated(Q: Floats, L: Floats, residual: Floats, layout: Layout, rho: float) -> tuple[Floats, Floats, Floats]:
    """Variances, degrees of freedom and covariance from contributions of windows and of cosines over them."""
    series = layout.series()
    VL = _through(L, rho, series)
    size = float(residual @ residual) / max(len(residual) - float(np.sum(Q * _through(Q, rho, series))), 1.0)
    variance, freedom = np.empty(L.shape[1]), np.empty(L.shape[1])
    for i in range(L.shape[1]):
        parts = _contributions(L[:, i], layout)
        a = parts - Q @ (Q.T @ parts)
        A = a.T @ _through(a, rho, series)
        seen, meant, true = float(np.sum((parts.T @ residual) ** 2)), float(np.trace(A)), float(L[:, i] @ VL[:, i])
        variance[i] = seen * true / meant if meant > 0.0 else 0.0
        freedom[i] = meant**2 / float(np.sum(A * A)) if meant > 0.0 else 1.0
    return variance, np.maximum(freedom, 1.0), size * (L.T @ VL)


def _across(layout: Layout) -> int:
    """Cosines over the order of windows that overlap: slow enough that neighbours count as one."""
    return max(1, len(layout.samples) // (layout.overlap + 1))


def _each(layout: Layout) -> int:
    """Cosines a window."""
    return max(1, min(-(-PARTS // len(layout.samples)), min(layout.samples)))


def _parts(layout: Layout) -> str:
    count = len(layout.samples)
    if layout.overlap:
        return f"scatter of {_across(layout)} cosines over {count} windows, which overlap"
    if _each(layout) == 1:
        return f"scatter of {count} windows"
    return f"scatter of {_each(layout)} cosines over {'the window' if count == 1 else f'each of {count} windows'}"


def _contributions(weight: Floats, layout: Layout) -> Floats:
    """Weights (N, parts) of one estimate's contributions: one window and one cosine each."""
    window, t, each = layout.windows(), layout.times(), _each(layout)
    if layout.overlap:
        place = np.pi * (window + 0.5) / len(layout.samples)
        waves = np.sqrt(2.0) * np.cos(np.outer(place, np.arange(_across(layout))))
        waves[:, 0] = 1.0
        spread: Floats = weight[:, None] * waves / np.sqrt(_across(layout))
        return spread
    found = np.zeros((len(weight), len(layout.samples) * each))
    for w in range(len(layout.samples)):
        rows = window == w
        for j in range(each):
            wave = np.ones(int(rows.sum())) if j == 0 else np.sqrt(2.0) * np.cos(np.pi * j * t[rows])
            found[rows, w * each + j] = weight[rows] * wave / np.sqrt(each)
    return found
