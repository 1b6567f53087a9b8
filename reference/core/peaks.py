"""Where in a step the multiplier of a contact is largest: rows are written there, so that peaks are read off exactly.

A step's ends alone miss a peak by up to the square of the step's length: 3 % of a contact that takes four steps.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference._cache import compiled, inlined
from crossbody.reference._kinds import Bytes
from crossbody.reference.core import dense
from crossbody.reference.core.acceleration import OWN, accelerate, is_active
from crossbody.reference.core.layout import EXACT, NEVER, NODES, Model, Work

GRID = 4  # intervals in which a peak is looked for
CLOSER = 5  # parabolas that close in on it
NUDGE = 1e-5  # part of the step along which a slope is taken


@inlined
def _slopes(K: Any, s: Any, m: Model, w: Work, t: float, y: Any, stage: int, lam: Any) -> bool:
    """Leave in w.la the change of the active multipliers from lam, along k[stage] for a short while; False if none."""
    step = NUDGE * s.hs
    for a in range(s.nq + s.n):
        w.ys[a] = y[a] + step * w.k[stage, a]
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t + step, w.ys[: s.nq], w.ys[s.nq :], OWN) != 0:
        return False
    for j in range(s.na):
        w.la[j] -= lam[w.idx[j]]
    return True


@inlined
def _highest(s: Any, w: Work, i: int) -> float:
    """Largest multiplier of row i at the stages inside the step just taken by integration."""
    high = w.lam_at[1, i]
    for stage in range(2, s.end):
        high = max(high, w.lam_at[stage, i])
    return float(high)


@inlined
def _may_have_one(K: Any, s: Any, m: Model, w: Work, mode: Bytes) -> bool:
    """Whether any unilateral row may have a peak inside the step: by its stages, or by its slopes at the ends."""
    last, found, ends_high, starts_high = NODES - 1, False, False, False
    for j in range(s.na):
        i = w.idx[j]
        w.peak[i] = NEVER
        if m.unilateral[i]:
            inside = s.method == EXACT or _highest(s, w, i) > max(w.lams[0, i], w.lams[last, i])
            w.peak[i] = 0.0 if inside else NEVER
            found = found or inside
            ends_high = ends_high or (not inside and w.lams[last, i] >= w.lams[0, i])
            starts_high = starts_high or (not inside and w.lams[last, i] < w.lams[0, i])
    if starts_high and not s.have_slopes and _slopes(K, s, m, w, s.t_old, w.y, 0, w.lams[0]):
        for j in range(s.na):
            w.rising[w.idx[j]] = w.la[j]
    for j in range(s.na):
        i = w.idx[j]
        if starts_high and m.unilateral[i] and w.lams[last, i] < w.lams[0, i] and w.rising[i] > 0.0:
            w.peak[i], found = 0.0, True
    s.have_slopes = 1
    for j in range(s.na):
        w.rising[w.idx[j]] = -1.0
    if ends_high and _slopes(K, s, m, w, s.t_old + s.hs, w.y1, s.end, w.lams[last]):
        for j in range(s.na):
            i = w.idx[j]
            w.rising[i] = w.la[j]
            if m.unilateral[i] and w.lams[last, i] >= w.lams[0, i] and w.la[j] < 0.0:
                w.peak[i], found = 0.0, True
    return bool(found)


@inlined
def _multiplier(K: Any, s: Any, m: Model, w: Work, i: int, theta: float) -> float:
    """Lam of row i at a place in the step; -inf if ill posed. All others are left in w.la."""
    dense.state(s, m, w, theta, w.ys)
    dense.put_on_rows(K, s, m, w, theta, w.ys)
    t = s.t_old + theta * s.hs
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, w.ys[: s.nq], w.ys[s.nq :], OWN) != 0:
        return -np.inf
    for j in range(s.na):
        if w.idx[j] == i:
            return float(w.la[j])
    return -np.inf


@compiled
def _peak(K: Any, s: Any, m: Model, w: Work, i: int, end: float) -> float:
    """Place of the largest multiplier of row i between 0 and `end`; NEVER if that is at one of them."""
    best, width = 0, end / GRID
    left, top, right = -np.inf, w.lams[0, i], -np.inf
    before = top
    for k in range(1, GRID + 1):
        value = _multiplier(K, s, m, w, i, k * width)
        if value > top:
            best, left, top, right = k, before, value, -np.inf
        elif k == best + 1:
            right = value
        before = value
    if best == 0 or best == GRID:  # close to an end, where the slope says that it turns
        inner = 0.1 * width if best == 0 else end - 0.1 * width
        value = _multiplier(K, s, m, w, i, inner)
        if not value > top:
            return NEVER
        x0, x1, x2 = (0.0, inner, width) if best == 0 else (end - width, inner, end)
        f0, f1, f2 = (top, value, right) if best == 0 else (left, value, top)
    else:
        x0, x1, x2 = (best - 1) * width, best * width, (best + 1) * width
        f0, f1, f2 = left, top, right
    for _ in range(CLOSER):
        a, b = (x1 - x0) * (f1 - f2), (x1 - x2) * (f1 - f0)
        if a == b:
            break
        x = x1 - 0.5 * ((x1 - x0) * a - (x1 - x2) * b) / (a - b)
        if not x0 < x < x2 or abs(x - x1) < 1e-4 * (x2 - x0):
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
    return float(x1)


@compiled
def find(K: Any, s: Any, m: Model, w: Work, mode: Bytes, end: float) -> None:
    """Leave in w.peak the place of every unilateral row's peak up to `end`, NEVER where there is none."""
    for i in range(s.nc):
        if not (m.unilateral[i] and is_active(mode[i])):
            w.peak[i] = NEVER
    if s.na == 0 or not _may_have_one(K, s, m, w, mode) or dense.prepare(K, s, m, w) != 0:
        return
    for i in range(s.nc):
        if w.peak[i] < NEVER:
            w.peak[i] = _peak(K, s, m, w, i, end)


@inlined
def first(s: Any, w: Work) -> float:
    """Place of the first peak that is left; NEVER if none."""
    place = NEVER
    for i in range(s.nc):
        place = min(place, w.peak[i])
    return place


@inlined
def drop(s: Any, w: Work, place: float) -> None:
    """Take the peaks at this place, and before it, off the list."""
    for i in range(s.nc):
        if w.peak[i] <= place:
            w.peak[i] = NEVER
