"""The guards of the state machines as functions of a place in the step, and the place where one fires."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core import dense
from crossbody.reference.core.acceleration import GENERAL, OWN, accelerate
from crossbody.reference.core.algebra import ULP, inverse_diagonal
from crossbody.reference.core.friction import (
    DETERMINANT,
    MARGIN,
    ask,
    bound,
    decided_to,
    has_begun,
    least_slip,
    most_drift,
    slip,
    slip_along,
    small_slip,
)
from crossbody.reference.core.layout import HANDOVER_PART, MEMORYLESS, NODES, Model, Work
from crossbody.reference.core.machine import multiplier_if_active, off_law, slow
from crossbody.reference.kinds import Array, Bytes

# Guards: each fires where all of its functions are below zero.
NONE, TOUCH, TOUCH_INSIDE, RELEASE, LEAVE, CATCH, PRESS, HANDOVER, SWITCH, CONE, STOP, JAM, DRIFT = np.arange(13)
FUNCTIONS = np.array([0, 1, 2, 1, 1, 2, 1, 4, 1, 1, 1, 1, 1])
ON_BOUND = 1e-10  # part of the bound of a contact's friction below which one that sticks has only begun to
GRAZE = 0.1  # part of the least slip velocity by which one may pass zero
REDUNDANT = 1e30  # for a row that the active ones determine: it has no multiplier of its own, so that nothing fires


@compiled
def _multiplier(K: Any, s: Any, m: Model, w: Work, i: int, t: float, known: bool) -> float:
    """Lam of the active row i at the state in ys; `known` if it is there already."""
    if not known and accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, w.ys[: s.nq], w.ys[s.nq :], OWN) != 0:
        return np.nan
    for j in range(s.na):
        if w.idx[j] == i:
            return float(w.la[j])
    return np.nan


@compiled
def _handover(K: Any, s: Any, m: Model, w: Work, i: int, t: float, known: bool) -> None:
    """Elastic part c |h'| + b0 |h| less eps lam_i / (G^-1)_ii: positive while the elastic part of lam still counts.

    c is b1, but at least sqrt(b0): with b1 alone a weakly damped collision would be spent at each passage of h
    through zero, one without damping at its touch. With either sign for either absolute value it is four smooth
    functions, of which the largest counts.
    """
    elastic, spring, inertial = np.nan, 0.0, 0.0
    if known or accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, w.ys[: s.nq], w.ys[s.nq :], GENERAL) == 0:
        for j in range(s.na):
            if w.idx[j] == i:
                elastic = max(w.law[i, 1], np.sqrt(w.law[i, 0])) * w.hda[j]
                spring = w.law[i, 0] * w.ha[j]
                inertial = HANDOVER_PART * w.la[j] / inverse_diagonal(w.G, s.na, w.reach, j, w.scale)
    w.parts[0], w.parts[1] = elastic + spring - inertial, elastic - spring - inertial
    w.parts[2], w.parts[3] = spring - elastic - inertial, -elastic - spring - inertial


@compiled
def rise(s: Any) -> float:
    """How far a gap must open before a row is FREE: one without memory, held at the surface, rounds to either side."""
    return float(s.touch) if s.fsm == MEMORYLESS else 0.0


@compiled
def arm(s: Any, m: Model, w: Work, kind: int, i: int) -> None:
    """Where the functions of a guard count as zero: at zero if they start clearly off it, else beyond what is noise.

    A rate, or a multiplier, that starts as zero but for rounding would fire on it. One that was clear of it is located
    at its true zero.
    """
    w.bands[:] = 0.0
    if kind == RELEASE and (s.fsm == MEMORYLESS or abs(w.lams[0, i]) <= w.noise[i]):
        w.bands[0] = w.noise[i]  # a row without memory may press again at once
    elif kind == TOUCH_INSIDE and abs(w.rates[0, i]) <= slow(s, w, i):
        w.bands[1] = slow(s, w, i)
    elif kind == CATCH:
        w.bands[0] = slow(s, w, i) if abs(w.rates[0, i]) <= slow(s, w, i) else 0.0
        w.bands[1] = 2.0 * decided_to(s) if s.frictional else 0.0
    elif kind == STOP:
        # A slip that grazes zero goes on; one that has just begun is known no better than a slip with no direction.
        below = small_slip(s, w, i) if has_begun(w, i) else GRAZE * least_slip(s)
        w.bands[0] = max(-slip_along(m, w, i, w.rates[0]), 0.0) + below
    elif kind == DRIFT and 2.0 * slip(m, w, i, w.rates[0]) > most_drift(s, w, i):
        # It has been found to move: until it does so more.
        w.bands[0] = 2.0 * slip(m, w, i, w.rates[0]) - most_drift(s, w, i)
    elif kind == CONE:
        begun = max(ON_BOUND * bound(m, i, abs(w.lams[0, i])), w.tolerated[i])
        if w.cones[0, i] <= begun:
            w.bands[0] = 2.0 * begun


@compiled
def _of_friction(K: Any, s: Any, m: Model, w: Work, what: int, i: int, t: float, y: Array) -> None:
    """Leave in w.parts how far contact i is from sliding (MARGIN), or from a jam (DETERMINANT)."""
    w.parts[0] = np.nan
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, y[: s.nq], y[s.nq :], GENERAL) == 0:
        w.parts[0] = ask(what, s, m, w, i)


@compiled
def functions(K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, theta: float) -> None:
    """The functions of one guard at the part theta of the step, into w.parts."""
    s.guards += 1
    dense.state(s, m, w, theta, w.ys)
    t = s.t_old + theta * s.hs
    q, v = w.ys[: s.nq], w.ys[s.nq :]
    known = kind in (RELEASE, HANDOVER) and dense.put_on_rows(K, s, m, w, theta, w.ys, dense.ARRIVED)
    if kind == RELEASE:
        w.parts[0] = _multiplier(K, s, m, w, i, t, known)
    elif kind == HANDOVER:
        _handover(K, s, m, w, i, t, known)
    elif kind == SWITCH:
        K.watch(t, q, v, m.p, w.guard)
        w.parts[0] = w.guard[i]
    elif kind == PRESS:
        lam = multiplier_if_active(K, s, m, w, mode, i, t, q, v)
        w.parts[0] = w.noise[i] - lam if lam > -np.inf else REDUNDANT
    elif kind in (CONE, JAM):
        _of_friction(K, s, m, w, MARGIN if kind == CONE else DETERMINANT, i, t, w.ys)
    elif kind == STOP:
        K.gaps(t, q, v, m.p, w.gap, w.rate)
        w.parts[0] = slip_along(m, w, i, w.rate)
    elif kind == DRIFT:
        K.gaps(t, q, v, m.p, w.gap, w.rate)
        w.parts[0] = most_drift(s, w, i) - slip(m, w, i, w.rate)
    else:
        K.gaps(t, q, v, m.p, w.gap, w.rate)
        h, rate = w.gap[i], w.rate[i]
        if kind == TOUCH:
            w.parts[0] = h
        elif kind == LEAVE:
            w.parts[0] = rise(s) - h
        elif kind == TOUCH_INSIDE:
            w.parts[0], w.parts[1] = h - s.touch, rate
        else:
            w.parts[0] = rate
            if s.frictional:  # its multiplier is infinite where it would jam, and says nothing where rows are dependent
                w.parts[1] = off_law(K, s, m, w, i, t, q, v)
            else:
                lam = multiplier_if_active(K, s, m, w, mode, i, t, q, v)
                w.parts[1] = -lam if lam > -np.inf else REDUNDANT
    for j in range(FUNCTIONS[kind]):
        w.parts[j] += w.bands[j]


@compiled
def guard(K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, theta: float) -> float:
    """Value of one guard at the part theta of the step: positive until it fires."""
    functions(K, s, m, w, mode, kind, i, theta)
    return largest(w, FUNCTIONS[kind])


@compiled
def largest(w: Work, count: int) -> float:
    """The largest of a guard's functions."""
    value = w.parts[0]
    for j in range(1, count):
        value = max(value, w.parts[j])
    return float(value)


