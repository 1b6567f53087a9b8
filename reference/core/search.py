"""First place of a step where every function of a guard is below zero, by bounds instead of samples.

A function f is known at five evenly spaced places of an interval; P is the polynomial of degree four through them and

    f = P + g W,    W(x) = x (x - 1/4) (x - 1/2) (x - 3/4) (x - 1)

with g a fifth divided difference. P in Bernstein form, raised to degree five, less and plus |g| times that of W,
encloses f; W vanishes at both ends, so a function that rises from zero is bounded as well. g is

    of a gap          known at the five places, where P' is compared with the rate; twice the largest bounds it for
                      degree seven, which a gap that is linear in q has on the dense output
    of anything else  estimated by the decay of P's Chebyshev coefficients on the whole step, and in a half by what was
                      measured at its new places and how that has shrunk since the halving before

An interval is halved as long as its bounds allow both. It is left as soon as one function is bounded from below by
zero; it holds the event if each function is below zero throughout or falls through zero once (its coefficients change
sign once). Where the bounds are as close as rounding the polynomial is the function, and halving it evaluates nothing
more: a pass closer than that is not decided.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference._cache import compiled, inlined
from crossbody.reference._kinds import Array, Bytes
from crossbody.reference.core.algebra import ULP, all_finite
from crossbody.reference.core.guards import CATCH, FUNCTIONS, SWITCH, fill_step, functions, largest, root
from crossbody.reference.core.layout import FUNCTIONS_MOST, MEMORYLESS, NEVER, NODES, WINDOW_LEVELS, Model, Work

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
W_SLOPES = np.array([float(np.prod((x - _PLACES)[x != _PLACES])) for x in _PLACES])
CHEBYSHEV = np.linalg.inv(np.polynomial.chebyshev.chebvander(2.0 * _PLACES - 1.0, NODES - 1))[3:]
FIFTH = 512.0  # leading coefficient of T5(2 x - 1)

ABOVE, BELOW, FALLS, MIXED = 0, 1, 2, 3
NOWHERE, HERE, HALVE = 0, 1, 2
SAFETY = 2.0  # on a measured g
FIRST = 0.125  # part of g that is left in the first halves; then what was left before, but at least
LEFT = 0.5**NODES  # what is left of it where the function is smooth
BOUNDS = FUNCTIONS_MOST * NODES  # where in a line of the window they stand,
MEASURED = BOUNDS + FUNCTIONS_MOST  # the g that was measured at the line's new places,
RISES = MEASURED + FUNCTIONS_MOST  # and the slopes of a gap
INTERVALS = 2000  # of one search; then halving ends, and places decide


@inlined
def _sign(row: Array, j: int) -> int:
    """How function j of an interval lies to zero, as far as its bounds tell."""
    at = j * NODES
    g = row[BOUNDS + j]
    fallen, again, lowest, highest = 0, False, 0, 0
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
        again = again or (fallen > 0 and low) or (fallen > 1 and not high)  # one coefficient at most may be open
    if lowest == NODES + 1:
        return ABOVE
    if highest == NODES + 1:
        return BELOW
    return FALLS if not again and row[at] >= 0.0 > row[at + NODES - 1] else MIXED


@compiled
def _judge(row: Array, count: int) -> int:
    """Whether the interval holds the event, cannot, or must be halved."""
    sure = True
    for j in range(count):
        sign = _sign(row, j)
        if sign == ABOVE:
            return NOWHERE
        sure = sure and sign != MIXED
    return HERE if sure else HALVE


@inlined
def _decay(row: Array, at: int) -> float:
    """A bound on g from the last two Chebyshev coefficients of P."""
    third, fourth = 0.0, 0.0
    for c in range(NODES):
        third += CHEBYSHEV[0, c] * row[at + c]
        fourth += CHEBYSHEV[1, c] * row[at + c]
    return float(FIFTH * max(0.5 * abs(fourth), 0.125 * abs(third)))


@inlined
def _from_slopes(row: Array) -> float:
    """A bound on g of a gap from its slopes at the five places."""
    most = 0.0
    for k in range(NODES):
        slope = 0.0
        for c in range(NODES):
            slope += SLOPES[k, c] * row[c]
        most = max(most, abs((row[RISES + k] - slope) / W_SLOPES[k]))
    return float(SAFETY * most)


@inlined
def _bound(w: Work, row: Array, j: int, g: float) -> None:
    """Keep the bound on g of function j; none where it is rounding."""
    row[BOUNDS + j] = 0.0 if g * W_MOST <= w.tiny[j] else g


@inlined
def _start(K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, count: int) -> float:
    """The whole step: values at its nodes, bounds on g, what is taken for zero; the factor of the gap's rate."""
    row = w.window[0]
    scale = fill_step(K, s, m, w, mode, kind, i, row)
    for c in range(NODES):
        row[RISES + c] = scale * w.rates[c, i]
    for j in range(count):
        at, most = j * NODES, 0.0
        for c in range(NODES):
            most = max(most, abs(row[at + c]))
        w.tiny[j] = max(8.0 * ULP * most, w.tiny[j])
        row[MEASURED + j] = 0.0
        _bound(w, row, j, _from_slopes(row) if scale != 0.0 and j == 0 else _decay(row, at))
    return scale


