"""First place of a step where every function of a guard is below zero, by bounds instead of samples.

Each function is enclosed in an interval by what `enclosure` knows of it there; g, the bound on its rest, is in a half
estimated by what was measured at its new places and how that has shrunk since the halving before.

An interval is halved as long as its bounds allow both. It is left as soon as one function is bounded from below by
zero; it holds the event if each function is below zero throughout or falls through zero once (its coefficients change
sign once). Where the bounds are as close as rounding the polynomial is the function, and halving it evaluates nothing
more: a pass closer than that is not decided.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.algebra import ULP, all_finite
from crossbody.reference.core.enclosure import (
    ABOVE,
    BESIDE,
    BETWEEN,
    BOUNDS,
    HALVE,
    HERE,
    HULL,
    MEASURED,
    NOWHERE,
    SAFETY,
    W_BETWEEN,
    W_HULL,
    W_MOST,
    decay,
    from_gaps,
    from_slopes,
    judge,
    sign,
)
from crossbody.reference.core.guards import (
    CATCH,
    FUNCTIONS,
    RELEASE,
    SWITCH,
    TOUCH_INSIDE,
    fill_step,
    functions,
    largest,
    root,
)
from crossbody.reference.core.layout import MEMORYLESS, NEVER, NODES, WINDOW_LEVELS, Model, Work
from crossbody.reference.kinds import Array, Bytes

FIRST = 0.125  # part of g that is left in the first halves; then what was left before, but at least
LEFT = 0.5**NODES  # what is left of it where the function is smooth
GAP_LEVELS = 4  # halvings down to which a rate is held against its gap; below, what the step may be off by counts
LOOKED = 1  # halvings before a gap is believed: in a long step its slopes may fit, and it be sharp between the places
INTERVALS = 2000  # of one search; then halving ends, and places decide


@compiled
def _bound(w: Work, row: Array, j: int, g: float) -> None:
    """Keep the bound on g of function j; none where it is rounding."""
    row[BOUNDS + j] = 0.0 if g * W_MOST <= w.tiny[j] else g


@compiled
def _from_its_gap(w: Work, row: Array, kind: int, j: int, width: float) -> float:
    """A bound on g of function j if it is the rate of a gap that stands in the line as well, else 0."""
    if kind == CATCH and j == 0:
        return from_gaps(row, 0, BESIDE, width, w.bands[0])
    return from_gaps(row, NODES, 0, width, w.bands[1]) if kind == TOUCH_INSIDE and j == 1 else 0.0


@compiled
def _highest(row: Array, count: int) -> int:
    """The function whose least value at the places is the largest: the first that may be bounded from below by zero."""
    best, most = 0, -np.inf
    for j in range(count):
        least = row[j * NODES]
        for c in range(1, NODES):
            least = min(least, row[j * NODES + c])
        if least > most:
            best, most = j, least
    return best


@compiled
def _start(K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, count: int) -> tuple[float, bool]:
    """The whole step: values at its nodes, bounds on g, what is taken for zero.

    Returns:
        The factor of the gap's rate; whether a function is positive all along, so that the others were not looked at.
    """
    row = w.window[0]
    scale = fill_step(K, s, m, w, mode, kind, i, row)
    for c in range(NODES):
        row[BESIDE + c] = w.gaps[c, i] if kind == CATCH else scale * w.rates[c, i]
    highest = _highest(row, count)
    for k in range(count):
        j = (highest + k) % count
        at, most = j * NODES, 0.0
        for c in range(NODES):
            most = max(most, abs(row[at + c]))
        w.tiny[j] = max(8.0 * ULP * most, w.tiny[j])
        row[MEASURED + j] = 0.0
        g = from_slopes(row) if scale != 0.0 and j == 0 else decay(row, at)
        g = max(g, _from_its_gap(w, row, kind, j, s.hs))
        _bound(w, row, j, g)
        if k == 0 and count > 1 and sign(row, j) == ABOVE:
            return scale, True
    return scale, False


@compiled
def opens(s: Any, w: Work, i: int, until: float) -> bool:
    """Whether a gap opens up to a place of the step, so that it cannot be caught before: known from the nodes alone.

    The Bernstein coefficients on the part are de Casteljau's first ones.
    """
    row, lowest = w.window[0], w.window[1]
    for c in range(NODES):
        row[c], row[BESIDE + c] = w.rates[c, i], w.gaps[c, i]
    g = max(decay(row, 0), from_gaps(row, 0, BESIDE, s.hs, 0.0))
    for k in range(NODES + 1):
        lowest[k] = -g * W_HULL[k]
        for c in range(NODES):
            lowest[k] += HULL[k, c] * row[c]
    for k in range(NODES + 1):
        if not lowest[0] >= 0.0:
            return False
        for c in range(NODES - k):
            lowest[c] += until * (lowest[c + 1] - lowest[c])
    return True


@compiled
def _inherit(parent: Array, row: Array, half: int, count: int, slopes: bool) -> bool:
    """Take over what the interval around knows of a half; whether its polynomials are the functions."""
    known = True
    for j in range(count):
        known = known and parent[BOUNDS + j] == 0.0
        row[MEASURED + j] = 0.0
        for c in range(3):
            row[j * NODES + 2 * c] = parent[j * NODES + 2 * half + c]
    for c in range(3):
        row[BESIDE + 2 * c] = (0.5 if slopes else 1.0) * parent[BESIDE + 2 * half + c]
    return known


@compiled
def _halve(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, count: int, level: int, place: int, scale: float
) -> None:  # fmt: skip
    """Interval `place` of 2^level from the one around it: two new places.

    How g shrinks is measured as well, since a function may be sharper than the step shows; of a gap the slopes tell.
    """
    parent, row, half = w.window[level - 1], w.window[level], place % 2
    known = _inherit(parent, row, half, count, kind != CATCH)
    for c in range(2):
        at = 2 * half + c
        if not known:
            functions(K, s, m, w, mode, kind, i, (place + 0.25 + 0.5 * c) * 0.5**level)
            row[BESIDE + 1 + 2 * c] = w.gap[i] if kind == CATCH else scale * 0.5**level * w.rate[i]
        for j in range(count):
            value = 0.0
            for b in range(NODES):
                value += BETWEEN[at, b] * parent[j * NODES + b]
            if not known:
                row[MEASURED + j] = max(row[MEASURED + j], abs((w.parts[j] - value) / W_BETWEEN[at]))
                value = w.parts[j]
            row[j * NODES + 1 + 2 * c] = value
    for j in range(count):
        before = parent[MEASURED + j]
        left = FIRST if row[MEASURED + j] <= parent[BOUNDS + j] else 1.0  # a bound that was broken tells nothing
        if before > 0.0:
            left = min(max(row[MEASURED + j] / before, LEFT), 1.0)
        g = from_slopes(row) if scale != 0.0 and j == 0 else SAFETY * left * row[MEASURED + j]
        if level <= GAP_LEVELS:
            g = max(g, _from_its_gap(w, row, kind, j, s.hs * 0.5**level))
        _bound(w, row, j, 0.0 if known else g)


@compiled
def _value(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, count: int, level: int, place: float, kept: float
) -> float:  # fmt: skip
    """The guard at a place of an interval; `kept` is what stands in its line.

    Of the whole step that is the guard itself, but of a multiplier, which is watched less sharply than it switches.
    """
    if level == 0 and kind != RELEASE:
        return kept
    functions(K, s, m, w, mode, kind, i, place)
    return largest(w, count)


@compiled
def _locate(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, count: int, level: int, place: int, above: bool
) -> float:  # fmt: skip
    """The event in an interval that holds it; NEVER if the guard itself, evaluated there, does not fire.

    One that has not been above zero yet, as `above` says of what is before the interval, does not fire.
    """
    row = w.window[level]
    width, before = 0.5**level, 0.0
    for c in range(NODES):
        most = -np.inf
        for j in range(count):
            most = max(most, row[j * NODES + c])
        above = above or most > 0.0
        if most < 0.0 and above:
            a, b = (place + 0.25 * (c - 1)) * width, (place + 0.25 * c) * width
            gb = _value(K, s, m, w, mode, kind, i, count, level, b, most)
            if not gb < 0.0:
                continue
            if c == 0:
                return b
            ga = _value(K, s, m, w, mode, kind, i, count, level, a, before)
            return root(K, s, m, w, mode, kind, i, a, max(ga, 1e-300), b, gb)
        before = most
    return NEVER


@compiled
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
    scale, clear = _start(K, s, m, w, mode, kind, i, count)
    if clear:
        return NEVER
    level, place, seen = 0, 0, 0
    above = kind != SWITCH or w.window[0, 0] > 0.0
    while True:
        seen += 1
        row = w.window[level]
        if not all_finite(row[: count * NODES]):
            return np.nan
        verdict = judge(row, count)
        if verdict == HERE and level < LOOKED and scale != 0.0:
            verdict = HALVE
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
