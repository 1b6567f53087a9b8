"""Rates and accelerations of sampled coordinates, by a polynomial through the samples around each instant."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import InvalidValue
from crossbody.hw.windows.smooth_rates import smooth_rates

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]
HALF = 25
"""Samples on each side."""
CHUNK = 2000
DEGREE = 3


def rates_by_fit(t: Floats, y: Floats, rows: Rows | None = None) -> Floats:
    """Rates (m, k) of samples y (n, k) at times t (n,), at some rows or at all, by polynomials that cross no impact.

    Zeros for a record too short.
    """
    return smooth_rates(t, y, np.arange(len(t)) if rows is None else rows)


def derivatives(
    t: Floats, y: Floats, half: int = HALF, degree: int = DEGREE, rows: Rows | None = None
) -> tuple[Floats, Floats, Floats, Floats]:
    """Smoothed value, rate and acceleration of samples, and how noise goes into the acceleration.

    A polynomial is fitted by least squares to 2 half + 1 samples around each (fewer at the ends, where it stands
    aside of the middle), at their own times (Savitzky and Golay 1964 for equidistant ones).

    Args:
        t: times (n,), s.
        y: samples (n, k).
        half: samples on each side.
        degree: of the polynomial.
        rows: at which samples (m,); all if not given.

    Returns:
        value, rate, acceleration (m, k), and gain (m, 3): standard deviations of the three for unit white noise.

    Raises:
        InvalidValue: if there are too few samples for the polynomial.
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
    """Samples of every polynomial (m, w), their span (m,), s, and what makes coefficients of them (m, 3, w)."""
    width = 2 * half + 1
    first = np.clip(rows - half, 0, len(t) - width)
    at = first[:, None] + np.arange(width)
    span = t[at[:, -1]] - t[at[:, 0]]
    x = (t[at] - t[rows, None]) / span[:, None]
    # Equidistant samples have few different windows: those at the ends and one for all between.
    kinds, which = np.unique(np.round(x, 9), axis=0, return_inverse=True)
    weights = np.linalg.pinv(kinds[:, :, None] ** np.arange(degree + 1))[:, :3, :][which.ravel()]
    return at, span, weights


def felt(t: Floats, u: Floats, delay: float, half: int, degree: int, rows: Rows) -> Floats:
    """What of a held input the acceleration of `derivatives` shows (m, k).

    The fitted acceleration sum w_k y_k is a mean of the true one with the weight that integrates w twice (Peano's
    kernel); a_j from t_j to t_(j+1) adds (x_+(t_j)^2 - x_+(t_(j+1))^2)/2 to y_k, with x(t) = t_k - delay - t.

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
