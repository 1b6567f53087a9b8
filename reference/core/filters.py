"""Which rows and guards may switch in a step, by bounds from what its stages have evaluated anyway."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core import bogacki, dop853_table, esdirk
from crossbody.reference.core.algebra import inverse_diagonal
from crossbody.reference.core.friction import HOLDS_ON, ask, is_dry, slip_along
from crossbody.reference.core.layout import (
    BETWEEN,
    COLLISION,
    CONTACT,
    EXACT,
    EXPLICIT,
    FREE,
    HANDOVER_PART,
    IMPLICIT,
    LEVEL,
    NODES,
    SHORT,
    SLIP,
    STICK,
    Model,
    Work,
)
from crossbody.reference.kinds import Bytes, Floats2

# What values at the stages say about the whole step (linear programming over all polynomials of a degree).
STAGES_RANGE = 1.7  # degree 6 within a range at the stages of DOP853: how many times the range it may leave it by
STAGES_OFF = 4.0  # the same, of what is off a parabola: 3.02 for degree 6, of ESDIRK 1.98 for degree 4
TURNS = 2.0  # times by which (G^-1)_ii may change in a step
CLEAR = 5.5  # of five values: one whose least is so many times their range passes the parabola's test, any way they lie
GAPS_OFF = 0.2  # twice the most that x^2 (1 - x)^2 times a parabola of 1 at the three stages comes to


@compiled
def _stays_clear(start: float, middle: float, end: float, place: float, off: float) -> bool:
    """Whether a function is positive in the step: the parabola through three of its values, less what it may be off."""
    turn = (middle - (1.0 - place) ** 2 * start - place**2 * end) / (2.0 * place * (1.0 - place))
    least, bend = min(start, end), start - 2.0 * turn + end
    if turn < least and bend > 0.0:
        least = start - (turn - start) ** 2 / bend if 0.0 <= start - turn <= bend else turn
    return bool(least > STAGES_OFF * off)


@compiled
def _range(s: Any, start: float, end: float, at: Floats2, i: int) -> tuple[float, float]:
    """Least and largest value of what belongs to row i, at both ends and as it was kept at the stages."""
    low, high = min(start, end), max(start, end)
    for stage in range(1, s.end):
        low, high = min(low, at[stage, i]), max(high, at[stage, i])
    return float(low), float(high)


@compiled
def _multiplier_range(s: Any, w: Work, i: int) -> tuple[float, float]:
    """Least and largest multiplier of an active row at the stages and at both ends."""
    return _range(s, w.lams[0, i], w.lams[NODES - 1, i], w.lam_at, i)


@compiled
def _stays_positive(s: Any, start: float, end: float, at: Floats2, i: int) -> bool:
    """Whether what belongs to row i stays positive, as far as both ends and the stages tell."""
    middle = 9 if s.method == EXPLICIT else 1
    low, high = _range(s, start, end, at, i)
    if not low > 0.0 or low > STAGES_RANGE * (high - low):
        return bool(low > 0.0)
    off, half = 0.0, at[middle, i]
    for stage in range(1, s.end):
        c = stage_place(s, stage)
        off = max(off, abs(at[stage, i] - _parabola(start, half, end, stage_place(s, middle), c)))
    return _stays_clear(start, half, end, stage_place(s, middle), off)


@compiled
def _presses_on(s: Any, w: Work, i: int) -> bool:
    """Whether the multiplier of an active row stays positive, as far as the stages tell."""
    return _stays_positive(s, w.lams[0, i], w.lams[NODES - 1, i], w.lam_at, i)


@compiled
def _slides_on(s: Any, m: Model, w: Work, i: int) -> bool:
    """Whether a slip stays clear of zero along its direction of reference, as far as the stages tell."""
    start, end = slip_along(m, w, i, w.rates[0]), slip_along(m, w, i, w.rates[NODES - 1])
    return _stays_positive(s, start, end, w.slip_at, i)


@compiled
def _stays_elastic(s: Any, w: Work, i: int) -> bool:
    """Whether a COLLISION cannot hand over in the step: what moves its gap outweighs its multiplier at the step's end.

    h'' + b1 h' + b0 h = 0 only takes from h'^2 + b0 h^2, so that the elastic part of the multiplier, at least
    sqrt(b0) |h'| + b0 |h|, is nowhere below sqrt(b0) times the root of its last value. (G^-1)_ii is that of the end.
    """
    if s.has_solve or w.law[i, 2] != 0.0:
        return False
    last, b0 = NODES - 1, w.law[i, 0]
    elastic = np.sqrt(b0 * (w.rates[last, i] ** 2 + b0 * w.gaps[last, i] ** 2))
    low, high = _multiplier_range(s, w, i)
    most = high + STAGES_RANGE * (high - low)
    for j in range(s.na):
        if w.idx[j] == i:
            return bool(elastic * inverse_diagonal(w.G, s.na, w.reach, j, w.scale) > TURNS * HANDOVER_PART * most)
    return False


@compiled
def _parabola(start: float, middle: float, end: float, place: float, c: float) -> float:
    """Value at c of the parabola through three values, of which the second stands at `place`."""
    return float(
        start * (c - place) * (c - 1.0) / place
        + middle * c * (c - 1.0) / (place * (place - 1.0))
        + end * c * (c - place) / (1.0 - place)
    )


@compiled
def stage_place(s: Any, stage: int) -> float:
    """Where a stage of the method stands in the step."""
    if s.method == EXPLICIT:
        return float(dop853_table.C[stage])
    return float(esdirk.C[stage]) if s.method == IMPLICIT else float(bogacki.C[stage])


@compiled
def _between(s: Any, place: int) -> float:
    """Where the stage stands at which gaps and guards were looked at."""
    if s.method == EXPLICIT:
        return stage_place(s, 4 * place + 4 - 2 * (place // 2))
    return stage_place(s, place + 2)


@compiled
def _stays_open(s: Any, w: Work, i: int) -> bool:
    """Whether a gap stays positive: the cubic through its ends and slopes, less what three stages are off it.

    What is off is x^2 (1 - x)^2 times a parabola, if the gap has degree six.
    """
    last = NODES - 1
    h0, h1 = w.gaps[0, i], w.gaps[last, i]
    c0, c1 = h0 + s.hs / 3.0 * w.rates[0, i], h1 - s.hs / 3.0 * w.rates[last, i]
    low = min(h0, h1, c0, c1)
    if not low > 0.0 or s.method == SHORT:
        return bool(low > max(h0, h1, c0, c1) - low)
    off = 0.0
    for place in range(BETWEEN):
        c = _between(s, place)
        d = 1.0 - c
        cubic = d * d * (d * h0 + 3.0 * c * c0) + c * c * (3.0 * d * c1 + c * h1)
        off = max(off, abs(w.gap_at[place, i] - cubic) / (c * d) ** 2)
    return bool(low > GAPS_OFF * off)


@compiled
def row_may_switch(s: Any, m: Model, w: Work, mode: Bytes, i: int) -> bool:
    """Whether a row may switch in this step, by bounds from what the stages have evaluated anyway."""
    if s.method == EXACT or s.fsm != LEVEL:
        return True
    if mode[i] == FREE:
        return not _stays_open(s, w, i)
    if mode[i] == COLLISION:
        return not (_presses_on(s, w, i) and _stays_elastic(s, w, i))
    if mode[i] == STICK:
        return not ((is_dry(m, i) or _presses_on(s, w, i)) and ask(HOLDS_ON, s, m, w, i) > 0.0)
    if mode[i] == SLIP:  # near a jam its multiplier may grow without bound, but need not
        return s.jammed or not ((is_dry(m, i) or _presses_on(s, w, i)) and _slides_on(s, m, w, i))
    return mode[i] != CONTACT or not _presses_on(s, w, i)


@compiled
def switch_may_fire(s: Any, w: Work, i: int) -> bool:
    """Whether the guard of a discrete variable may fire in this step."""
    if s.method == EXACT:
        return True
    start, end = w.guards[0, i], w.guards[NODES - 1, i]
    if s.method == SHORT:
        return not min(start, end) > abs(end - start)
    low, high = min(start, end), max(start, end)
    for place in range(BETWEEN):
        low, high = min(low, w.guard_at[place, i]), max(high, w.guard_at[place, i])
    if low > CLEAR * (high - low):
        return False
    off, half, middle = 0.0, w.guard_at[1, i], _between(s, 1)
    for place in range(BETWEEN):
        off = max(off, abs(w.guard_at[place, i] - _parabola(start, half, end, middle, _between(s, place))))
    return not _stays_clear(start, half, end, middle, off)
