"""Where forces bend: bounds of actuators and activations, ends of a dead band, rest where drag grows as v |v|.

And where the curvature of a closed gap jumps: the nearest point of a solid comes to the end of its face or side.

A force goes on there, its derivative does not, and a step across loses its order. So the side on which a run is holds
from one such instant to the next, and each is an event; a side that is 0 is told by the value itself. A value is on the
other side once it is beyond by more than a band, which is what the tolerance leaves open in it: one that stays at its
bound stays on one side.
"""

from __future__ import annotations

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.kinds import Bytes, Floats
from crossbody.reference.pairs import layout as pairs
from crossbody.reference.tree import forces, layout
from crossbody.reference.tree.forces import by, clamped
from crossbody.reference.tree.pair_rows import bend

SMALL = 1e-3  # m or rad, and 1/s: coordinates are known to the tolerance of this at least
ROUNDING = 1e-14  # of a value
CLOSED = (1, 3, 6, 7)  # modes, as in crossbody.cases.Mode: CONTACT, COLLISION, STICK, SLIP
NONE = 1e200  # a bound beyond it is none
TIGHT = 1e-8  # tolerance above which v |v| is as good as smooth


@kernels.helper
def inputs(p: Floats) -> Floats:
    """Return the inputs in force."""
    return p[int(p[layout.AT_TOLD]) + 1 :]


@kernels.helper
def sums(t: float, q: Floats, v: Floats, u: Floats, p: Floats, w: Floats) -> Floats:
    """Return the sums (n,) of the actuators' forces, without their bounds; q if none of them bends."""
    if p[layout.SUMMED] == 0.0:
        return q
    found = np.zeros(len(v))
    forces.actuated(t, q, v, u, p, w, found)
    return found


@kernels.helper
def _value(
    t: float, q: Floats, v: Floats, u: Floats, p: Floats, w: Floats, total: Floats, k: int
) -> tuple[float, float, float]:
    """Return what kink k is looked for in, and its two bounds; both are 0 where it changes its sign."""
    o = int(p[layout.AT_KINK]) + layout.KINK * k
    kind, i = int(p[o]), int(p[o + layout.OF])
    at = int(p[layout.AT_ACTUATOR]) + layout.ACTUATOR * i
    if kind == layout.FORCE_BENDS:
        return forces.unbounded(t, q, v, u, p, w, i), p[at + layout.FORCE], p[at + layout.FORCE + 1]
    if kind == layout.ACTIVATION_BENDS:
        return forces.unheld(t, u, p, at, i), p[at + layout.SPAN], p[at + layout.SPAN + 1]
    if kind == layout.SUM_BENDS:
        at = int(p[layout.AT_DOF]) + layout.DOF * i + layout.SUM
        return total[i], p[at], p[at + 1]
    if kind == layout.DRAG_BENDS:
        return v[i], 0.0, 0.0
    if kind == layout.GAP_BENDS:
        x, half = bend(p, w, int(p[layout.AT_PAIR]) + pairs.PAIR * i, int(p[o + layout.BENDS]))
        return x, -half, half
    at = forces.tendon(p, i)
    length, speed = forces.measured(q, v, p, w, at)
    if kind == layout.SPRING_BENDS:
        return length, p[at + layout.BAND], p[at + layout.BAND + 1]
    return speed, 0.0, 0.0


@kernels.helper
def _left(x: float, low: float, high: float, band: float, now: int) -> float:
    """Return how far x is from the end of the side that holds, and 0 a band beyond it."""
    if low == high:
        return (x if now == layout.HIGH else -x) + band
    if now != layout.INSIDE:
        return (x - high if now == layout.HIGH else low - x) + band
    if low < -NONE or high > NONE:
        return (high - x if low < -NONE else x - low) + band
    return (x - low + band) * ((high - x + band) / (high - low + 2.0 * band))  # as far as the nearer one, and smooth


