"""Is what the model leaves over noise? Autocorrelation of residuals and their correlation with the inputs.

For white residuals of n samples that do not depend on the input each correlation is normal with variance 1/n at every
lag, so that 99 of 100 lie within +-2.576/sqrt(n) (Ljung, System Identification, 2nd ed., 16.6).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
BAND = 2.5758293035489004
"""Quantile of the normal distribution for 99 %, two-sided."""
LAGS = 25


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Correlation:
    """Correlations at lags, beside their 99 % band.

    Attributes:
        lags (m,): in samples; of a residual behind an input, or behind itself.
        values (m,): at most 1 in size.
        band: 99 of 100 lie within +-band if there is nothing left to explain.
    """

    lags: NDArray[np.int64]
    values: Floats
    band: float

    @property
    def inside(self) -> float:
        """Part of the lags, 0 to 1, that lies within the band; lag 0 of a residual with itself not counted."""
        own = np.abs(self.values[self.lags != 0]) if self.values[self.lags == 0].tolist() == [1.0] else self.values
        return float(np.mean(np.abs(own) <= self.band))


def autocorrelation(residual: Floats, most: int = LAGS) -> Correlation:
    """Of a residual (n,) with itself, lags 0 to `most`."""
    found = _correlation(residual, residual, most)
    values = found.values[most:]
    values[0] = 1.0
    return Correlation(lags=found.lags[most:], values=values, band=found.band)


def crosscorrelation(residual: Floats, u: Floats, most: int = LAGS) -> Correlation:
    """Of a residual (n,) with an input (n,), lags -most to most; beyond white noise of either it needs whitening.

    Both pass the filter that whitens the input (autoregressive, of order 5, by least squares): a slow input alone would
    widen the scatter beyond the band.
    """
    taps = _whitener(u)
    return _correlation(np.convolve(residual, taps, "valid"), np.convolve(u, taps, "valid"), most)


def _correlation(a: Floats, b: Floats, most: int) -> Correlation:
    n = len(a)
    a, b = a - a.mean(), b - b.mean()
    size = 1 << (2 * n - 1).bit_length()
    cross = np.fft.irfft(np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size)), size)
    lags = np.arange(-most, most + 1)
    norm = float(np.linalg.norm(a) * np.linalg.norm(b))
    values = cross[lags] / norm if norm > 0.0 else np.zeros(len(lags))
    return Correlation(lags=lags, values=values, band=BAND / np.sqrt(n))


def _whitener(u: Floats, order: int = 5) -> Floats:
    """Taps of 1 - sum a_k z^-k."""
    centred = u - u.mean()
    past = np.column_stack([centred[order - k - 1 : len(u) - k - 1] for k in range(order)])
    solution = np.linalg.lstsq(past, centred[order:], rcond=1e-10)[0]
    return np.concatenate(([1.0], -solution))
