"""Cubic splines through samples: as `scipy.interpolate.CubicSpline`, which takes longer to import than a run.

de Boor, A Practical Guide to Splines (1978), chapter IV: the slopes at the samples solve a tridiagonal system.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats

FEW = 48
"""Unknowns of which a system is solved as a whole."""


def spline(t: Floats, values: Floats, times: Floats) -> Floats:
    """Return a spline at other times (m, k); a parabola through three samples, a line through two.

    Args:
        t: increasing (n,), n > 1.
        values: at them (n, k).
        times: (m,); beyond the ends the first or last cubic goes on.
    """
    return through(t, values)(times)


def through(t: Floats, values: Floats) -> Callable[[Floats], Floats]:
    """Return the same spline as a function of times, whose cubics are found once."""
    h, slopes, rest, bend = _cubics(t, values)

    def at(times: Floats) -> Floats:
        i = _step(t, times)
        s = (times - t[i])[:, None]
        x = s / h[i]
        found: Floats = values[i] + s * (slopes[i] + x * (rest[i] + x * bend[i]))
        return found

    return at


def integral(t: Floats, values: Floats, times: Floats) -> Floats:
    """Return the integral of the same spline from the first sample to other times (m, k)."""
    i, (h, slopes, rest, bend) = _step(t, times), _cubics(t, values)

    def upto(s: Floats, of: NDArray[np.intp] | slice) -> Floats:
        x = s / h[of]
        found: Floats = s * (values[:-1][of] + s * (slopes[of] / 2.0 + x * (rest[of] / 3.0 + x * bend[of] / 4.0)))
        return found

    whole = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(upto(h, slice(None)), axis=0)])
    return whole[i] + upto((times - t[i])[:, None], i)


def straight(t: Floats, values: Floats, times: Floats) -> Floats:
    """Return values (m, k) at times (m,) by straight lines between samples (n, k); k may be 0."""
    out = np.empty((len(times), values.shape[1]))
    for k, column in enumerate(values.T):
        out[:, k] = np.interp(times, t, column)
    return out


def _step(t: Floats, times: Floats) -> NDArray[np.intp]:
    """Return in which step times are (m,)."""
    return np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)


def _cubics(t: Floats, values: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return of each step length, slope, and coefficients of its square and cube."""
    h = np.diff(t)[:, None]
    chord = np.diff(values, axis=0) / h
    slopes = _slopes(t, values) if len(t) > 2 else np.repeat(chord, 2, axis=0)
    bend = slopes[:-1] + slopes[1:] - 2.0 * chord
    return h, slopes[:-1], chord - slopes[:-1] - bend, bend


def _slopes(t: Floats, values: Floats) -> Floats:
    """Return the slopes (n, k) by which second derivatives have no jump, nor third ones next to the ends."""
    h = np.diff(t)
    chords = np.diff(values, axis=0) / h[:, None]
    if len(t) == 3:
        bend = (chords[1] - chords[0]) / (t[2] - t[0])
        return np.stack([chords[0] - h[0] * bend, chords[0] + h[0] * bend, chords[1] + h[1] * bend])
    lower, diagonal, upper = h[1:], 2.0 * (h[:-1] + h[1:]), h[:-1]
    right = 3.0 * (lower[:, None] * chords[:-1] + upper[:, None] * chords[1:])
    ends = []  # h_far slope + both next_slope = known, which is taken from the equation of the next slope
    for near, far in ((0, 1), (-1, -2)):
        both = h[near] + h[far]
        known = ((h[near] + 2.0 * both) * h[far] * chords[near] + h[near] ** 2 * chords[far]) / both
        diagonal[near] -= both
        right[near] -= known
        ends.append((known, both, h[far]))
    inner = _tridiagonal(lower, diagonal, upper, right)
    first, last = ((known - both * inner[k]) / far for k, (known, both, far) in zip((0, -1), ends, strict=True))
    return np.concatenate([first[None], inner, last[None]])


def _tridiagonal(lower: Floats, diagonal: Floats, upper: Floats, right: Floats) -> Floats:
    """Solve l[i] x[i - 1] + d[i] x[i] + u[i] x[i + 1] = r[i] (n, k) by taking every other unknown away at once.

    Odd-even reduction (Golub and Van Loan, Matrix Computations, 4.5.4), stable where the diagonal outweighs its row.
    """
    n = len(diagonal)
    if n <= FEW:
        whole = np.diag(diagonal) + np.diag(lower[1:], -1) + np.diag(upper[:-1], 1)
        return np.asarray(np.linalg.solve(whole, right))
    odd = np.arange(1, n, 2)
    even = np.arange(0, n, 2)
    before, behind = np.zeros(len(even)), np.zeros(len(even))  # of each even row, times its odd neighbours
    before[1:] = lower[even[1:]] / diagonal[even[1:] - 1]
    has = even + 1 < n
    behind[has] = upper[even[has]] / diagonal[even[has] + 1]
    first, last = np.maximum(even - 1, 0), np.minimum(even + 1, n - 1)
    small = _tridiagonal(
        -before * lower[first],
        diagonal[even] - before * upper[first] - behind * lower[last],
        -behind * upper[last],
        right[even] - before[:, None] * right[first] - behind[:, None] * right[last],
    )
    found = np.empty_like(right)
    found[even] = small
    next_even = np.minimum(odd + 1, n - 1)
    beyond = np.where(odd + 1 < n, upper[odd], 0.0)[:, None] * found[next_even]
    found[odd] = (right[odd] - lower[odd, None] * found[odd - 1] - beyond) / diagonal[odd, None]
    return found
