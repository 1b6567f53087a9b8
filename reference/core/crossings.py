"""Where in a step one guard of one row falls below zero first.

A gap is searched by the sign of its rate as well: where the rate changes sign the gap has its extremum, which decides,
so that a contact entirely inside one step is found. So is a dip of a multiplier between two nodes, and a hand-over.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference._cache import compiled, inlined
from crossbody.reference._kinds import Bytes
from crossbody.reference.core.guards import (
    HANDOVER,
    LEAVE,
    PRESS,
    RATE,
    RATE_DOWN,
    RELEASE,
    TOUCH,
    TOUCH_INSIDE,
    dead_band,
    guard,
    rise,
    root,
)
from crossbody.reference.core.layout import NEVER, NODES, Model, Work
from crossbody.reference.core.machine import slow

NEAR = 0.25  # of the range in the step: seen at twelve stages, a value does not come from farther to zero
DIPS = 12  # parabolas that close in a minimum
SHARP = 1e-7  # part of the step within which a minimum is known: its value is then known to rounding
INSIDE = 0.05  # part of the way from a node to the least value found: a minimum is looked for no closer to the node


@inlined
def _extremum(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int, node: int, lowest: bool) -> float:
    """Where the gap of row i has its minimum (or maximum) between a node and the next."""
    a, b = at_node(node), at_node(node + 1)
    ra, rb = w.rates[node, i], w.rates[node + 1, i]
    if lowest:
        return root(K, s, m, w, mode, RATE, i, a, -ra, b, -rb)
    return root(K, s, m, w, mode, RATE_DOWN, i, a, ra, b, rb)


@inlined
def at_node(node: int) -> float:
    """Place of a node in the step, 0 to 1."""
    return node / (NODES - 1.0)


@inlined
def touch(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """First contact of a FREE row that starts above the surface."""
    for node in range(NODES - 1):
        a, b = at_node(node), at_node(node + 1)
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
def touch_inside(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """First closing of a FREE row that starts on the surface."""
    closing = w.rates[0, i] + slow(s)
    before = max(w.gaps[0, i] - s.touch, closing)
    for node in range(1, NODES):
        value = max(w.gaps[node, i] - s.touch, w.rates[node, i] + slow(s))
        if value < 0.0:
            return root(K, s, m, w, mode, TOUCH_INSIDE, i, at_node(node - 1), max(before, 1e-300), at_node(node), value)
        before = value
    return NEVER


@inlined
def leave(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """First rise above the surface."""
    for node in range(NODES - 1):
        a, b = at_node(node), at_node(node + 1)
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
def by_nodes(K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int) -> float:
    """First firing of a guard that is known at the nodes only where it is evaluated (CATCH, PRESS, TOUCH_INSIDE)."""
    before = 1e-300
    for node in range(1, NODES):
        if kind != PRESS and not w.rates[node, i] < -slow(s):
            before = 1e-300
            continue
        value = guard(K, s, m, w, mode, kind, i, at_node(node))
        if value < 0.0:
            return root(K, s, m, w, mode, kind, i, at_node(node - 1), before, at_node(node), value)
        before = max(value, 1e-300)
    return NEVER


@inlined
def release(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """First loss of pressure of an active row, in a dip between nodes too."""
    dead = dead_band(s, w, i)
    for node in range(NODES - 1):
        a, b = at_node(node), at_node(node + 1)
        la, lb = max(w.lams[node, i] + dead, 1e-300), w.lams[node + 1, i] + dead
        if not lb >= 0.0:
            return root(K, s, m, w, mode, RELEASE, i, a, la, b, lb)
        if node + 2 < NODES:
            place, value = dip(K, s, m, w, mode, RELEASE, i, node, la, lb, w.lams[node + 2, i] + dead)
            if value < 0.0:
                left, g_left = (a, la) if place <= b else (b, max(lb, 1e-300))
                return root(K, s, m, w, mode, RELEASE, i, left, g_left, place, value)
    return NEVER


@compiled
def dip(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, node: int, f0: float, f1: float, f2: float
) -> tuple[float, float]:
    """A place between this node and the next but one where a guard is below zero; (NEVER, 1) if there is none.

    The guard's minimum is closed in by parabolas, each through the least value found and the two beside it: a dip of a
    millionth of what the guard varies by is enough to switch. That is done only where the first comes near to zero. A
    dip close to the first or last node lies outside that parabola's reach: it is looked for from the inside.
    """
    x0, x1, x2 = at_node(node), at_node(node + 1), at_node(node + 2)
    bend = f0 - 2.0 * f1 + f2
    if not bend > 0.0 or f1 - (f0 - f2) ** 2 / (8.0 * bend) > NEAR * max(f0, f2) or abs(f0 - f2) > 4.0 * bend:
        return NEVER, 1.0
    x = x1 + 0.5 * (x1 - x0) * (f0 - f2) / bend
    for _ in range(DIPS):
        x = min(max(x, x0 + INSIDE * (x1 - x0)), x2 - INSIDE * (x2 - x1))
        if abs(x - x1) < SHARP:
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
def handed_over(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """First instant at which the elastic part of a COLLISION's multiplier is spent, at a node or in a kink between.

    The absolute values in it make it least where the gap or its rate passes through zero, however briefly.
    """
    before = max(guard(K, s, m, w, mode, HANDOVER, i, 0.0), 1e-300)
    for node in range(NODES - 1):
        a, b = at_node(node), at_node(node + 1)
        for place in (_passage(K, s, m, w, mode, i, node), _turning(K, s, m, w, mode, i, node), b):
            if place < NEVER:
                value = guard(K, s, m, w, mode, HANDOVER, i, place)
                if value <= 0.0:
                    return root(K, s, m, w, mode, HANDOVER, i, a, before, place, value)
        before = max(value, 1e-300)
    return NEVER


@inlined
def _passage(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int, node: int) -> float:
    """Where the gap passes through zero between a node and the next; NEVER if it does not."""
    a, b = at_node(node), at_node(node + 1)
    ha, hb = w.gaps[node, i], w.gaps[node + 1, i]
    if ha > 0.0 > hb:
        return root(K, s, m, w, mode, TOUCH, i, a, ha, b, hb)
    if ha < 0.0 < hb:
        return root(K, s, m, w, mode, LEAVE, i, a, -ha, b, -hb)
    return NEVER


@inlined
def _turning(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int, node: int) -> float:
    """Where the gap's rate does."""
    ra, rb = w.rates[node, i], w.rates[node + 1, i]
    return _extremum(K, s, m, w, mode, i, node, bool(ra < 0.0)) if ra * rb < 0.0 else NEVER


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
def free_flight(s: Any, w: Work, i: int) -> float:
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
