"""What an identification finds: values, their 95 % intervals, what the data cannot tell, and held-out windows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from crossbody.hw.replaying.whiteness import autocorrelation

Floats = NDArray[np.float64]
LEVEL = 0.95
NULL = 1e-9
"""Singular value of the scaled derivatives, over the largest, below which a direction has no effect."""
CLUSTERS = 8
"""Windows from which on their scatter tells the covariance."""
WHITE = 0.9
"""Part of the lags inside the 99 % band from which on residuals count as white."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """One identified parameter.

    Attributes:
        name, unit: which one.
        value: the estimate.
        std: its standard deviation; infinite where the data do not tell it.
        low, high: 95 % interval.
        start: where the search began.
        bounds: of the search.
        identifiable: whether the interval tells it from anything within the bounds.
    """

    name: str
    unit: str
    value: float
    std: float
    low: float
    high: float
    start: float
    bounds: tuple[float, float]
    identifiable: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """An identification.

    Attributes:
        model: of what.
        estimates: one a free parameter.
        correlation (P, P): of the estimates; NaN where one is not identifiable.
        parameters: every parameter of the model, the identified ones in place.
        delay: of the measured coordinates beyond what the map says, s.
        fitted, held: numbers of the windows that were fitted and of those that were not.
        before, after: error -> (on fitted windows, on held ones) with the parameters at the start and the estimates:
            "rmse", and median and 90th percentile of the largest error at the end of a window.
        sensitivities: how derivatives were taken, and how far central differences at the solution are from them.
        covariance: how the intervals were found.
        warnings: what the data cannot tell, and what does not fit.
        evaluations: runs of all windows.
        success: whether the search converged.
        message: of the search.
    """

    model: str
    estimates: tuple[Estimate, ...]
    correlation: Floats
    parameters: Mapping[str, float | int | str | bool]
    delay: float
    fitted: tuple[int, ...]
    held: tuple[int, ...]
    before: Mapping[str, tuple[float, float]]
    after: Mapping[str, tuple[float, float]]
    sensitivities: str
    covariance: str
    warnings: tuple[str, ...]
    evaluations: int
    success: bool
    message: str

    def __getitem__(self, name: str) -> Estimate:
        """One estimate by its name."""
        return next(e for e in self.estimates if e.name == name)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spread:
    """Covariance of estimates (P, P), the quantile that makes intervals of it, unknown directions, and how."""

    covariance: Floats
    quantile: float
    null: Floats
    how: str


def spread(J: Floats, residual: Floats, owners: NDArray[np.int64], scale: Floats) -> Spread:
    """Covariance of least-squares estimates.

    White residuals: s^2 (J^T J)^-1. Else, with at least 8 windows, the scatter of the windows' own gradients
    (J^T J)^-1 (sum g_w g_w^T) (J^T J)^-1, g_w = J_w^T r_w, for windows that are independent of each other however
    residuals are correlated within one (Liang and Zeger 1986). Else s^2 (J^T J)^-1 times the correlation time.

    Args:
        J: derivatives (N, P).
        residual: (N,).
        owners: window of every residual (N,).
        scale: typical size of every unknown (P,).
    """
    n, size = J.shape
    _, s, Vt = np.linalg.svd(J * scale, full_matrices=False)
    known = s > NULL * s[0]
    inverse = (Vt[known].T / s[known] ** 2) @ Vt[known]
    null = Vt[~known]
    free = max(n - size, 1)
    noise = float(residual @ residual) / free
    tests = [autocorrelation(residual[owners == w]) for w in np.unique(owners) if np.sum(owners == w) > 60]
    white = not tests or float(np.mean([test.inside for test in tests])) >= WHITE
    groups = np.unique(owners)
    if white:
        return Spread(
            covariance=_scaled(noise * inverse, scale), quantile=_quantile(free), null=null, how="white residuals"
        )
    if len(groups) >= CLUSTERS:
        g = np.array([(J * scale)[owners == w].T @ residual[owners == w] for w in groups])
        middle = len(groups) / (len(groups) - 1) * g.T @ g
        return Spread(
            covariance=_scaled(inverse @ middle @ inverse, scale), quantile=_quantile(len(groups) - 1), null=null,
            how=f"scatter of {len(groups)} windows, residuals being correlated within each",
        )  # fmt: skip
    time = max(_correlation_time(residual[owners == w]) for w in groups)
    return Spread(
        covariance=_scaled(time * noise * inverse, scale), quantile=_quantile(max(n / time - size, 1.0)), null=null,
        how=f"residuals correlated over {time:.3g} samples",
    )  # fmt: skip


def _scaled(covariance: Floats, scale: Floats) -> Floats:
    return covariance * np.outer(scale, scale)


def _quantile(free: float) -> float:
    return float(stats.t.ppf(0.5 + 0.5 * LEVEL, free))


def _correlation_time(residual: Floats) -> float:
    """1 + 2 sum of the autocorrelations up to the first that is not positive, samples."""
    rho = autocorrelation(residual, len(residual) // 2).values[1:]
    stop = int(np.argmax(rho <= 0.0)) if np.any(rho <= 0.0) else len(rho)
    return 1.0 + 2.0 * float(np.sum(rho[:stop]))
