"""Bounds on a function in an interval from its values at five places.

A function f is known at five evenly spaced places of an interval; P is the polynomial of degree four through them and

    f = P + g W,    W(x) = x (x - 1/4) (x - 1/2) (x - 3/4) (x - 1)

with g a fifth divided difference. P in Bernstein form, raised to degree five, less and plus |g| times that of W,
encloses f; W vanishes at both ends, so a function that rises from zero is bounded as well. g is

    of a gap          known at the five places, where P' is compared with the rate; twice the largest bounds it for
                      degree seven, which a gap that is linear in q has on the dense output
    of a rate         known on the whole step, where the integral of P from place to place is compared with the gap
    of anything else  estimated on the whole step by the decay of P's Chebyshev coefficients
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.layout import FUNCTIONS_MOST, NODES
from crossbody.reference.kinds import Array

_PLACES = np.linspace(0.0, 1.0, NODES)
_POWERS = np.linalg.inv(np.vander(_PLACES, increasing=True))  # values to coefficients of P


def _bernstein(degree: int, raised: int) -> np.ndarray[Any, Any]:
    """Coefficients of powers up to `degree` to Bernstein coefficients of degree `raised`."""
    from math import comb

    return np.array(
        [[comb(k, j) / comb(raised, j) if j <= k else 0.0 for j in range(degree + 1)] for k in range(raised + 1)]
    )


HULL = _bernstein(NODES - 1, NODES) @ _POWERS
W_HULL = np.abs(_bernstein(NODES, NODES) @ np.poly(_PLACES)[::-1])
W_MOST = 0.00355  # largest |W|
_NEW = np.array([1.0, 3.0, 5.0, 7.0]) / 8.0  # places that the halves add
BETWEEN = np.vander(_NEW, NODES, increasing=True) @ _POWERS
W_BETWEEN = np.array([float(np.prod(x - _PLACES)) for x in _NEW])
SLOPES = np.array([[k * x ** (k - 1) if k else 0.0 for k in range(NODES)] for x in _PLACES]) @ _POWERS
INTEGRALS = np.diff([[x ** (k + 1) / (k + 1) for k in range(NODES)] for x in _PLACES], axis=0) @ _POWERS
W_INTEGRALS = np.diff(np.polyval(np.polyint(np.poly(_PLACES)), _PLACES))
W_SLOPES = np.array([float(np.prod((x - _PLACES)[x != _PLACES])) for x in _PLACES])
CHEBYSHEV = np.linalg.inv(np.polynomial.chebyshev.chebvander(2.0 * _PLACES - 1.0, NODES - 1))[3:]
FIFTH = 512.0  # leading coefficient of T5(2 x - 1)

ABOVE, BELOW, FALLS, MIXED = 0, 1, 2, 3
NOWHERE, HERE, HALVE = 0, 1, 2
SAFETY = 2.0  # on a measured g
BOUNDS = FUNCTIONS_MOST * NODES  # where in a line of the window they stand,
MEASURED = BOUNDS + FUNCTIONS_MOST  # the g that was measured at the line's new places,
BESIDE = MEASURED + FUNCTIONS_MOST  # and beside a gap its slopes, beside the rate of a catch the gap


@compiled
def sign(row: Array, j: int) -> int:
    """How function j of an interval lies to zero, as far as its bounds tell.

    Of one that falls through it one coefficient at most may be open, and only if it is below the one before for sure:
    g is none of a polynomial's, so that what it leaves open may rise again.
    """
    at = j * NODES
    g = row[BOUNDS + j]
    fallen, again, lowest, highest, before = 0, False, 0, 0, np.inf
    for k in range(NODES + 1):
        value = 0.0
        for c in range(NODES):
            value += HULL[k, c] * row[at + c]
        margin = g * W_HULL[k]
        low, high = value - margin >= 0.0, value + margin <= 0.0
        lowest += low
        highest += high
        if not low:
            fallen += 1
        open_ = not (low or high) and (fallen > 1 or value + margin > before)
        again = again or (fallen > 0 and low) or open_
        before = value + margin
    if lowest == NODES + 1:
        return ABOVE
    if highest == NODES + 1:
        return BELOW
    return FALLS if not again and row[at] >= 0.0 > row[at + NODES - 1] else MIXED


@compiled
def judge(row: Array, count: int) -> int:
    """Whether the interval holds the event, cannot, or must be halved."""
    sure = True
    for j in range(count):
        lies = sign(row, j)
        if lies == ABOVE:
            return NOWHERE
        sure = sure and lies != MIXED
    return HERE if sure else HALVE


@compiled
def decay(row: Array, at: int) -> float:
    """A bound on g from the last two Chebyshev coefficients of P."""
    third, fourth = 0.0, 0.0
    for c in range(NODES):
        third += CHEBYSHEV[0, c] * row[at + c]
        fourth += CHEBYSHEV[1, c] * row[at + c]
    return float(FIFTH * max(0.5 * abs(fourth), 0.125 * abs(third)))


@compiled
def from_slopes(row: Array) -> float:
    """A bound on g of a gap from its slopes at the five places."""
    most = 0.0
    for k in range(NODES):
        slope = 0.0
        for c in range(NODES):
            slope += SLOPES[k, c] * row[c]
        most = max(most, abs((row[BESIDE + k] - slope) / W_SLOPES[k]))
    return float(SAFETY * most)


@compiled
def from_gaps(row: Array, rate: int, gap: int, width: float, band: float) -> float:
    """A bound on g of a rate that stands at `rate` from what the gap, which stands at `gap`, gains between places.

    `band` is what was added to the rate, which its gap knows nothing of.
    """
    most = 0.0
    for k in range(NODES - 1):
        gain = (row[gap + k + 1] - row[gap + k]) / width + band / (NODES - 1)
        for c in range(NODES):
            gain -= INTEGRALS[k, c] * row[rate + c]
        most = max(most, abs(gain / W_INTEGRALS[k]))
    return float(SAFETY * most)
