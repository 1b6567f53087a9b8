"""Where inside the step just taken a machine must switch first.

Every step is watched on its dense output at its ends and at three points between. A gap is searched by the sign of its
rate as well: where the rate changes sign the gap has its extremum, which decides, so that a contact entirely inside one
step is found. A fired transition is applied as such, never decided again from a value at round-off.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference._cache import compiled, inlined
from crossbody.reference._kinds import Bytes
from crossbody.reference.core import dense
from crossbody.reference.core.acceleration import OWN, accelerate, is_active, scatter
from crossbody.reference.core.algebra import ULP
from crossbody.reference.core.guards import (
    CATCH,
    HANDOVER,
    LEAVE,
    NONE,
    PRESS,
    RATE,
    RATE_DOWN,
    RELEASE,
    SWITCH,
    TOUCH,
    TOUCH_INSIDE,
    dead_band,
    guard,
    rise,
    root,
)
from crossbody.reference.core.layout import (
    BALLISTIC,
    COLLISION,
    CONTACT,
    EDGE,
    EXACT,
    FREE,
    LEVEL,
    NEVER,
    NODES,
    Model,
    Work,
)
from crossbody.reference.core.machine import active_mode, released_mode, slow

NEAR = 0.25  # of the range in the step: seen at twelve stages, a value does not come from farther to zero
DIPS = 12  # parabolas that close in a minimum
SHARP = 1e-7  # part of the step within which a minimum is known: its value is then known to rounding


@inlined
def _extremum(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int, node: int, lowest: bool) -> float:
    """Where the gap of row i has its minimum (or maximum) between a node and the next."""
    a, b = _place(node), _place(node + 1)
    ra, rb = w.rates[node, i], w.rates[node + 1, i]
    if lowest:
        return root(K, s, m, w, mode, RATE, i, a, -ra, b, -rb)
    return root(K, s, m, w, mode, RATE_DOWN, i, a, ra, b, rb)


@inlined
def _place(node: int) -> float:
    return node / (NODES - 1.0)


@inlined
def _touch(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """First contact of a FREE row that starts above the surface."""
    for node in range(NODES - 1):
        a, b = _place(node), _place(node + 1)
        ha, hb = w.gaps[node, i], w.gaps[node + 1, i]
        if not hb > 0.0:
            return root(K, s, m, w, mode, TOUCH, i, a, ha, b, hb)
        if w.rates[node, i] < 0.0 < w.rates[node + 1, i]:
            low = _extremum(K, s, m, w, mode, i, node, True)
            h = guard(K, s, m, w, mode, TOUCH, i, low)
            if not h > 0.0:
                return root(K, s, m, w, mode, TOUCH, i, a, ha, low, h)
    return NEVER


@inlined
def _touch_inside(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """First closing of a FREE row that starts on the surface."""
    closing = w.rates[0, i] + slow(s)
    before = max(w.gaps[0, i] - s.touch, closing)
    for node in range(1, NODES):
        value = max(w.gaps[node, i] - s.touch, w.rates[node, i] + slow(s))
        if value < 0.0:
            return root(K, s, m, w, mode, TOUCH_INSIDE, i, _place(node - 1), max(before, 1e-300), _place(node), value)
        before = value
    return NEVER


@inlined
def _leave(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """First rise above the surface."""
    for node in range(NODES - 1):
        a, b = _place(node), _place(node + 1)
        ha, hb = w.gaps[node, i] - rise(s), w.gaps[node + 1, i] - rise(s)
        start = max(-ha, 1e-300)
        if hb > 0.0:
            return root(K, s, m, w, mode, LEAVE, i, a, start, b, -hb)
        if w.rates[node, i] > 0.0 > w.rates[node + 1, i]:
            high = _extremum(K, s, m, w, mode, i, node, False)
            h = guard(K, s, m, w, mode, LEAVE, i, high)
            if h < 0.0:
                return root(K, s, m, w, mode, LEAVE, i, a, start, high, h)
    return NEVER


@inlined
def _by_nodes(K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int) -> float:
    """First firing of a guard that is known at the nodes only where it is evaluated (CATCH, PRESS, TOUCH_INSIDE)."""
    before = 1e-300
    for node in range(1, NODES):
        if kind != PRESS and not w.rates[node, i] < -slow(s):
            before = 1e-300
            continue
        value = guard(K, s, m, w, mode, kind, i, _place(node))
        if value < 0.0:
            return root(K, s, m, w, mode, kind, i, _place(node - 1), before, _place(node), value)
        before = max(value, 1e-300)
    return NEVER


@inlined
def _release(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """First loss of pressure of an active row, in a dip between nodes too."""
    dead = dead_band(s, w, i)
    for node in range(NODES - 1):
        a, b = _place(node), _place(node + 1)
        la, lb = max(w.lams[node, i] + dead, 1e-300), w.lams[node + 1, i] + dead
        if not lb >= 0.0:
            return root(K, s, m, w, mode, RELEASE, i, a, la, b, lb)
        if node + 2 < NODES:
            place, value = _dip(K, s, m, w, mode, RELEASE, i, node, la, lb, w.lams[node + 2, i] + dead)
            if value < 0.0:
                left, g_left = (a, la) if place <= b else (b, max(lb, 1e-300))
                return root(K, s, m, w, mode, RELEASE, i, left, g_left, place, value)
    return NEVER


@compiled
def _dip(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, node: int, f0: float, f1: float, f2: float
) -> tuple[float, float]:
    """A place between this node and the next but one where a guard is below zero; (NEVER, 1) if there is none.

    The guard's minimum is closed in by parabolas, each through the least value found and the two beside it: a dip of a
    millionth of what the guard varies by is enough to switch. That is done only where the first comes near to zero.
    """
    x0, x1, x2 = _place(node), _place(node + 1), _place(node + 2)
    bend = f0 - 2.0 * f1 + f2
    if not bend > 0.0 or f1 - (f0 - f2) ** 2 / (8.0 * bend) > NEAR * max(f0, f2):
        return NEVER, 1.0
    x = x1 + 0.5 * (x1 - x0) * (f0 - f2) / bend
    for _ in range(DIPS):
        if not (x0 < x < x2) or abs(x - x1) < SHARP:
            break
        f = guard(K, s, m, w, mode, kind, i, x)
        if f < 0.0:
            return x, f
        if f < f1:
            if x < x1:
                x1, f1, x2, f2 = x, f, x1, f1
            else:
                x0, f0, x1, f1 = x1, f1, x, f
        elif x < x1:
            x0, f0 = x, f
        else:
            x2, f2 = x, f
        x = _vertex(x0, f0, x1, f1, x2, f2)
    return NEVER, 1.0


@inlined
def _vertex(x0: float, f0: float, x1: float, f1: float, x2: float, f2: float) -> float:
    """Where the parabola through three points has its extremum; NEVER if they stand on a line."""
    left, right = (x1 - x0) * (f1 - f2), (x1 - x2) * (f1 - f0)
    if left == right:
        return NEVER
    return x1 - 0.5 * ((x1 - x0) * left - (x1 - x2) * right) / (left - right)


@inlined
def _handed_over(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """First instant at which the elastic part of a COLLISION's multiplier is spent."""
    before = guard(K, s, m, w, mode, HANDOVER, i, 0.0)
    for node in range(1, NODES):
        value = guard(K, s, m, w, mode, HANDOVER, i, _place(node))
        if value <= 0.0:
            return root(K, s, m, w, mode, HANDOVER, i, _place(node - 1), max(before, 1e-300), _place(node), value)
        before = value
    return NEVER


