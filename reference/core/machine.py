"""The state machines (spec 1.2): what is switched at one instant, until nothing changes any more.

    level        FREE -> active        h <= 0 and (h' < 0 or h < 0)
                 active -> BALLISTIC   lam < 0, h <= 0         active -> FREE        lam < 0, h > 0
                 BALLISTIC -> FREE     h > 0                   BALLISTIC -> active   h <= 0, h' < 0, lam would be > 0
    edge         the same conditions, but only when they become true
    memoryless   lam = max(0, law) over all h <= 0: a linear complementarity problem

Thresholds are not absolute: h' counts as zero below 1e-9 of the largest rate seen, and lam as zero below what rounding
makes of it. Without them a release at lam = 0, h = 1e-17 switches for ever.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference._cache import compiled, inlined
from crossbody.reference._kinds import Bytes, Floats, Index
from crossbody.reference.core.acceleration import GENERAL, accelerate, activate, is_active, scatter
from crossbody.reference.core.dop853 import START, derivative
from crossbody.reference.core.layout import (
    BALLISTIC,
    COLLISION,
    COLLISION_SEPARATION,
    CONTACT,
    EDGE,
    FREE,
    ILL_POSED,
    LEVEL,
    MODE_CYCLE,
    NOT_FINITE,
    Model,
    Work,
)

SLOW = 1e-9  # part of the largest rate seen
DEEP = 1e-9  # m: a FREE gap below -DEEP was started in penetration
ROUNDING = 1e-13
ULP = 2.3e-16


@inlined
def slow(s: Any) -> float:
    """The rate below which a gap is taken to stand still."""
    return float(SLOW * s.speed)


@inlined
def active_mode(m: Model, i: int) -> int:
    """COLLISION where the row has fast constants, CONTACT where it has one set."""
    return COLLISION if m.beta[i, 0] > 0.0 else CONTACT


@inlined
def released_mode(mode: int, h: float) -> int:
    """Where a row goes whose multiplier vanished."""
    if h > 0.0:
        return FREE
    return COLLISION_SEPARATION if mode == COLLISION else BALLISTIC


@inlined
def _noise(s: Any, w: Work) -> None:
    """What rounding of the state and of the sums can make of each multiplier."""
    n = s.n
    position, speed = 0.0, 0.0
    for a in range(n):
        position = max(position, abs(w.y[a]))
        speed = max(speed, abs(w.y[n + a]))
    for j in range(s.na):
        i = w.idx[j]
        G = 0.0
        for c in range(n):
            G += w.H[j, c] * w.X[j, c]
        from_state = 8.0 * ULP * (w.law[i, 0] * position + w.law[i, 1] * speed)
        w.noise[i] = (ROUNDING * w.scale[j] + from_state) / G


@inlined
def evaluate(K: Any, s: Any, m: Model, w: Work, mode: Bytes) -> int:
    """Everything a machine asks for at the present instant: gaps, rates, multipliers, their noise."""
    n = s.n
    activate(s, m, w, mode)
    s.have_jacobian = 0
    K.gaps(s.t, w.y[:n], w.y[n:], m.p, w.gap, w.rate)
    if derivative(K, s, m, w, s.t, w.y, START) != 0:
        return ILL_POSED
    scatter(s, w, w.lam)
    for a in range(n):
        if not np.isfinite(w.vd[a]):
            return NOT_FINITE
    for i in range(s.nc):
        if not (np.isfinite(w.gap[i]) and np.isfinite(w.rate[i]) and np.isfinite(w.lam[i])):
            return NOT_FINITE
        if m.unilateral[i] and m.follows[i] < 0:
            s.speed = max(s.speed, abs(w.rate[i]))
    return 0


@compiled
def multiplier_if_active(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int, t: float, q: Floats, v: Floats
) -> float:
    """Lam of row i if it were active now, from the same equations that the row would use; noise[i] beside it."""
    before = mode[i]
    mode[i] = active_mode(m, i)
    activate(s, m, w, mode)
    lam = -np.inf
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, q, v, GENERAL) == 0:
        _noise(s, w)
        for j in range(s.na):
            if w.idx[j] == i:
                lam = w.la[j]
    mode[i] = before
    activate(s, m, w, mode)
    return float(lam)


@inlined
def _would_press(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> bool:
    lam = multiplier_if_active(K, s, m, w, mode, i, s.t, w.y[: s.n], w.y[s.n :])
    return bool(lam > w.noise[i])


@inlined
def _next_level(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> int:
    """Where the level machine puts row i at this instant."""
    h, rate = w.gap[i], w.rate[i]
    if is_active(mode[i]):
        return released_mode(mode[i], h) if w.lam[i] < -w.noise[i] else int(mode[i])
    if h > 0.0:
        return FREE
    if mode[i] != FREE:
        closing = rate < -slow(s)
        return active_mode(m, i) if closing and _would_press(K, s, m, w, mode, i) else int(mode[i])
    if rate < -slow(s):
        return active_mode(m, i)
    if h < -DEEP:
        return active_mode(m, i) if _would_press(K, s, m, w, mode, i) else BALLISTIC
    if rate <= slow(s) and _would_press(K, s, m, w, mode, i):
        return active_mode(m, i)
    return FREE


@inlined
def _next_memoryless(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> int:
    """Where the complementarity problem's next pivot puts row i; below the surface it is CONTACT or BALLISTIC."""
    if mode[i] == FREE and not (w.gap[i] <= 0.0 and (w.rate[i] <= slow(s) or w.gap[i] < -DEEP)):
        return FREE
    if is_active(mode[i]):
        return BALLISTIC if w.lam[i] < -w.noise[i] else CONTACT
    if w.gap[i] > 0.0:
        return FREE
    return CONTACT if _would_press(K, s, m, w, mode, i) else BALLISTIC