@kernels.helper
def _plain(p: Floats, k: int) -> bool:
    """Return whether kink k is that of an actuator on one hinge or slide."""
    o = int(p[layout.AT_KINK]) + layout.KINK * k
    at = int(p[layout.AT_ACTUATOR]) + layout.ACTUATOR * int(p[o + layout.OF])
    return bool(p[o] == layout.FORCE_BENDS and p[at + layout.SINGLE] > 0.0)


@kernels.helper
def look_plainly(q: Floats, v: Floats, p: Floats, g: Floats) -> None:
    """Do what `look` does, for actuators on one hinge or slide each: it calls nothing that is large."""
    first, sides, bands = int(p[layout.AT_TOLD]) + 1, int(p[layout.AT_BEND]), int(p[layout.AT_BAND])
    for k in range(len(g)):
        if not _plain(p, k):
            continue
        i, now = int(p[int(p[layout.AT_KINK]) + layout.KINK * k + layout.OF]), int(p[sides + k])
        at = int(p[layout.AT_ACTUATOR]) + layout.ACTUATOR * i
        a, gear = clamped(p[first + i], p[at + layout.CONTROL], p[at + layout.CONTROL + 1]), p[at + layout.GEAR]
        x = by(p, at, a, gear * q[int(p[at + layout.ANGLE])], gear * v[int(p[at + layout.WHICH])])
        left = _left(x, p[at + layout.FORCE], p[at + layout.FORCE + 1], p[bands + k], now)
        g[k] = 1.0 if now == layout.OPEN else left


@kernels.helper
def look(t: float, q: Floats, v: Floats, p: Floats, w: Floats, g: Floats) -> None:
    """Fill g of kinks that are not plain with how far they are: positive on the side that holds, 0 a band beyond it."""
    u, sides, bands = inputs(p), int(p[layout.AT_BEND]), int(p[layout.AT_BAND])
    total = sums(t, q, v, u, p, w)
    for k in range(len(g)):
        if _plain(p, k):
            continue
        now, band = int(p[sides + k]), p[bands + k]
        if now == layout.OPEN:
            g[k] = 1.0
            continue
        x, low, high = _value(t, q, v, u, p, w, total, k)
        g[k] = _left(x, low, high, band, now)


@kernels.helper
def _doubt(q: Floats, v: Floats, p: Floats, w: Floats, i: int) -> float:
    """Return what the tolerance leaves open in the force of actuator i, to first order in its length and rate."""
    o = int(p[layout.AT_ACTUATOR]) + layout.ACTUATOR * i
    x, speed = forces.moved(q, v, p, w, o)
    a = max(abs(p[o + layout.CONTROL]), abs(p[o + layout.CONTROL + 1]))
    if int(p[o + layout.ACTIVATION]) != layout.DIRECT or a > NONE:
        a = 1.0
    slope = abs(p[o + layout.GAIN + 1] * a) + abs(p[o + layout.BIAS + 1])
    drag = abs(p[o + layout.GAIN + 2] * a) + abs(p[o + layout.BIAS + 2])
    gear = SMALL * abs(p[o + layout.GEAR])
    return float(p[int(p[layout.AT_TOLD])] * (slope * (abs(x) + gear) + drag * (abs(speed) + gear)))


@kernels.helper
def doubts(q: Floats, v: Floats, p: Floats, w: Floats) -> Floats:
    """Return the same of the sums (n,) of forces, if one of them bends."""
    found, one = np.zeros(len(v)), np.zeros(len(v))
    if p[layout.SUMMED] > 0.0:
        for i in range(int(p[layout.ACTUATORS])):
            one[:] = 0.0
            forces.exert(p, w, int(p[layout.AT_ACTUATOR]) + layout.ACTUATOR * i, _doubt(q, v, p, w, i), one)
            found += np.abs(one)
    return found


