"""Where inside the step just taken a machine must switch first.

Every step is watched on its dense output at its ends and at three points between. A fired transition is applied as
such, never decided again from a value at round-off.
"""

from __future__ import annotations

from typing import Any

from crossbody.reference._cache import compiled, inlined
from crossbody.reference._kinds import Bytes
from crossbody.reference.core import dense
from crossbody.reference.core.acceleration import OWN, accelerate, is_active, scatter
from crossbody.reference.core.algebra import ULP
from crossbody.reference.core.crossings import (
    NEAR,
    at_node,
    by_nodes,
    dip,
    free_flight,
    handed_over,
    leave,
    release,
    touch,
    touch_inside,
)
from crossbody.reference.core.guards import (
    CATCH,
    HANDOVER,
    LEAVE,
    NONE,
    PRESS,
    RELEASE,
    SWITCH,
    TOUCH,
    TOUCH_INSIDE,
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
from crossbody.reference.core.machine import active_mode, released_mode


@inlined
def _first(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """Earliest switching of row i under the level and the memoryless machine; its guard in kind[i]."""
    if mode[i] == FREE:
        inside = w.gaps[0, i] <= s.touch
        w.kind[i] = TOUCH_INSIDE if inside else TOUCH
        return touch_inside(K, s, m, w, mode, i) if inside else touch(K, s, m, w, mode, i)
    if is_active(mode[i]):
        w.kind[i] = RELEASE
        place = release(K, s, m, w, mode, i)
        other = NEVER
        if s.fsm != LEVEL:
            other = leave(K, s, m, w, mode, i)
        elif mode[i] == COLLISION:
            other = handed_over(K, s, m, w, mode, i)
        if other < place:
            w.kind[i] = LEAVE if s.fsm != LEVEL else HANDOVER
            return other
        return place
    w.kind[i] = LEAVE
    place = leave(K, s, m, w, mode, i)
    kind = CATCH if s.fsm == LEVEL else PRESS
    if s.frozen and m.beta[i, 0] > 0.0:
        kind = TOUCH_INSIDE  # it collides at once, whatever presses it
    other = by_nodes(K, s, m, w, mode, kind, i)
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
        dense.state(s, m, w, at_node(node), w.ys)
        dense.put_on_rows(K, s, m, w, at_node(node), w.ys)
        t = s.t_old + at_node(node) * s.hs
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
        a, b = at_node(node), at_node(node + 1)
        ga, gb = w.guards[node, i], w.guards[node + 1, i]
        if ga > 0.0 and not gb > 0.0:
            return root(K, s, m, w, mode, SWITCH, i, a, ga, b, gb)
        if node + 2 < NODES and ga > 0.0 and gb > 0.0:
            place, value = dip(K, s, m, w, mode, SWITCH, i, node, ga, gb, w.guards[node + 2, i])
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
        dense.state(s, m, w, at_node(node), w.ys)
        K.watch(s.t_old + at_node(node) * s.hs, w.ys[: s.n], w.ys[s.n :], m.p, w.guards[node])
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
                hit[i] = free_flight(s, w, i)
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
