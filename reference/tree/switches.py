"""What a scene is branched on: how two shapes lie, from which side a ball joint's angle counts, where forces bend.

Each is a variable that holds from one instant to the next: inside a step the rows go on as smooth as the motion.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.kernels import CHANGED, GIVEN, START, TOUCHED, UNCHANGED
from crossbody.reference.kinds import Bytes, Floats
from crossbody.reference.pairs import layout as pairs
from crossbody.reference.tree import balls, kinks, layout
from crossbody.reference.tree import pair_slip as slip
from crossbody.reference.tree.pair_rows import axis, cap, chosen, lowest, touch, turn, upside_down
from crossbody.reference.tree.quantities import declared, posed

PAIRED = True  # as in `mechanism`
FREE = 0  # a mode, as in crossbody.cases.Mode
ASIDE = 1e-2  # rad, from where a load leans to the first point on which a cylinder stands


@kernels.helper
def _pair(p: Floats, i: int) -> int:
    """Return where the pair of row i stands, if that is its first row and it lies in more than one way; else -1."""
    row = int(p[layout.AT_ROW]) + layout.ROW * i
    if int(p[row]) != layout.CONTACT or int(p[row + pairs.PLACE]) != 0:
        return -1
    o = int(p[layout.AT_PAIR]) + pairs.PAIR * int(p[row + pairs.WHICH])
    return o if p[o + pairs.LIES] >= 0.0 else -1


@kernels.helper
def _posed(q: Floats, v: Floats, p: Floats) -> Floats:
    """Return the scratch of the outward sweep, if something looks at poses."""
    return posed(q, v, p) if p[layout.LYING] > 0.0 or p[layout.SPANNED] > 0.0 or kinks.held(p) else q


def watch(t: float, q: Floats, v: Floats, p: Floats, g: Floats) -> None:
    """Of every bound of a ball joint how far it is from half a turn, of pairs from lying otherwise, of kinks."""
    bends = int(p[layout.KINKS])
    first = len(g) - bends
    if p[layout.PLAIN] > 0.0:
        kinks.look_plainly(q, v, p, g[first:])
    if first == 0 and p[layout.PLAIN] == bends:
        return
    w = _posed(q, v, p)
    if p[layout.PLAIN] < bends:
        kinks.look(t, q, v, p, w, g[first:])
    if first == 0:
        return
    for i in range(int(p[layout.ROWS])):
        o = int(p[layout.AT_ROW]) + layout.ROW * i
        if int(p[o]) == layout.BALL_LIMIT:
            g[int(p[o + balls.WHICH])] = balls.to_half_a_turn(q, p, o)
            continue
        o = _pair(p, i) if PAIRED else -1
        if PAIRED and o >= 0:
            k = int(p[o + pairs.LIES])
            g[k] = turn(p, w, o, int(p[int(p[layout.AT_SIDE]) + k]))


@kernels.helper
def _rubs(p: Floats, o: int) -> bool:
    """Return whether the pair at p[o:] has friction."""
    for i in range(int(p[layout.ROWS])):
        row = int(p[layout.AT_ROW]) + layout.ROW * i
        at = int(p[layout.AT_PAIR]) + pairs.PAIR * int(p[row + pairs.WHICH])
        if int(p[row]) == layout.TANGENT and at == o:
            return True
    return False


@kernels.helper
def _leans(p: Floats, w: Floats, o: int) -> float:
    """Return the angle about a cylinder's axis to which its load leans at the start: as it slides, or else downhill.

    A load that comes to the rim finds a point there, and not so near that the points beside it neither bear nor part.
    """
    two = o + pairs.SECOND
    E, X, Y = cap(p, w, two, upside_down(p, w, o)), axis(p, w, two, 0), axis(p, w, two, 1)
    V, A = slip.apart(p, w, o, E)
    x, y = slip.velocity(V, A, X)[0], slip.velocity(V, A, Y)[0]
    if x == 0.0 and y == 0.0:
        for k in range(3):
            x, y = x + p[layout.GRAVITY + k] * X[k][0], y + p[layout.GRAVITY + k] * Y[k][0]
    return float(np.arctan2(y, x) + ASIDE) if x != 0.0 or y != 0.0 else lowest(p, w, o)


@kernels.helper
def _stand(p: Floats, w: Floats, o: int, i: int, mode: Bytes, before: int) -> None:
    """Hand over between lowest and highest points of a cylinder's caps and the points of its rim.

    The points count from the lowest one, so that the opposite one is the highest: what rocks in a plane feels nothing.
    Of one with friction that stands at the start they count from where its load leans to.
    """
    k = int(p[layout.AT_SIDE])
    now = int(p[k + int(p[o + pairs.LIES])])
    if now != pairs.CROSSED:
        leans = before == pairs.UNDECIDED and _rubs(p, o)
        p[k + int(p[o + pairs.PHASE])] = _leans(p, w, o) if leans else lowest(p, w, o)
    if before == pairs.CROSSED:
        cap = i + (0 if now == pairs.ALONG else 2)
        low, high = mode[cap], mode[cap + 1]
        mode[i], mode[i + 1], mode[i + 2], mode[i + 3] = low, FREE, high, FREE
    elif before != pairs.UNDECIDED:
        turned = lowest(p, w, o) - p[k + int(p[o + pairs.PHASE])]
        first = int(np.round(turned / (0.5 * np.pi))) % 4
        low, high = mode[i + first], mode[i + (first + 2) % 4]
        cap = i + (0 if before == pairs.ALONG else 2)
        mode[i], mode[i + 1], mode[i + 2], mode[i + 3] = FREE, FREE, FREE, FREE
        mode[cap], mode[cap + 1] = low, high


@kernels.helper
def _lie(p: Floats, w: Floats, o: int, i: int, mode: Bytes) -> None:
    """Let the shapes whose rows begin at i lie otherwise than before; what touched touches where they are nearest."""
    k, stands = int(p[layout.AT_SIDE]) + int(p[o + pairs.LIES]), int(p[o]) == pairs.PLANE
    row = int(p[layout.AT_ROW]) + layout.ROW * i
    start, before = p[k] == pairs.UNDECIDED, int(p[k])
    if start:
        p[k] = chosen(p, w, o)
    elif before != pairs.CROSSED:
        p[k] = pairs.CROSSED
    else:
        p[k] = pairs.UPSIDE_DOWN if stands and upside_down(p, w, o) else pairs.ALONG
    if stands:
        _stand(p, w, o, i, mode, before)
    elif start:
        return
    elif p[k] == pairs.CROSSED:
        if mode[i] == FREE or mode[i + 1] in kinks.CLOSED:
            mode[i] = mode[i + 1]
        mode[i + 1] = FREE
    elif touch(p, w, o, row + layout.ROW)[0][0] < touch(p, w, o, row)[0][0]:
        mode[i], mode[i + 1] = mode[i + 1], mode[i]


@kernels.helper
def _bend(t: float, q: Floats, v: Floats, p: Floats, mode: Bytes, fired: int) -> None:
    """Choose the sides of kinks that are to be chosen, and change the one that has come to its end."""
    sides, looked, w, total = int(p[layout.AT_BEND]) - int(p[layout.AT_SIDE]), False, q, q
    for k in range(int(p[layout.KINKS])):
        anew = kinks.wants(p, k, mode, fired == GIVEN)
        if not anew and fired != sides + k:
            continue
        if not looked:
            looked, w = True, posed(q, v, p)
            total = kinks.sums(t, q, v, kinks.inputs(p), p, w)
        kinks.choose(t, q, v, p, w, total, k, not anew)


def switch(t: float, q: Floats, v: Floats, p: Floats, mode: Bytes, fired: int) -> int:
    """Choose sides and ways at the start, and change the one that has come to its end.

    Sides of kinks are chosen whenever the inputs change.
    """
    first, sides = int(p[layout.AT_SIDE]), int(p[layout.AT_BEND]) - int(p[layout.AT_SIDE])
    if fired in (TOUCHED, GIVEN) or fired >= sides:
        _bend(t, q, v, p, mode, fired)
        return int(UNCHANGED if fired == TOUCHED else CHANGED)
    w = _posed(q, v, p)
    for i in range(int(p[layout.ROWS])):
        o, pair = int(p[layout.AT_ROW]) + layout.ROW * i, _pair(p, i) if PAIRED else -1
        if int(p[o]) == layout.BALL_LIMIT:
            k = int(p[o + balls.WHICH])
            if fired == START:
                p[first + k] = -1.0 if q[int(p[o + balls.AT_Q])] < 0.0 else 1.0
            elif fired == k:
                p[first + k] *= -1.0
        elif PAIRED and pair >= 0 and fired in (START, int(p[pair + pairs.LIES])):
            _lie(p, w, pair, i, mode)
    return int(CHANGED if fired >= 0 else UNCHANGED)


@cache
def switching_kernels(paired: bool) -> dict[str, Any]:
    """Return the kernels of switches, of a scene whose shapes may meet or of another (`quantities.row_kernels`)."""
    return declared((watch, switch), paired)