@compiled
def _rounding(s: Any, w: Work) -> float:
    """What rounding of the positions makes of a gap."""
    largest = 0.0
    for a in range(s.nq):
        largest = max(largest, abs(w.y[a]))
    return 8.0 * ULP * largest


@compiled
def fill_step(K: Any, s: Any, m: Model, w: Work, mode: Bytes, kind: int, i: int, row: Array) -> float:
    """A guard's functions at the nodes, and in w.tiny what rounding makes of them.

    Returns:
        The first function's derivative over the rate of the gap; 0 if it is none of the gap.
    """
    arm(s, m, w, kind, i)
    w.tiny[:] = 0.0
    scale = 0.0
    if kind in (TOUCH, TOUCH_INSIDE, LEAVE):
        scale = -s.hs if kind == LEAVE else s.hs
        w.tiny[0], w.tiny[1] = _rounding(s, w), 8.0 * ULP * s.speed
    elif kind == RELEASE:
        w.tiny[0] = w.noise[i]
    elif kind == CATCH:
        w.tiny[0] = 8.0 * ULP * s.speed
    for node in range(NODES):
        if kind in (TOUCH, TOUCH_INSIDE):
            row[node] = w.gaps[node, i] - (s.touch if kind == TOUCH_INSIDE else 0.0)
            row[NODES + node] = w.rates[node, i] + w.bands[1]
        elif kind == LEAVE:
            row[node] = rise(s) - w.gaps[node, i]
        elif kind == RELEASE:
            row[node] = w.lams[node, i] + w.bands[0]
        elif kind == SWITCH:
            row[node] = w.guards[node, i]
        elif kind == STOP:
            row[node] = slip_along(m, w, i, w.rates[node]) + w.bands[0]
        elif kind == DRIFT:
            row[node] = most_drift(s, w, i) - slip(m, w, i, w.rates[node]) + w.bands[0]
        elif kind in (CONE, JAM):
            row[node] = w.cones[node, i] + w.bands[0]
        else:
            functions(K, s, m, w, mode, kind, i, at_node(node))
            for j in range(FUNCTIONS[kind]):
                row[j * NODES + node] = w.parts[j]
    if kind != SWITCH:  # it may stay below zero after it has fired, and fires again once it has risen
        _lift(row, FUNCTIONS[kind])
    return float(scale)


@compiled
def _lift(row: Array, count: int) -> None:
    """Let a guard that starts below zero start at zero: it fires if it falls from there."""
    most = 0
    for j in range(1, count):
        most = j if row[j * NODES] > row[most * NODES] else most
    row[most * NODES] = max(row[most * NODES], 0.0)


@compiled
def at_node(node: int) -> float:
    """Place of a node in the step, 0 to 1."""
    return node / (NODES - 1.0)


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
    if kind == JAM:  # behind it a multiplier that grows without bound has the other sign
        return x1 if f1 > 0.0 else x2
    return x2 if f1 > 0.0 else x1


@compiled
def _next_part(x1: float, f1: float, x2: float, f2: float, x3: float, f3: float) -> float:
    """Part of the way from x1 to x2: inverse quadratic interpolation where it is safe, bisection where not."""
    if x3 in (x1, x2) or f3 in (f1, f2):
        return 0.5
    xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
    if not (0.0 < xi < 1.0 and 1.0 - np.sqrt(1.0 - xi) < phi < np.sqrt(xi)):
        return 0.5
    return float(f1 / (f1 - f2) * f3 / (f3 - f2) - (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f2 - f3))
