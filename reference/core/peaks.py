"""Where in a step the multiplier of a contact is largest: rows are written there, so that peaks are read off exactly.

A step's ends alone miss a peak by up to the square of the step's length: 3 % of a contact that takes four steps. Asked
is the largest multiplier of every contact, from its touch to its release: what is not above all that is written of the
contact already, by more than the tolerance, is no peak, so that what vibrates and decays costs nothing. Where to look
is told by what the stages have evaluated anyway.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core import dense
from crossbody.reference.core.acceleration import OWN, accelerate, is_active
from crossbody.reference.core.dop853 import START
from crossbody.reference.core.filters import stage_place
from crossbody.reference.core.layout import EXACT, EXPLICIT, NEVER, NODES, Model, Work
from crossbody.reference.kinds import Bytes

STRIDE = 0.12  # part of the step from a place of a search to the next
CLOSER = 8  # parabolas that close in on a peak
PROMISED = 0.01  # part of the tolerance that a parabola promises at the end: what is not even in it promises too little
NEAREST = 1e-5  # part of the step from its end up to which a peak is searched for
NUDGE = 1e-5  # part of the step along which a slope is taken
RISING = 0.25  # slope at the end, of what the step gains: a multiplier that rises faster does not turn there
NOISE = 2.0  # times by which the stages may be farther off than the last of them is off the step's end
MARGIN = 4.0  # on what a turn between the last stage and the end can come to


@compiled
def forget(s: Any, w: Work, mode: Bytes) -> None:
    """Let every row that is not active begin anew: its next contact has a peak of its own."""
    for i in range(s.nc):
        if not is_active(mode[i]):
            w.highest[i] = -np.inf


@compiled
def _least(s: Any, value: float) -> float:
    """What a multiplier must exceed to be larger than `value` as far as the tolerance tells."""
    return float(value + s.rtol * abs(value))


@compiled
def _slopes(K: Any, s: Any, m: Model, w: Work, at_end: bool) -> bool:
    """Leave in w.la the change of the active multipliers along the motion at an end of the step; False if ill posed."""
    step, y, k = NUDGE * s.hs, w.y1 if at_end else w.y, w.k[s.end if at_end else START]
    t = s.t_old + step + (s.hs if at_end else 0.0)
    for a in range(s.nq + s.n):
        w.ys[a] = y[a] + step * k[a]
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, w.ys[: s.nq], w.ys[s.nq :], OWN) != 0:
        return False
    for j in range(s.na):
        w.la[j] -= w.lams[NODES - 1 if at_end else 0, w.idx[j]]
    return True


@compiled
def _off(s: Any, w: Work, i: int) -> float:
    """How far the last stage, which stands at the step's end, is off the multiplier of row i there."""
    return float(abs(w.lam_at[s.end - 1 if s.method == EXPLICIT else s.end, i] - w.lams[NODES - 1, i]))


@compiled
def _inside(s: Any, w: Work, i: int, end: float) -> float:
    """Place of the stage before `end` with the largest multiplier of row i, if that is a peak; else NEVER.

    Within what the last stage is off the step's end stages tell nothing: then 0 if the step starts at the largest one,
    so that only its slope can tell.
    """
    if s.method == EXACT:
        return 0.5 * end
    start, final, place = w.lams[0, i], w.lams[NODES - 1, i], NEVER
    top = max(w.highest[i], start, final) if end == 1.0 else max(w.highest[i], start)
    high = _least(s, top)
    for stage in range(3 if s.method == EXPLICIT else 1, s.end):  # those before are of low order
        if w.lam_at[stage, i] > high and stage_place(s, stage) < end:
            place, high = stage_place(s, stage), w.lam_at[stage, i]
    if high - top > NOISE * _off(s, w, i):
        return float(place)
    return 0.0 if place < NEVER and start == top else NEVER