@inlined
def _next(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> int:
    if s.fsm == LEVEL:
        return _next_level(K, s, m, w, mode, i)
    if s.fsm == EDGE:  # a row activated at this instant with lam < 0 has its edge; nothing else becomes true here
        fresh = mode[i] == CONTACT and (w.kind[i] == 1 or w.kind[i] == 2)
        w.kind[i] = 0
        return BALLISTIC if fresh and w.lam[i] < -w.noise[i] else int(mode[i])
    return _next_memoryless(K, s, m, w, mode, i)


@inlined
def write_event(s: Any, events_t: Floats, events: Index, i: int, before: int, after: int) -> None:
    """Note one transition."""
    e = s.events
    if e < len(events_t):
        events_t[e] = s.t
        events[e, 0], events[e, 1], events[e, 2] = i, before, after
        s.events = e + 1


@compiled
def remember(s: Any, history: Bytes, mode: Bytes) -> bool:
    """Note the mode set; whether it stood here at this instant before."""
    if abs(s.t - s.history_t) > 8.0 * ULP * abs(s.t):
        s.history, s.history_t, s.one_by_one = 0, s.t, 0
    for r in range(s.history):
        if np.array_equal(history[r], mode):
            return True
    if s.history < len(history) - 1:
        history[s.history] = mode
        s.history += 1
        return False
    return True


@inlined
def _pass(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, events_t: Floats, events: Index, changed: Bytes
) -> int:  # fmt: skip
    """Switch every row that wants to (only the first one once all together repeated); how many did."""
    count = 0
    for i in range(s.nc):
        if m.unilateral[i] and m.follows[i] < 0:
            after = _next(K, s, m, w, mode, i)
            if after != mode[i]:
                write_event(s, events_t, events, i, mode[i], after)
                mode[i] = after
                changed[i] = 1
                count += 1
                if s.one_by_one or s.fsm != LEVEL:
                    break
    return count


@compiled
def settle(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, history: Bytes, events_t: Floats, events: Index
) -> int:  # fmt: skip
    """Iterate until the mode set is consistent; leaves k[0], lam0 and the gaps of node 0 for the next step.

    Returns:
        0, or a negative code. After MODE_CYCLE, w.kind marks the rows that switch for ever.
    """
    changed = history[len(history) - 1]
    changed[:] = 0
    remember(s, history, mode)
    code = 0
    while True:
        code = evaluate(K, s, m, w, mode)
        if code != 0:
            return code
        if s.fsm != EDGE and s.na > 0:
            if s.has_solve:
                accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[: s.n], w.y[s.n :], GENERAL)
            _noise(s, w)
        if _pass(K, s, m, w, mode, events_t, events, changed) == 0:
            break
        if remember(s, history, mode):
            if s.one_by_one:
                return MODE_CYCLE
            s.one_by_one, s.history = 1, 0
            changed[:] = 0
    for i in range(s.nc):
        w.lam0[i] = w.lam[i]
        w.gaps[0, i] = w.gap[i]
        w.rates[0, i] = w.rate[i]
    return 0
