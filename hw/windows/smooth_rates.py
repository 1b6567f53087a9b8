"""Rates at the starts of windows: from the samples around an instant that one smooth motion explains.

A polynomial across an impact gives neither the rate before nor the one behind. So of all stretches of samples that
contain an instant the longest is taken whose polynomial leaves no more than the noise (a choice of the width by the
data, after Lepski 1991, and of the side as in the edge-preserving smoothing of McDonald and Owen 1986).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from crossbody.hw.windows.whiteness import noise_level

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]
WIDTHS = ((51, 3), (37, 3), (25, 3), (17, 3), (11, 2), (7, 2), (5, 1), (3, 1))
"""Samples of a stretch, and the degree of its polynomial."""
PLACES = 8
"""Places of an instant in a stretch, beside its middle."""
LEVEL = 1e-3
"""Probability that noise alone refuses a stretch by its sum of squares."""
WORST = 5.0
"""Times the noise that a single sample may be off."""
CHUNK = 4000
SMALLEST = 1e-12
"""Noise, as a part of the largest value: rounding of what a simulation writes."""


def smooth_rates(t: Floats, y: Floats, rows: Rows) -> Floats:
    """Rates (m, k) of samples y (n, k) at times t (n,) at some rows; zeros where there is one sample alone."""
    found = np.zeros((len(rows), y.shape[1]))
    noise = np.array([noise_level(column) for column in y.T])
    noise = np.maximum(noise, SMALLEST * np.maximum(np.max(np.abs(y), axis=0), 1e-300))
    left = np.full(len(rows), np.inf)
    for width, degree in WIDTHS:
        if width > len(t):
            continue
        limit = stats.chi2.isf(LEVEL, max(width - degree - 1, 1)) / max(width - degree - 1, 1)
        for place in _places(width):
            open_ = np.flatnonzero(left > 1.0)
            for part in np.array_split(open_, max(1, -(-len(open_) // CHUNK))):
                if not len(part):
                    continue
                rate, off = _fitted(t, y, rows[part], width, degree, place, noise, float(limit))
                better = off < left[part]
                found[part[better]], left[part[better]] = rate[better], off[better]
    return found


def _places(width: int) -> Rows:
    """Where in a stretch the instant may stand: the middle first, then ever nearer to the ends."""
    at = np.unique(np.round(np.linspace(0, width - 1, PLACES + 1)).astype(np.int64))
    return np.asarray(at[np.argsort(np.abs(at - (width - 1) / 2), kind="stable")])


def _fitted(
    t: Floats, y: Floats, rows: Rows, width: int, degree: int, place: int, noise: Floats, limit: float
) -> tuple[Floats, Floats]:
    """Rates (m, k) of polynomials, and how much more than noise they leave (m,): at most 1 if they explain it."""
    first = np.clip(rows - place, 0, len(t) - width)
    at = first[:, None] + np.arange(width)
    span = t[at[:, -1]] - t[at[:, 0]]
    x = (t[at] - t[rows, None]) / span[:, None]
    kinds, which = np.unique(np.round(x, 9), axis=0, return_inverse=True)
    powers = kinds[:, :, None] ** np.arange(degree + 1)
    inverse, which = np.linalg.pinv(powers), which.ravel()
    coefficients = np.einsum("nij,njk->nik", inverse[which], y[at])
    off = (y[at] - np.einsum("nji,nik->njk", powers[which], coefficients)) / noise
    free = max(width - degree - 1, 1)
    large = np.max(np.sum(off**2, axis=1) / free, axis=1) / limit
    return coefficients[:, 1] / span[:, None], np.maximum(large, np.max(np.abs(off), axis=(1, 2)) / WORST)
