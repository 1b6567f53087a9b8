"""How far a prediction is from what was measured: one number each, of one channel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def fit(y: Floats, yhat: Floats) -> float:
    """100 (1 - |y - yhat| / |y - mean y|), %; -inf for a constant measurement that is missed."""
    spread = float(np.linalg.norm(y - y.mean()))
    missed = float(np.linalg.norm(y - yhat))
    if spread == 0.0:
        return 100.0 if missed == 0.0 else -math.inf
    return 100.0 * (1.0 - missed / spread)


def rmse(y: Floats, yhat: Floats) -> float:
    """Root of the mean square of yhat - y."""
    return float(np.sqrt(np.mean((yhat - y) ** 2)))


def largest(y: Floats, yhat: Floats) -> float:
    """Largest |yhat - y|."""
    return float(np.max(np.abs(yhat - y)))


def bias(y: Floats, yhat: Floats) -> float:
    """Mean of yhat - y."""
    return float(np.mean(yhat - y))


def delay(y: Floats, yhat: Floats, step: float, reach: float = 0.25) -> float:
    """How much later the measurement is than the prediction, s: maximum of their cross-correlation.

    The correlation of the first differences (slow drifts would hide the peak) is taken by FFT and normalised by the
    energy of both at each lag; a parabola through the largest value and its neighbours gives parts of a sample.

    Args:
        y: measured, equidistant (n,).
        yhat: predicted (n,).
        step: time between samples, s.
        reach: largest lag, as a part of the record.

    Returns:
        NaN where one of them does not move, or the best lag lies at the edge.
    """
    a, b = np.diff(y), np.diff(yhat)
    n, most = len(a), max(2, int(reach * len(a)))
    size = 1 << (2 * n - 1).bit_length()
    cross = np.fft.irfft(np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size)), size)
    lags = np.arange(-most, most + 1)
    energy_a, energy_b = (np.concatenate(([0.0], np.cumsum(x * x))) for x in (a, b))
    after, before = np.maximum(lags, 0), np.maximum(-lags, 0)
    overlap = n - after - before
    norm = np.sqrt((energy_a[after + overlap] - energy_a[after]) * (energy_b[before + overlap] - energy_b[before]))
    with np.errstate(invalid="ignore", divide="ignore"):
        rho = cross[lags] / norm
    if not np.all(np.isfinite(rho)):
        return math.nan
    k = int(np.argmax(rho))
    if k in (0, len(rho) - 1):
        return math.nan
    low, top, high = rho[k - 1 : k + 2]
    bend = low - 2.0 * top + high
    return float(step * (lags[k] + (0.5 * (low - high) / bend if bend < 0.0 else 0.0)))