@kernels.helper
def _band(q: Floats, v: Floats, p: Floats, w: Floats, open_: Floats, k: int, x: float) -> float:
    """Return how far beyond kink k its value x has to be."""
    o = int(p[layout.AT_KINK]) + layout.KINK * k
    kind, i, rtol = int(p[o]), int(p[o + layout.OF]), p[int(p[layout.AT_TOLD])]
    band = ROUNDING * abs(x)
    if kind == layout.FORCE_BENDS:
        band += _doubt(q, v, p, w, i)
    elif kind == layout.SUM_BENDS:
        band += open_[i]
    elif kind in (layout.SPRING_BENDS, layout.GAP_BENDS):
        band += rtol * (abs(x) + SMALL)
    elif kind != layout.ACTIVATION_BENDS:
        band += rtol * SMALL
    return band


@kernels.helper
def _rises(p: Floats, i: int) -> bool:
    """Return whether what drives the activation of actuator i lifts it."""
    u, o = inputs(p), int(p[layout.AT_ACTUATOR]) + layout.ACTUATOR * i
    c = forces.clamped(u[i], p[o + layout.CONTROL], p[o + layout.CONTROL + 1])
    a = u[int(p[o + layout.SINCE]) + 1] if int(p[o + layout.ACTIVATION]) == layout.FILTER else 0.0
    return bool(c > a)


@kernels.helper
def _found(p: Floats, k: int, x: float, low: float, high: float) -> int:
    """Return on which side of kink k a value x is."""
    o = int(p[layout.AT_KINK]) + layout.KINK * k
    if low == high:
        if p[int(p[layout.AT_TOLD])] > TIGHT:
            return layout.OPEN
        return layout.HIGH if x > 0.0 else layout.LOW
    leans = int(p[o]) == layout.ACTIVATION_BENDS and x in (low, high)
    if leans and _rises(p, int(p[o + layout.OF])) == (x == high):  # it stands still where it is
        return layout.HIGH if x == high else layout.LOW
    if x > high:
        return layout.HIGH
    return layout.LOW if x < low else layout.INSIDE


@kernels.helper
def choose(t: float, q: Floats, v: Floats, p: Floats, w: Floats, total: Floats, k: int, fired: bool) -> None:
    """Put kink k on the side on which its value is, or, if it has fired, on the other one."""
    side = int(p[layout.AT_BEND]) + k
    x, low, high = _value(t, q, v, inputs(p), p, w, total, k)
    if not fired:
        p[side] = _found(p, k, x, low, high)
    elif low == high:
        p[side] = layout.LOW if p[side] == layout.HIGH else layout.HIGH
    elif p[side] == layout.INSIDE:
        p[side] = layout.HIGH if x - low > high - x else layout.LOW
    else:
        p[side] = layout.INSIDE
    p[int(p[layout.AT_BAND]) + k] = _band(q, v, p, w, doubts(q, v, p, w), k, x)


@kernels.helper
def held(p: Floats) -> bool:
    """Return whether the side of a gap's kink is held."""
    if p[layout.GAPPED] > 0.0:
        for k in range(int(p[layout.KINKS])):
            gap = int(p[int(p[layout.AT_KINK]) + layout.KINK * k]) == layout.GAP_BENDS
            if gap and int(p[int(p[layout.AT_BEND]) + k]) != layout.OPEN:
                return True
    return False


@kernels.helper
def wants(p: Floats, k: int, mode: Bytes, given: bool) -> bool:
    """Return whether the side of kink k is to be chosen: at a change of inputs, or of a gap when it has just closed.

    Of a gap that has opened it is let go.
    """
    o, side = int(p[layout.AT_KINK]) + layout.KINK * k, int(p[layout.AT_BEND]) + k
    if int(p[o]) != layout.GAP_BENDS:
        return given
    closed = mode[int(p[o + layout.BENT_ROW])] in CLOSED
    if not closed:
        p[side] = layout.OPEN
    return closed and p[side] == layout.OPEN
