"""Impacts in sampled positions; rates and accelerations, by polynomials through the samples around each instant.

A polynomial across an impact gives neither the rate before nor the one behind. So at the starts
of windows, of all stretches of samples that contain an instant, the longest is taken whose
polynomial leaves no more than the noise (a choice of the width by the data, after Lepski 1991,
and of the side as in the edge-preserving smoothing of McDonald and Owen 1986).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from crossbody.cases import InvalidValue
from crossbody.cases.arrays import Floats
from crossbody.hw.windows.whiteness import noise_level

PART = 0.25  # of the largest acceleration of the measurement: what is smaller is no impact
CLEAR = 6.0  # times the noise of the second difference
TOGETHER = 0.05  # largest distance of impacts that are the same one, s
Rows = NDArray[np.int64]
HALF = 25  # samples on each side
CHUNK = 2000
DEGREE = 3
WIDTHS = ((51, 3), (37, 3), (25, 3), (17, 3), (11, 2), (7, 2), (5, 1), (3, 1))
"""Samples of a stretch, and the degree of its polynomial."""
PLACES = 8  # places of an instant in a stretch, beside its middle
LEVEL = 1e-3  # probability that noise alone refuses a stretch by its sum of squares
WORST = 5.0  # times the noise that a single sample may be off
SMALLEST = 1e-12  # noise, as a part of the largest value: rounding of what a simulation writes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Impacts:
    """Impacts of one motion: centroid of each acceleration, s, and change of the rate in it, m/s."""

    t: Floats
    jump: Floats


def impacts(t: Floats, y: Floats, least: float) -> Impacts:
    """Stretches in which the second difference of positions y, m, at t, s, stays above `least`, m/s^2."""
    rate, middle = np.diff(y) / np.diff(t), 0.5 * (t[1:] + t[:-1])
    step = np.diff(middle)
    jump, hit = np.diff(rate), np.zeros(len(t), dtype=bool)
    hit[1:-1] = jump / step > least
    edges = np.flatnonzero(np.diff(hit.astype(np.int8)))
    found = []
    for a, b in zip(edges[::2], edges[1::2], strict=False):
        weights = jump[a:b]
        found.append((float(np.average(t[a + 1 : b + 1], weights=weights)), float(weights.sum())))
    times, jumps = np.array(found).reshape(-1, 2).T
    return Impacts(t=times, jump=jumps)


def least_of(t: Floats, y: Floats) -> float:
    """An acceleration that only an impact has here, m/s^2: a part of the largest, above the noise."""
    if len(t) < 3:
        return np.inf
    acceleration = np.diff(np.diff(y) / np.diff(t)) / np.diff(0.5 * (t[1:] + t[:-1]))
    noise = 1.4826 * float(np.median(np.abs(acceleration - np.median(acceleration))))
    return max(PART * float(np.max(acceleration, initial=0.0)), CLEAR * noise)


def matched(one: Impacts, other: Impacts) -> tuple[Floats, Floats]:
    """Offsets in time (k,), s, and in the change of rate (k,), m/s, of impacts that belong together."""
    if not len(one.t) or not len(other.t):
        return np.zeros(0), np.zeros(0)
    apart = other.t[None, :] - one.t[:, None]
    nearest, back = np.argmin(np.abs(apart), axis=1), np.argmin(np.abs(apart), axis=0)
    own = np.flatnonzero(back[nearest] == np.arange(len(one.t)))
    own = own[np.abs(apart[own, nearest[own]]) <= TOGETHER]
    return apart[own, nearest[own]], other.jump[nearest[own]] - one.jump[own]


def rates_by_fit(t: Floats, y: Floats, rows: Rows | None = None) -> Floats:
    """Rates (m, k) of samples y (n, k) at times t (n,), at some rows or at all, by polynomials that cross no impact.

    Zeros where there is one sample alone.
    """
    rows = np.arange(len(t)) if rows is None else rows
    found = np.zeros((len(rows), y.shape[1]))
    noise = np.array([noise_level(column) for column in y.T])
    noise = np.maximum(noise, SMALLEST * np.maximum(np.max(np.abs(y), axis=0), 1e-300))
    left = np.full(len(rows), np.inf)
    for width, degree in WIDTHS:
        if width > len(t):
            continue
        for place in _places(width):
            open_ = np.flatnonzero(left > 1.0)
            for part in np.array_split(open_, max(1, -(-len(open_) // (2 * CHUNK)))):
                if not len(part):
                    continue
                rate, off = _fitted(t, y, rows[part], width, degree, place, noise)
                better = off < left[part]
                found[part[better]], left[part[better]] = rate[better], off[better]
    return found


def _places(width: int) -> Rows:
    """Where in a stretch the instant may stand: the middle first, then ever nearer to the ends."""
    at = np.unique(np.round(np.linspace(0, width - 1, PLACES + 1)).astype(np.int64))
    return np.asarray(at[np.argsort(np.abs(at - (width - 1) / 2), kind="stable")])


def _fitted(
    t: Floats, y: Floats, rows: Rows, width: int, degree: int, place: int, noise: Floats
) -> tuple[Floats, Floats]:  # fmt: skip
    """Rates (m, k) of polynomials, and how much more than noise they leave (m,): at most 1 if they fit."""
    at, span, powers, inverse, which = _polynomials(t, rows, place, width, degree)
    coefficients = np.einsum("nij,njk->nik", inverse[which], y[at])
    off = (y[at] - np.einsum("nji,nik->njk", powers[which], coefficients)) / noise
    large = np.max(np.sum(off**2, axis=1), axis=1) / stats.chi2.isf(LEVEL, max(width - degree - 1, 1))
    return coefficients[:, 1] / span[:, None], np.maximum(large, np.max(np.abs(off), axis=(1, 2)) / WORST)


def _polynomials(
    t: Floats, rows: Rows, place: int, width: int, degree: int
) -> tuple[Rows, Floats, Floats, Floats, Rows]:
    """Samples of the polynomial of every row (m, w) and their span (m,), s; powers, their inverses, and whose they are.

    Equidistant samples have few different windows: those at the ends and one for all between.
    """
    at: Rows = np.clip(rows - place, 0, len(t) - width)[:, None] + np.arange(width)
    span: Floats = t[at[:, -1]] - t[at[:, 0]]
    kinds, which = np.unique(np.round((t[at] - t[rows, None]) / span[:, None], 9), axis=0, return_inverse=True)
    powers: Floats = kinds[:, :, None] ** np.arange(degree + 1)
    inverse: Floats = np.asarray(np.linalg.pinv(powers), np.float64)
    return at, span, powers, inverse, np.asarray(which.ravel(), np.int64)


def derivatives(
    t: Floats, y: Floats, half: int = HALF, degree: int = DEGREE, rows: Rows | None = None
) -> tuple[Floats, Floats, Floats, Floats]:
    """Smoothed value, rate and acceleration of samples, and how noise goes into the acceleration.

    A polynomial is fitted by least squares to 2 half + 1 samples around each (fewer at the ends, where
    it stands aside of the middle), at their own times (Savitzky and Golay 1964 for equidistant ones).

    Args:
        t: times (n,), s.
        y: samples (n, k).
        half: samples on each side.
        degree: of the polynomial.
        rows: at which samples (m,); all if not given.

    Returns:
        value, rate, acceleration (m, k), and gain (m, 3): standard deviations of the three for
            unit white noise.
    """
    n, width = len(t), 2 * half + 1
    if n < width or width <= degree + 2:
        raise InvalidValue(f"{n} samples are too few for a polynomial of degree {degree} through {width} of them.")
    wanted = np.arange(n) if rows is None else rows
    at, span, weights = _weights(t, half, degree, wanted)
    found = np.einsum("nij,njk->nik", weights, y[at])
    scale = np.stack([np.ones(len(wanted)), 1.0 / span, 2.0 / span**2], axis=1)
    gain: Floats = np.linalg.norm(weights, axis=2) * scale
    value, rate, acceleration = (found * scale[:, :, None]).transpose(1, 0, 2)
    return value, rate, acceleration, gain


def _weights(t: Floats, half: int, degree: int, rows: Rows) -> tuple[Rows, Floats, Floats]:
    """Samples of every polynomial (m, w), their span (m,), s, and their map to coefficients (m, 3, w)."""
    at, span, _, inverse, which = _polynomials(t, rows, half, 2 * half + 1, degree)
    return at, span, inverse[:, :3, :][which]


def felt(t: Floats, u: Floats, delay: float, half: int, degree: int, rows: Rows) -> Floats:
    """What of a held input the acceleration of `derivatives` shows (m, k).

    The fitted acceleration sum w_k y_k is a mean of the true one with the weight that integrates
    w twice (Peano's kernel); a_j from t_j to t_(j+1) adds (x_+(t_j)^2 - x_+(t_(j+1))^2)/2 to y_k,
    with x(t) = t_k - delay - t.

    Args:
        t: times (n,), s.
        u: inputs (n, k), in force from each time to the next.
        delay: of the samples, s.
        half: of the polynomials.
        degree: of the polynomials.
        rows: samples (m,).
    """
    found = np.empty((len(rows), u.shape[1]))
    reach = int(np.ceil(abs(delay) / np.median(np.diff(t)))) + 1
    for begin in range(0, len(rows), CHUNK):
        part = slice(begin, begin + CHUNK)
        at, span, weights = _weights(t, half, degree, rows[part])
        w = weights[:, 2] * (2.0 / span**2)[:, None]
        edges = np.clip(at[:, :1] + np.arange(-reach, at.shape[1] + reach + 1), 0, len(t) - 1)
        seen = t[at] - delay
        begins = np.maximum(t[edges], seen[:, :1])
        x = np.maximum(seen[:, :, None] - begins[:, None, :], 0.0) ** 2
        kernel = 0.5 * np.einsum("nk,nkj->nj", w, x[:, :, :-1] - x[:, :, 1:])
        found[part] = np.einsum("nj,njk->nk", kernel, u[edges[:, :-1]])
    return found
