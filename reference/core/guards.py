"""The guards of the state machines as functions of a place in the step, and the place where one fires."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference._cache import compiled, inlined
from crossbody.reference._kinds import Bytes
from crossbody.reference.core import dense
from crossbody.reference.core.acceleration import GENERAL, OWN, accelerate
from crossbody.reference.core.algebra import ULP, inverse_diagonal
from crossbody.reference.core.layout import MEMORYLESS, Model, Work
from crossbody.reference.core.machine import multiplier_if_active, slow

# Guards: each is positive until it fires.
NONE, TOUCH, TOUCH_INSIDE, RELEASE, LEAVE, CATCH, PRESS, HANDOVER, RATE, RATE_DOWN, SWITCH = np.arange(11)
HANDOVER_PART = 0.01  # elastic part of lam at which a COLLISION hands over to CONTACT (spec 1.2)


@inlined
def _multiplier(K: Any, s: Any, m: Model, w: Work, i: int, t: float) -> float:
    """Lam of the active row i at the state in ys."""
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, w.ys[: s.n], w.ys[s.n :], OWN) != 0:
        return np.nan
    for j in range(s.na):
        if w.idx[j] == i:
            return float(w.la[j])
    return np.nan


@inlined
def _handover(K: Any, s: Any, m: Model, w: Work, i: int, t: float) -> float:
    """Elastic part c |h'| + b0 |h| less eps lam_i / (G^-1)_ii: positive while the elastic part of lam still counts.

    c is b1, but at least sqrt(b0): with b1 alone a weakly damped collision would be spent at each passage of h
    through zero, one without damping at its touch.
    """
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, w.ys[: s.n], w.ys[s.n :], GENERAL) != 0:
        return np.nan
    for j in range(s.na):
        if w.idx[j] == i:
            elastic = max(w.law[i, 1], np.sqrt(w.law[i, 0])) * abs(w.hda[j]) + w.law[i, 0] * abs(w.ha[j])
            return float(elastic - HANDOVER_PART * w.la[j] / inverse_diagonal(w.G, s.na, w.reach, j, w.scale))
    return np.nan


@inlined
def dead_band(s: Any, w: Work, i: int) -> float:
    """What a multiplier may fall below zero before a row without memory, which may press again at once, lets go."""
    return float(w.noise[i]) if s.fsm == MEMORYLESS else 0.0


@inlined
def rise(s: Any) -> float:
    """How far a gap must open before a row is FREE: one without memory, held at the surface, rounds to either side."""
    return float(s.touch) if s.fsm == MEMORYLESS else 0.0


@compiled
def guard(K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, theta: float) -> float:
    """Value of one guard at the part theta of the step."""
    s.guards += 1
    dense.state(s, m, w, theta, w.ys)
    t = s.t_old + theta * s.hs
    q, v = w.ys[: s.n], w.ys[s.n :]
    if kind in (RELEASE, HANDOVER):
        dense.put_on_rows(K, s, m, w, theta, w.ys)
    if kind == RELEASE:
        return _multiplier(K, s, m, w, i, t) + dead_band(s, w, i)
    if kind == HANDOVER:
        return _handover(K, s, m, w, i, t)
    if kind == SWITCH:
        K.watch(t, q, v, m.p, w.guard)
        return float(w.guard[i])
    if kind == PRESS:
        lam = multiplier_if_active(K, s, m, w, mode, i, t, q, v)
        return float(w.noise[i] - lam)
    K.gaps(t, q, v, m.p, w.gap, w.rate)
    h, rate = w.gap[i], w.rate[i]
    if kind == TOUCH:
        return float(h)
    if kind == LEAVE:
        return float(rise(s) - h)
    if kind == RATE:
        return float(-rate)
    if kind == RATE_DOWN:
        return float(rate)
    closing = rate + slow(s)
    if kind == TOUCH_INSIDE:
        return float(max(h - s.touch, closing))
    return float(max(closing, -multiplier_if_active(K, s, m, w, mode, i, t, q, v)))


@compiled
def root(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, a: float, ga: float, b: float, gb: float
) -> float:  # fmt: skip
    """Where the guard fires between a (positive) and b (not positive): Chandrupatla's method, from the fired side.

    Values are carried along with their places, so that rounding cannot change a bracket's sign.
    """
    resolution = max(ULP, ULP * abs(s.t_old) / s.hs)
    x1, f1, x2, f2, x3, f3 = b, gb, a, ga, a, ga  # the latest point, the other end, the point before
    part = 0.5
    while abs(x2 - x1) > resolution and f1 != 0.0 and f2 != 0.0:
        edge = min(0.5, 0.5 * resolution / abs(x2 - x1))
        x = x1 + min(max(part, edge), 1.0 - edge) * (x2 - x1)
        if x in (x1, x2):
            break
        f = guard(K, s, m, w, mode, kind, i, x)
        if (f > 0.0) == (f1 > 0.0):
            x3, f3 = x1, f1
        else:
            x3, f3, x2, f2 = x2, f2, x1, f1
        x1, f1 = x, f
        part = _next_part(x1, f1, x2, f2, x3, f3)
    return x2 if f1 > 0.0 else x1


@inlined
def _next_part(x1: float, f1: float, x2: float, f2: float, x3: float, f3: float) -> float:
    """Part of the way from x1 to x2: inverse quadratic interpolation where it is safe, bisection where not."""
    if x3 in (x1, x2) or f3 in (f1, f2):
        return 0.5
    xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
    if not (0.0 < xi < 1.0 and 1.0 - np.sqrt(1.0 - xi) < phi < np.sqrt(xi)):
        return 0.5
    return float(f1 / (f1 - f2) * f3 / (f3 - f2) - (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f2 - f3))
