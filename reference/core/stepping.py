"""One step by the method chosen, within the tolerance, or an arc in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core import audit, bogacki, choice, dense, dop853, esdirk, exact, folds
from crossbody.reference.core.acceleration import scatter
from crossbody.reference.core.algebra import ULP, all_finite, copy
from crossbody.reference.core.dop853_table import STAGES
from crossbody.reference.core.layout import (
    DIVERGED,
    EXACT,
    EXPLICIT,
    ILL_POSED,
    IMPLICIT,
    INCONSISTENT,
    NODES,
    NOT_FINITE,
    SHORT,
    STEP_TOO_SMALL,
    Buffers,
    Model,
    Work,
)
from crossbody.reference.core.shares import LENIENT

FAR = 1e30  # beyond this a motion has diverged
MAX_REJECTIONS = 60
SHORT_PART = 0.2  # ticks closer than this part of a high-order step are taken by the low-order method
HOLD_SHORT = 16  # ticks by the high-order method after one that was not good enough


@compiled
def _short_step(K: Any, s: Any, m: Model, w: Work) -> bool:
    """Go to the next tick by the low-order method, if the tick is short against the motion and the error allows."""
    h = s.stop - s.t
    if s.hold_short > 0:
        s.hold_short -= 1
        return False
    if h > SHORT_PART * min(s.h, s.h_max) or h < 4.0 * ULP * abs(s.t):
        return False
    if not bogacki.step(K, s, m, w, h) <= 1.0:
        s.hold_short = HOLD_SHORT
        return False
    s.method, s.end, s.hs = SHORT, bogacki.LAST, h
    return True


@compiled
def _finite_mass(s: Any, w: Work) -> bool:
    """Whether M is finite where nothing reads it too: above the diagonal, and between branches."""
    total = 0.0
    for i in range(s.n if s.k > 1 else 0):
        for j in range(s.k):
            total += w.M[i, j] - w.M[i, j]
    return total == 0.0


@compiled
def _finish(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Evaluate the end of the step, derivative, multipliers, gaps, and check it."""
    nq = s.nq
    last = NODES - 1
    end = s.end
    t = s.t + s.hs
    known = s.method == SHORT
    # Anew after an implicit step too: lam is then the law's at y1, not what Newton's residue makes of it.
    if s.method == IMPLICIT:
        s.t_old = s.t
        known = dense.put_on_rows(K, s, m, w, 1.0, w.y1, dense.tolerated(s))
        if known:
            dop853.keep(K, s, m, w, t, w.y1[:nq], w.y1[nq:], end)
    if not known and dop853.derivative(K, s, m, w, t, w.y1, end) != 0:
        return ILL_POSED
    if s.frictional and s.method == EXPLICIT:
        shown = choice.stage_rate(s, w)
        s.slip_rate, s.blurred = max(s.slip_rate, shown), shown == 0.0
    s.parting = s.contradiction > 1.0
    scatter(s, w, w.lams[last])
    if s.nc > 0:
        s.guards += 1
        K.gaps(t, w.y1[:nq], w.y1[nq:], m.p, w.gaps[last], w.rates[last])
    copy(w.lam0, w.lams[0])
    if not (all_finite(w.gaps[last]) and all_finite(w.rates[last]) and all_finite(w.lams[last])):
        return NOT_FINITE
    if not all_finite(w.k[end]) or not _finite_mass(s, w):
        return NOT_FINITE
    y1 = w.y1
    for i in range(nq + s.n):
        if abs(y1[i]) > FAR:
            return DIVERGED
    if s.loops and folds.passed(s, m, w, b) != 0:
        return ILL_POSED
    if not audit.follows_law(K, s, m, w, b, end):
        return INCONSISTENT
    s.t_old = s.t
    return 0


@compiled
def attempt(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Take one step of the present method within the tolerance; y1 and the end's derivative are there afterwards."""
    s.have_dense = 0
    if s.h == 0.0:
        s.h = choice.first_step(K, s, m, w)
    if s.has_control and s.method == EXPLICIT and _short_step(K, s, m, w):
        return _finish(K, s, m, w, b)
    s.end = esdirk.STAGES - 1 if s.method == IMPLICIT else STAGES
    clipped = False
    rejected = False
    ill = 0
    s.lenient = LENIENT
    longest = choice.longest_step(s, m, w)
    for _ in range(MAX_REJECTIONS):
        h = min(s.h, longest)
        left = s.stop - s.t
        clipped = h >= left or left - h < 0.01 * h
        if clipped:
            h = left
        if h < 4.0 * ULP * abs(s.t):
            break
        error = dop853.step(K, s, m, w, h) if s.method == EXPLICIT else esdirk.step(K, s, m, w, h)
        if 0.0 <= error <= 1.0:
            s.hs = h
            proposal = h * min(choice.grow(s, error), 1.0 if rejected else 6.0)
            s.h = max(s.h, proposal) if clipped and not rejected else proposal
            s.cautious = max(0, s.cautious - 1)
            if s.method == EXPLICIT and s.stalled >= choice.STALLED_STEPS - 1:
                s.promised = choice.promised_step(s, m, w, h)
            s.lenient = np.inf
            return _finish(K, s, m, w, b)
        s.rejected += 1
        rejected = True
        if error > 1.0 and error < 1e300:
            s.h = h * choice.grow(s, error)
        else:
            ill = 1 if error == -1.0 else 2
            s.h = 0.25 * h
        s.cautious = choice.CAUTIOUS_STEPS
    if ill == 1:
        return ILL_POSED
    return NOT_FINITE if ill == 2 else STEP_TOO_SMALL


@compiled
def take_arc(K: Any, s: Any, m: Model, w: Work, b: Buffers, length: float) -> int:
    """One step in closed form."""
    s.method, s.end = EXACT, STAGES
    s.have_dense = 1
    s.hs = min(length, s.stop - s.t, s.h_max)
    exact.begin(K, s, m, w)
    exact.evaluate(s, m, w, s.hs, w.y1)
    s.exact_steps += 1
    if s.ledger:
        copy(w.z, w.z1)
    return _finish(K, s, m, w, b)