@compiled
def _may_turn(s: Any, w: Work, i: int) -> bool:
    """Whether the multiplier of row i, the largest of its contact at the step's end, may have a peak just before it.

    The parabola through both ends and a stage says how fast it rises there, and how far a turn could take it.
    """
    start, end = w.lams[0, i], w.lams[NODES - 1, i]
    if s.method == EXACT or not end > _least(s, max(w.highest[i], start)):
        return False
    middle, late = (9, 10) if s.method == EXPLICIT else (s.end - 2, s.end - 1)
    left, reach = 1.0 - stage_place(s, middle), 1.0 - stage_place(s, late)
    steep, steeper = end - start, (end - w.lam_at[middle, i]) / left
    bend = (steep - steeper) / (1.0 - left)
    rises = steeper - bend * left >= RISING * (end - start)
    return bool(not rises and MARGIN * abs(bend) * reach * reach > max(s.rtol * abs(end), _off(s, w, i)))


@compiled
def _has_just_turned(s: Any, w: Work, i: int) -> bool:
    """Whether the multiplier of row i, the largest of its contact at the step's start, may have a peak just behind it.

    The first stages that tell anything may stand below a peak that they are behind: the parabola through two of them
    and the start says how fast it falls there, and how far a turn before them could take it.
    """
    start = w.lams[0, i]
    if s.method == EXACT or start < w.highest[i]:
        return False
    early, middle = (3, 6) if s.method == EXPLICIT else (1, 2)
    reach, far = stage_place(s, early), stage_place(s, middle)
    steep, steeper = (w.lam_at[early, i] - start) / reach, (w.lam_at[middle, i] - start) / far
    bend = (steeper - steep) / (far - reach)
    falls = steep - bend * reach <= -RISING * abs(steeper) * far
    return bool(not falls and MARGIN * abs(bend) * reach * reach > s.rtol * abs(start))


@compiled
def _suspect(K: Any, s: Any, m: Model, w: Work, end: float) -> bool:
    """Leave in w.peak where to look for the peak of every active row, NEVER where there can be none; whether any."""
    found, starting, turning = False, False, False
    for j in range(s.na):
        i = w.idx[j]
        if m.unilateral[i] and not (s.frictional and m.follows[i] >= 0):
            place = _inside(s, w, i, end)
            if place == NEVER and end == 1.0 and _may_turn(s, w, i):
                place = 1.0
            elif place == NEVER and _has_just_turned(s, w, i):
                place = 0.0
            w.peak[i] = place
            found = found or 0.0 < place < 1.0
            starting, turning = starting or place == 0.0, turning or place == 1.0
    if starting:
        found = _turns(K, s, m, w, False, 0.0, min(0.5 * STRIDE, 0.5 * end)) or found
    if turning:
        found = _turns(K, s, m, w, True, 1.0, 1.0 - 0.5 * STRIDE) or found
    return found


@compiled
def _turns(K: Any, s: Any, m: Model, w: Work, at_end: bool, asked: float, place: float) -> bool:
    """Move the peaks suspected at an end of the step inside it where the slope there says so; whether any."""
    sound, found = _slopes(K, s, m, w, at_end), False
    for j in range(s.na):
        i = w.idx[j]
        if m.unilateral[i] and w.peak[i] == asked:
            turns = sound and (w.la[j] < 0.0) == at_end
            w.peak[i] = place if turns else NEVER
            found = found or turns
    return found


@compiled
def _multiplier(K: Any, s: Any, m: Model, w: Work, i: int, theta: float) -> float:
    """Lam of row i at a place in the step; -inf if ill posed. All others are left in w.la."""
    if theta == 0.0:
        return float(w.lams[0, i])
    if theta == 1.0:
        return float(w.lams[NODES - 1, i])
    dense.state(s, m, w, theta, w.ys)
    t = s.t_old + theta * s.hs
    known = dense.put_on_rows(K, s, m, w, theta, w.ys, dense.tolerated(s))
    if not known and accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, w.ys[: s.nq], w.ys[s.nq :], OWN) != 0:
        return -np.inf
    for j in range(s.na):
        if w.idx[j] == i:
            return float(w.la[j])
    return -np.inf