@inlined
def _opens(s: Any, w: Work, i: int) -> bool:
    """Whether a gap opens throughout the step, so that it cannot be caught: known from the rates alone."""
    row = w.window[0]
    for c in range(NODES):
        row[c] = w.rates[c, i]
    row[BOUNDS] = _decay(row, 0)
    return _sign(row, 0) == ABOVE


@inlined
def _inherit(parent: Array, row: Array, half: int, count: int) -> bool:
    """Take over what the interval around knows of a half; whether its polynomials are the functions."""
    known = True
    for j in range(count):
        known = known and parent[BOUNDS + j] == 0.0
        row[MEASURED + j] = 0.0
        for c in range(3):
            row[j * NODES + 2 * c] = parent[j * NODES + 2 * half + c]
    for c in range(3):
        row[RISES + 2 * c] = 0.5 * parent[RISES + 2 * half + c]
    return known


@inlined
def _halve(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, count: int, level: int, place: int, scale: float
) -> None:  # fmt: skip
    """Interval `place` of 2^level from the one around it: two new places.

    How g shrinks is measured as well, since a function may be sharper than the step shows; of a gap the slopes tell.
    """
    parent, row, half = w.window[level - 1], w.window[level], place % 2
    known = _inherit(parent, row, half, count)
    for c in range(2):
        at = 2 * half + c
        if not known:
            functions(K, s, m, w, mode, kind, i, (place + 0.25 + 0.5 * c) * 0.5**level)
            row[RISES + 1 + 2 * c] = scale * 0.5**level * w.rate[i] if scale != 0.0 else 0.0
        for j in range(count):
            value = 0.0
            for b in range(NODES):
                value += BETWEEN[at, b] * parent[j * NODES + b]
            if not known:
                row[MEASURED + j] = max(row[MEASURED + j], abs((w.parts[j] - value) / W_BETWEEN[at]))
                value = w.parts[j]
            row[j * NODES + 1 + 2 * c] = value
    for j in range(count):
        left, before = FIRST, parent[MEASURED + j]
        if before > 0.0:
            left = min(max(row[MEASURED + j] / before, LEFT), 1.0)
        g = _from_slopes(row) if scale != 0.0 and j == 0 else SAFETY * left * row[MEASURED + j]
        _bound(w, row, j, 0.0 if known else g)


@inlined
def _locate(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, count: int, level: int, place: int, above: bool
) -> float:  # fmt: skip
    """The event in an interval that holds it; NEVER if the guard itself, evaluated there, does not fire.

    One that has not been above zero yet, as `above` says of what is before the interval, does not fire.
    """
    row = w.window[level]
    width = 0.5**level
    for c in range(NODES):
        most = -np.inf
        for j in range(count):
            most = max(most, row[j * NODES + c])
        above = above or most > 0.0
        if most < 0.0 and above:
            b = (place + 0.25 * c) * width
            functions(K, s, m, w, mode, kind, i, b)
            gb = largest(w, count)
            if not gb < 0.0:
                continue
            if c == 0:
                return b
            a = (place + 0.25 * (c - 1)) * width
            functions(K, s, m, w, mode, kind, i, a)
            return root(K, s, m, w, mode, kind, i, a, max(largest(w, count), 1e-300), b, gb)
    return NEVER


@inlined
def _at_zero(K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, count: int, found: float) -> float:
    """Where a guard that left the band of what counts as zero passed its true zero, if it came from above."""
    widest = max(w.bands[0], w.bands[1])
    if widest == 0.0 or s.fsm == MEMORYLESS:
        return found
    w.bands[:] = 0.0
    functions(K, s, m, w, mode, kind, i, 0.0)
    before = largest(w, count)
    functions(K, s, m, w, mode, kind, i, found)
    after = largest(w, count)
    if not (before > 0.0 > after):
        return found
    return root(K, s, m, w, mode, kind, i, 0.0, before, found, after)


@compiled
def first_below(K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int) -> float:
    """First place of the step where all functions of a guard are below zero; NEVER if none, NaN if one is NaN."""
    count = FUNCTIONS[kind]
    if kind == CATCH and _opens(s, w, i):
        return NEVER
    scale = _start(K, s, m, w, mode, kind, i, count)
    level, place, seen = 0, 0, 0
    above = kind != SWITCH or w.window[0, 0] > 0.0
    while True:
        seen += 1
        row = w.window[level]
        if not all_finite(row[: count * NODES]):
            return np.nan
        verdict = _judge(row, count)
        if verdict == HALVE and level < WINDOW_LEVELS - 1 and seen < INTERVALS:
            level, place = level + 1, 2 * place
        else:
            if verdict != NOWHERE:
                found = _locate(K, s, m, w, mode, kind, i, count, level, place, above)
                if found < NEVER:
                    return _at_zero(K, s, m, w, mode, kind, i, count, found)
            above = above or row[NODES - 1] > 0.0
            place += 1
            while level > 0 and place % 2 == 0:
                level, place = level - 1, place // 2
            if level == 0:
                return NEVER
        _halve(K, s, m, w, mode, kind, i, count, level, place, scale)