@inlined
def _first(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """Earliest switching of row i under the level and the memoryless machine; its guard in kind[i]."""
    if mode[i] == FREE:
        inside = w.gaps[0, i] <= s.touch
        w.kind[i] = TOUCH_INSIDE if inside else TOUCH
        return _touch_inside(K, s, m, w, mode, i) if inside else _touch(K, s, m, w, mode, i)
    if is_active(mode[i]):
        w.kind[i] = RELEASE
        place = _release(K, s, m, w, mode, i)
        other = NEVER
        if s.fsm != LEVEL:
            other = _leave(K, s, m, w, mode, i)
        elif mode[i] == COLLISION:
            other = _handed_over(K, s, m, w, mode, i)
        if other < place:
            w.kind[i] = LEAVE if s.fsm != LEVEL else HANDOVER
            return other
        return place
    w.kind[i] = LEAVE
    place = _leave(K, s, m, w, mode, i)
    kind = CATCH if s.fsm == LEVEL else PRESS
    if s.frozen and m.beta[i, 0] > 0.0:
        kind = TOUCH_INSIDE  # it collides at once, whatever presses it
    other = _by_nodes(K, s, m, w, mode, kind, i)
    if other < place:
        w.kind[i] = kind
        return other
    return place


@inlined
def _first_edge(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """The edge machine looks at the step's ends only, and only for what becomes true."""
    last = NODES - 1
    h0, h1, r0, r1 = w.gaps[0, i], w.gaps[last, i], w.rates[0, i], w.rates[last, i]
    if mode[i] == FREE and h0 > 0.0 >= h1:
        w.kind[i] = TOUCH
        return root(K, s, m, w, mode, TOUCH, i, 0.0, h0, 1.0, h1)
    if mode[i] == CONTACT and w.lams[0, i] >= 0.0 > w.lams[last, i]:
        w.kind[i] = RELEASE
        return root(K, s, m, w, mode, RELEASE, i, 0.0, max(w.lams[0, i], 1e-300), 1.0, w.lams[last, i])
    if mode[i] == BALLISTIC and h0 <= 0.0 < h1:
        w.kind[i] = LEAVE
        return root(K, s, m, w, mode, LEAVE, i, 0.0, max(-h0, 1e-300), 1.0, -h1)
    if mode[i] == BALLISTIC and max(h1, r1) < 0.0 and not (h0 <= 0.0 and r0 < 0.0):
        w.kind[i] = TOUCH_INSIDE
        return root(K, s, m, w, mode, TOUCH_INSIDE, i, 0.0, max(h0, r0, 1e-300), 1.0, max(h1, r1))
    return NEVER


@inlined
def _near(low: float, high: float) -> bool:
    """Whether a value that was seen between low and high can have come to zero."""
    return bool(not low > NEAR * (high - low))


@inlined
def _watched(s: Any, w: Work, mode: Bytes, i: int) -> bool:
    """Whether a row can switch in this step: its gap, or its multiplier, came near zero against what it varied.

    It is judged by the extremes at the stages.
    """
    if s.method == EXACT:
        return True
    if s.fsm != LEVEL or (mode[i] != FREE and mode[i] != CONTACT):
        return True
    last = NODES - 1
    if mode[i] == FREE:
        low, high, end = w.gap_lo[i], w.gap_hi[i], w.gaps[last, i]
    else:
        low, high, end = w.lo[i], w.hi[i], w.lams[last, i]
    return _near(min(low, end), max(high, end))


@inlined
def _fill_nodes(K: Any, s: Any, m: Model, w: Work, multipliers: bool) -> int:
    """Gaps and rates, and the multipliers if asked, at the inner nodes."""
    for node in range(1, NODES - 1):
        dense.state(s, m, w, _place(node), w.ys)
        t = s.t_old + _place(node) * s.hs
        q, v = w.ys[: s.n], w.ys[s.n :]
        K.gaps(t, q, v, m.p, w.gaps[node], w.rates[node])
        s.guards += 1
        if multipliers:
            if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, q, v, OWN) != 0:
                return 1
            scatter(s, w, w.lams[node])
    return 0


@inlined
def _first_switch(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """First fall to zero of a discrete variable's guard; one that starts below zero is not armed until it has risen."""
    for node in range(NODES - 1):
        a, b = _place(node), _place(node + 1)
        ga, gb = w.guards[node, i], w.guards[node + 1, i]
        if ga > 0.0 and not gb > 0.0:
            return root(K, s, m, w, mode, SWITCH, i, a, ga, b, gb)
        if node + 2 < NODES and ga > 0.0 and gb > 0.0:
            place, value = _dip(K, s, m, w, mode, SWITCH, i, node, ga, gb, w.guards[node + 2, i])
            if value < 0.0:
                left, g_left = (a, ga) if place <= b else (b, gb)
                return root(K, s, m, w, mode, SWITCH, i, left, g_left, place, value)
    return NEVER


@inlined
def _scan_switches(K: Any, s: Any, m: Model, w: Work, mode: Bytes) -> int:
    """Take the discrete variables' guards into s.theta; 1 if ill posed."""
    watched = False
    K.watch(s.t_old + s.hs, w.y1[: s.n], w.y1[s.n :], m.p, w.guards[NODES - 1])
    for i in range(s.ng):
        end = w.guards[NODES - 1, i]
        low, high = min(w.guard_lo[i], end), max(w.guard_hi[i], end)
        w.guard_hit[i] = NEVER
        watched = watched or s.method == EXACT or _near(low, high)
    if not watched:
        return 0
    if dense.prepare(K, s, m, w) != 0:
        return 1
    for node in range(NODES - 1):
        dense.state(s, m, w, _place(node), w.ys)
        K.watch(s.t_old + _place(node) * s.hs, w.ys[: s.n], w.ys[s.n :], m.p, w.guards[node])
    for i in range(s.ng):
        w.guard_hit[i] = _first_switch(K, s, m, w, mode, i)
        s.theta = min(s.theta, w.guard_hit[i])
    return 0


@inlined
def _all_free(s: Any, m: Model, mode: Bytes) -> bool:
    """Whether nothing but free flight in closed form is under way."""
    if s.method != EXACT or s.na > 0 or s.fsm == EDGE:
        return False
    others = 0
    for i in range(s.nc):
        others += m.unilateral[i] and m.follows[i] < 0 and mode[i] != FREE
    return others == 0


@inlined
def _fall(h: float, rate: float, a: float) -> float:
    """Last time at which h + rate t + a t^2/2 falls to zero; 0 if it is below all along, infinite if it never falls."""
    square = rate * rate - 2.0 * a * h
    if square < 0.0:
        return np.inf if h > 0.0 else 0.0
    if rate < 0.0:
        return float(max(2.0 * h / (np.sqrt(square) - rate), 0.0))
    return float((rate + np.sqrt(square)) / -a) if a < 0.0 else np.inf


@inlined
def _free_flight(s: Any, w: Work, i: int) -> float:
    """First touch of a FREE row in free flight, where its gap is a parabola: in closed form."""
    h, rate, end = w.gaps[0, i], w.rates[0, i], w.rates[NODES - 1, i]
    if h > s.touch and w.gaps[NODES - 1, i] > 0.0 and not rate < 0.0 < end:
        return NEVER  # most rows
    a = (end - rate) / s.hs
    if h > s.touch:
        w.kind[i] = TOUCH
        t = _fall(h, rate, a)
    else:
        w.kind[i] = TOUCH_INSIDE
        # clearly behind the threshold, so that rounding does not leave it where it was
        closing = -(1.5 * slow(s) + rate) / a if a < 0.0 else np.inf
        t = max(_fall(h - s.touch, rate, a), closing)
    return float(t / s.hs) if t <= s.hs else NEVER


@compiled
def scan(K: Any, s: Any, m: Model, w: Work, mode: Bytes) -> int:
    """Set s.theta to the first switching in the step, NEVER if none, and hit[i] for all; 1 if ill posed."""
    s.theta = NEVER
    if s.ng > 0 and _scan_switches(K, s, m, w, mode) != 0:
        return 1
    any_gap, any_multiplier = False, False
    hit, kind, unilateral, follows = w.hit, w.kind, m.unilateral, m.follows
    for i in range(s.nc):
        hit[i] = NEVER
        kind[i] = NONE
        if unilateral[i] and follows[i] < 0 and _watched(s, w, mode, i):
            hit[i] = 1.0
            any_gap = True
            any_multiplier = any_multiplier or is_active(mode[i])
    if not any_gap:
        return 0
    if _all_free(s, m, mode):
        first = s.theta
        for i in range(s.nc):
            if hit[i] == 1.0:
                hit[i] = _free_flight(s, w, i)
                first = min(first, hit[i])
        s.theta = first
        if s.theta <= 1.0:
            _tie(s, w)
        return 0
    if dense.prepare(K, s, m, w) != 0 or _fill_nodes(K, s, m, w, any_multiplier) != 0:
        return 1
    for i in range(s.nc):
        if w.hit[i] == 1.0:
            if s.fsm == EDGE:
                w.hit[i] = _first_edge(K, s, m, w, mode, i)
            else:
                w.hit[i] = _first(K, s, m, w, mode, i)
            s.theta = min(s.theta, w.hit[i])
    if s.theta <= 1.0:
        _tie(s, w)
    return 0


@inlined
def _tie(s: Any, w: Work) -> None:
    """Rows that switch within rounding of the first switch together, at the last of them."""
    together = s.theta + 8.0 * ULP * max(abs(s.t_old) / s.hs, 1.0)
    for i in range(s.nc):
        if w.hit[i] <= together:
            s.theta = max(s.theta, w.hit[i])


@inlined
def after(s: Any, m: Model, w: Work, mode: Bytes, i: int, h: float) -> int:
    """The mode that the fired guard of row i leads to."""
    kind = w.kind[i]
    if kind == RELEASE:
        return BALLISTIC if s.fsm != LEVEL else released_mode(mode[i], h)
    if kind == LEAVE:
        return FREE
    if kind == HANDOVER:
        return CONTACT
    if s.frozen and m.beta[i, 0] > 0.0:
        return int(mode[i])  # a frozen collision settles it
    return active_mode(s, m, i)
