"""How far a prediction is from what was measured: one number each, of one channel."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.hw.windows.whiteness import noise_level, products

REACH = 0.25  # largest lag that is looked at, as a part of a window
RIVAL = 0.9
"""Part of the highest correlation from which on a maximum may be the delay: real models are so far off."""
ALIKE = 0.8  # part of the correlation that noise admits, from which on two motions have the same shape
REPEATS = 0.1
"""Angle (arc cosine of the correlation) between a motion and itself moved up to which it repeats itself."""
EXPLAINED = 3.0
"""That angle over the one between measurement and prediction where they are most alike, up to
which a maximum that is lower for the model's error alone may be the delay. Of 1,200 motions of
three harmonics, whose amplitudes and phases the model has wrong by 0, 5 and 20 %, none was given
a wrong delay; with 0.9 of the highest maximum alone one was."""
WIDE, REAL = 4, 1e-9
"""Neighbours to either side that tell how high a maximum between samples is; imaginary part of a real root."""
UNSURE = 3.0
"""Error of that over what one neighbour less changes: r/(1 - r) with r = sin^2(w/2), w rad a
sample; 3 at 3 samples a period."""
NEARER = 0.8  # how much nearer to 0 a maximum must be than its rival on the other side


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


def delay(y: Floats, yhat: Floats, step: float, reach: float = REACH) -> float:
    """How much later the measurement is than the prediction, s: `shift` of their first differences."""
    return shift([np.diff(y)], [np.diff(yhat)], step, reach)


def shift(a: Sequence[Floats], b: Sequence[Floats], step: float, reach: float = REACH) -> float:
    """How much later increments a are than increments b, s: a maximum of their cross-correlation.

    The correlation is taken by FFT within each window and normalised by the energy of both at
    each lag; a polynomial through a maximum and its neighbours gives parts of a sample. (Of
    increments: slow drifts would hide the peak.) A motion that repeats itself correlates nearly
    as well at lags of whole periods, and what is left to tell them apart is the model's error: of
    all maxima that this error may have lowered, the one nearest to 0 is taken.

    Args:
        a: of the measurement, equidistant, one array a window.
        b: of the prediction.
        step: time between samples, s.
        reach: largest lag, as a part of the shortest window.

    Returns:
        NaN where one of them does not move, where they do not have the same shape at any lag,
        where the correlation is highest at the edge, or where maxima on both sides of 0 are as
        near to it (the delay is then about half a period, forwards or backwards).
    """
    most = max(2, int(reach * min(map(len, a))))
    lags, rho = _lagged(a, b, most)
    if not np.all(np.isfinite(rho)):
        return math.nan
    peaks = 1 + np.flatnonzero((rho[1:-1] >= rho[:-2]) & (rho[1:-1] >= rho[2:]))
    if not len(peaks) or rho[peaks].max() < rho.max() or not rho.max() > 0.0:
        return math.nan
    if rho.max() < ALIKE * _ceiling(a):
        return math.nan
    heights, unsure = np.array([_height(rho, int(k)) for k in peaks]).T
    high = heights + unsure >= RIVAL * heights.max()
    rivals = _rivals(b, most, peaks[high], (heights - unsure)[high])
    k = int(rivals[np.argmin(np.abs(lags[rivals]))])
    other = rivals[np.sign(lags[rivals]) == -np.sign(lags[k])]
    if len(other) and lags[k] and abs(lags[k]) > NEARER * np.min(np.abs(lags[other])):
        return math.nan
    return step * (float(lags[k]) + _vertex(rho, k)[0])


def _vertex(rho: Floats, k: int, wide: int = WIDE) -> tuple[float, float]:
    """Where the polynomial through rho[k] and its neighbours is highest, in samples behind k, and how high it is.

    Of a motion with few samples a period a parabola would be too low between two of them: a lag
    of a whole period would look less alike than one that a sample happens to meet.
    """
    wide = min(wide, k, len(rho) - 1 - k)
    places = np.arange(-wide, wide + 1.0)
    curve = polynomial.polyfit(places, rho[k - wide : k + wide + 1], 2 * wide)
    turns = polynomial.polyroots(polynomial.polyder(curve))
    near = turns.real[(np.abs(turns.imag) < REAL) & (np.abs(turns.real) <= 1.0)]
    places = np.concatenate([[0.0], near])
    heights = polynomial.polyval(places, curve)
    best = int(np.argmax(heights))
    return float(places[best]), float(heights[best])


def _height(rho: Floats, k: int) -> tuple[float, float]:
    """Height of the maximum near sample k, and to what it is known, by how far off fewer neighbours are."""
    height = _vertex(rho, k)[1]
    return height, UNSURE * abs(height - _vertex(rho, k, WIDE - 1)[1])


def _angle(rho: Floats, k: int) -> float:
    """Least angle between two motions near lag k from their correlations, rad: of the highest within two."""
    near = k - 2 + int(np.argmax(rho[k - 2 : k + 3]))
    return math.acos(min(sum(_height(rho, near)), 1.0))


def _rivals(b: Sequence[Floats], most: int, peaks: NDArray[np.int64], heights: Floats) -> NDArray[np.int64]:
    """Those maxima that are the delay if the highest is so by the model's error alone.

    The prediction moved to the one and to the other lag are phi apart. If it were the lower one,
    the model's error would have to lie along their difference for the higher one to be nearer
    than phi: by chance for small angles only. Windows shorter than twice the lags cannot be held
    against themselves: all maxima stay.
    """
    best = int(peaks[np.argmax(heights)])
    reach = 2 * most + 4
    if len(peaks) == 1 or reach >= min(map(len, b)):
        return peaks
    alone = _lagged(b, b, reach)[1]
    limit = max(REPEATS, EXPLAINED * math.acos(min(float(heights.max()), 1.0)))
    return np.array([k for k in peaks if k == best or _angle(alone, reach + int(k) - best) <= limit])


def _ceiling(a: Sequence[Floats]) -> float:
    """Correlation that the noise of the measurement leaves to a perfect prediction."""
    noise = noise_level([np.concatenate(([0.0], np.cumsum(x))) for x in a])
    power = sum(float(x @ x) for x in a) / sum(map(len, a))
    return math.sqrt(max(1.0 - 2.0 * noise**2 / power, 0.0)) if power > 0.0 else 0.0


def _lagged(a: Sequence[Floats], b: Sequence[Floats], most: int) -> tuple[NDArray[np.int64], Floats]:
    """Lags -most to most and the normalised correlations there, summed over windows."""
    lags = np.arange(-most, most + 1)
    cross, size_a, size_b = (np.zeros(len(lags)) for _ in range(3))
    for x, y in zip(a, b, strict=True):
        n = len(x)
        cross += products(x, y, lags)
        energy_x, energy_y = (np.concatenate(([0.0], np.cumsum(z * z))) for z in (x, y))
        after, before = np.maximum(lags, 0), np.maximum(-lags, 0)
        both = n - after - before
        size_a += energy_x[after + both] - energy_x[after]
        size_b += energy_y[before + both] - energy_y[before]
    with np.errstate(invalid="ignore", divide="ignore"):
        return lags, cross / np.sqrt(size_a * size_b)