@compiled
def _peak(K: Any, s: Any, m: Model, w: Work, i: int, end: float) -> float:
    """Place of the largest multiplier of row i near w.peak[i], between 0 and `end`; NEVER if that is no peak."""
    x1 = w.peak[i]
    x0, x2 = max(x1 - STRIDE, 0.0), min(x1 + STRIDE, end)
    f1 = _multiplier(K, s, m, w, i, x1)
    f0, f2 = _multiplier(K, s, m, w, i, x0), _multiplier(K, s, m, w, i, x2)
    while f0 > f1 or f2 > f1:  # uphill
        if f0 > f1:
            at_end, x2, f2 = x0 == 0.0, x1, f1
            x1 = 0.1 * x1 if at_end else x0
            f1 = _multiplier(K, s, m, w, i, x1) if at_end else f0
            x0 = max(x1 - STRIDE, 0.0)
            f0 = f0 if at_end else _multiplier(K, s, m, w, i, x0)
        else:
            at_end, x0, f0 = x2 == end, x1, f1
            x1 = end - 0.1 * (end - x1) if at_end else x2
            f1 = _multiplier(K, s, m, w, i, x1) if at_end else f2
            x2 = min(x1 + STRIDE, end)
            f2 = f2 if at_end else _multiplier(K, s, m, w, i, x2)
        if at_end and min(x1, end - x1) < NEAREST:
            break
    if not (f1 > f0 and f1 > f2):
        return NEVER
    x1, f1 = _close_in(K, s, m, w, i, x0, x1, x2, f0, f1, f2)
    known = max(w.highest[i], w.lams[0, i])
    if not f1 > _least(s, max(known, w.lams[NODES - 1, i]) if end == 1.0 else known):
        return NEVER
    w.highest[i] = f1
    return float(x1)


@compiled
def _close_in(
    K: Any, s: Any, m: Model, w: Work, i: int, x0: float, x1: float, x2: float, f0: float, f1: float, f2: float
) -> tuple[float, float]:  # fmt: skip
    """Place and value of the largest multiplier between x0 and x2, by parabolas through three values.

    It ends where the parabola promises far less than the tolerance can tell.
    """
    for _ in range(CLOSER):
        a, b = (x1 - x0) * (f1 - f2), (x1 - x2) * (f1 - f0)
        if a == b:
            break
        x = x1 - 0.5 * ((x1 - x0) * a - (x1 - x2) * b) / (a - b)
        gain = (a - b) / ((x1 - x0) * (x2 - x1) * (x2 - x0)) * (x - x1) ** 2
        if not x0 < x < x2 or gain <= PROMISED * s.rtol * abs(f1):
            break
        f = _multiplier(K, s, m, w, i, x)
        if f > f1:
            if x < x1:
                x2, f2 = x1, f1
            else:
                x0, f0 = x1, f1
            x1, f1 = x, f
        elif x < x1:
            x0, f0 = x, f
        else:
            x2, f2 = x, f
    return float(x1), float(f1)


@compiled
def find(K: Any, s: Any, m: Model, w: Work, end: float) -> None:
    """Leave in w.peak the place of every unilateral row's peak up to `end`, NEVER where there is none."""
    for i in range(s.nc):
        w.peak[i] = NEVER
    if s.na == 0:
        return
    if _suspect(K, s, m, w, end) and dense.prepare(K, s, m, w) == 0:
        for i in range(s.nc):
            if w.peak[i] < NEVER:
                w.peak[i] = _peak(K, s, m, w, i, end)
    for j in range(s.na):
        i = w.idx[j]
        w.highest[i] = max(w.highest[i], w.lams[0, i])
        if end == 1.0:
            w.highest[i] = max(w.highest[i], w.lams[NODES - 1, i])


@compiled
def first(s: Any, w: Work) -> float:
    """Place of the first peak that is left; NEVER if none."""
    place = NEVER
    for i in range(s.nc):
        place = min(place, w.peak[i])
    return place


@compiled
def drop(s: Any, w: Work, place: float) -> None:
    """Take the peaks at this place, and before it, off the list."""
    for i in range(s.nc):
        if w.peak[i] <= place:
            w.peak[i] = NEVER
