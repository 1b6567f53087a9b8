"""What changes at once in the ball maze: channel, sectors, the controller's mode, and whose contact a row is.

A ball that rolls over the edge of a gap keeps its contact: the row of the face hands its mode to
the row of the tip there, and back. In a gap the ball's centre passes the circle of the tips'
centres: the ring below becomes the ring above, and the tips keep their modes in the other slots.

The maze may turn by many gaps within one step. The distance to a sector's edges is therefore counted from
where the ball entered the sector, without wrapping the maze's angle: once passed, an edge stays passed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.kernels import CHANGED, LOST, START, TOUCHED, UNCHANGED
from crossbody.reference.kinds import Bytes, Floats
from crossbody.reference.systems._maze_layout import (
    ABOVE,
    ANGLE,
    BALANCE,
    BELOW,
    CENTRE,
    CHANNEL,
    FACE_ABOVE,
    FACE_BELOW,
    FROM_ABOVE,
    FROM_BELOW,
    GAPS,
    INNER,
    KIND,
    MODE,
    NORMAL,
    OFF,
    OUTER,
    PHASE,
    REACH,
    RINGS,
    SNATCH,
    SOLID,
    STRIDE,
    TABLE,
    TARGET,
    TIPS_ABOVE,
    TIPS_BELOW,
    TOUCHING,
    above,
    below,
    number,
)  # fmt: skip

INWARD, OUTWARD, EDGE_BELOW, EDGE_ABOVE, STRAYED = range(5)
GUARDS = 5
BAND = 1e-12  # dead band: metres on a radius of a tenth, radians
JUMPED = 1e-6  # angle from an edge at which the ball did not come there by moving, rad
STRAY = 0.5  # cosine of the angle from the top beyond which the balance has no way back: 60 degrees
FREE, CONTACT = 0, 1


@kernels.helper
def _middle(p: Any, line: int) -> Any:
    """Radius of the circle on which a ring's tips lie."""
    return 0.5 * (p[line + INNER] + p[line + OUTER])


@kernels.helper
def _offset(q: Any, p: Any, line: int) -> float:
    """Angle of the ball from the centre of the nearest gap, within half a spacing."""
    spacing = 2.0 * np.pi / p[line + GAPS]
    a = np.arctan2(q[2], q[1]) - q[0] - p[line + PHASE]
    return float(a - spacing * np.rint(a / spacing))


@kernels.helper
def _nearest(q: Any, p: Any, line: int) -> Any:
    """Number of the gap whose centre is nearest to the ball's angle."""
    n = number(p[line + GAPS])
    a = np.arctan2(q[2], q[1]) - q[0] - p[line + PHASE]
    return int(np.rint(a * n / (2.0 * np.pi))) % n


@kernels.helper
def _sector(q: Any, p: Any, line: int) -> Any:
    """Number of the gap that the ball's angle is in, or SOLID."""
    if p[line + GAPS] == 0.0 or abs(_offset(q, p, line)) >= p[line + REACH]:
        return SOLID
    return _nearest(q, p, line)


@kernels.helper
def _half(p: Any, line: int, sector: int) -> float:
    """Half the angle of a gap, or of the solid wall between two."""
    return float(np.pi / p[line + GAPS] - p[line + REACH] if sector == SOLID else p[line + REACH])


@kernels.helper
def _turned(q: Any, p: Any) -> float:
    """Angle by which the ball went round since it was latched, within half a turn."""
    a = np.arctan2(q[2], q[1]) - p[ANGLE]
    return float(a - 2.0 * np.pi * np.rint(a / (2.0 * np.pi)))


@kernels.helper
def _edge(q: Any, p: Any, line: int, sector: int, origin: int) -> float:
    """Angle to the nearer edge of the sector that the ball is in."""
    if p[line + GAPS] == 0.0:
        return 1.0
    return float(_half(p, line, sector) - abs(p[origin] + _turned(q, p) - q[0]) + BAND)


@kernels.helper
def _latch_one(q: Any, p: Any, line: int, sector: int, origin: int) -> None:
    if p[line + GAPS] > 0.0:
        a = _offset(q, p, line)
        middle = np.copysign(np.pi / p[line + GAPS], a) if sector == SOLID else 0.0
        p[origin] = a - middle + q[0]


@kernels.helper
def _latch(q: Any, p: Any) -> None:
    """Count the distances to the edges from here."""
    p[ANGLE] = np.arctan2(q[2], q[1])
    if number(p[CHANNEL]) > 0:
        _latch_one(q, p, below(p), number(p[BELOW]), FROM_BELOW)
    _latch_one(q, p, above(p), number(p[ABOVE]), FROM_ABOVE)


@kernels.helper
def _cosine(q: Any) -> float:
    """Of the angle from the top."""
    return float(q[2] / np.sqrt(q[1] * q[1] + q[2] * q[2]))


@kernels.watch
def watch(t: float, q: Floats, v: Floats, p: Floats, g: Floats) -> None:
    """Distances to the circle of the tips inward and outward, to the sectors' edges, and to where the ball is lost."""
    rho = np.sqrt(q[1] * q[1] + q[2] * q[2])
    lower, upper = number(p[BELOW]), number(p[ABOVE])
    inside = number(p[CHANNEL]) == 0
    g[INWARD] = 1.0 if inside or lower == SOLID else rho - _middle(p, below(p)) + BAND
    g[OUTWARD] = 1.0 if upper == SOLID else _middle(p, above(p)) - rho + BAND
    g[EDGE_BELOW] = 1.0 if inside else _edge(q, p, below(p), lower, FROM_BELOW)
    g[EDGE_ABOVE] = _edge(q, p, above(p), upper, FROM_ABOVE)
    g[STRAYED] = 1.0 if inside or p[KIND] == OFF else _cosine(q) - STRAY


@kernels.helper
def _locate(q: Any, p: Any) -> None:
    """Channel and sectors of a ball anywhere."""
    rho = np.sqrt(q[1] * q[1] + q[2] * q[2])
    channel = 0
    while channel < number(p[RINGS]) and _middle(p, TABLE + STRIDE * channel) < rho:
        channel += 1
    p[CHANNEL] = channel
    p[BELOW] = _sector(q, p, below(p)) if channel > 0 else SOLID
    p[ABOVE] = _sector(q, p, above(p))


@kernels.helper
def _aim(q: Any, p: Any) -> None:
    """Latch the maze's angle that puts the gap below under the ball as it is now, and go there."""
    p[TARGET] = q[0] + _offset(q, p, below(p))
    p[MODE] = SNATCH


@kernels.helper
def _take_charge(q: Any, p: Any) -> None:
    """Mode of the controller at the start."""
    if p[KIND] == OFF:
        p[MODE] = OFF
    elif number(p[CHANNEL]) == 0:
        p[MODE] = CENTRE
    elif number(p[BELOW]) == SOLID:
        p[MODE] = BALANCE
    else:
        _aim(q, p)


@kernels.helper
def _beyond(q: Any, p: Any, line: int, sector: int) -> Any:
    """The sector that follows: across the edge, or where the ball is if its angle jumped, as it does at the axis."""
    if abs(abs(_offset(q, p, line)) - p[line + REACH]) > JUMPED:
        return _sector(q, p, line)
    return _nearest(q, p, line) if sector == SOLID else SOLID


@kernels.helper
def _cross_edge(q: Any, p: Any, mode: Any, line: int, variable: int, face: int, tips: int) -> None:
    """Hand a contact from the face to the tip at this edge, or back."""
    tip = tips if _offset(q, p, line) < 0.0 else tips + 1
    before, after = number(p[variable]), _beyond(q, p, line, number(p[variable]))
    p[variable] = after
    if before == SOLID and after != SOLID:
        mode[tip] = mode[face]
        mode[face] = FREE
    elif before != SOLID and after == SOLID:
        mode[face] = mode[tip]
        mode[tips], mode[tips + 1] = FREE, FREE


@kernels.helper
def _cross_ring(q: Any, p: Any, mode: Any, inward: bool) -> None:
    """The ring whose gap the ball is in becomes that on the other side of it."""
    source, target = (TIPS_BELOW, TIPS_ABOVE) if inward else (TIPS_ABOVE, TIPS_BELOW)
    first, second = mode[source], mode[source + 1]
    mode[:NORMAL] = FREE
    mode[target], mode[target + 1] = first, second
    if inward:
        p[ABOVE] = p[BELOW]
        p[CHANNEL] -= 1.0
        p[BELOW] = _sector(q, p, below(p)) if number(p[CHANNEL]) > 0 else SOLID
    else:
        p[BELOW] = p[ABOVE]
        p[CHANNEL] += 1.0
        p[ABOVE] = _sector(q, p, above(p))
    if p[KIND] != OFF:
        p[MODE] = SNATCH


@kernels.helper
def _landed(p: Any, mode: Any) -> None:
    """A face that is touched ends the snatch, unless a gap is still below."""
    if number(p[MODE]) == SNATCH and number(p[BELOW]) == SOLID and (
        mode[FACE_BELOW] == CONTACT or mode[FACE_ABOVE] == CONTACT
    ):  # fmt: skip
        p[MODE] = CENTRE if number(p[CHANNEL]) == 0 else BALANCE


@kernels.switch
def switch(t: float, q: Floats, v: Floats, p: Floats, mode: Bytes, fired: int) -> int:
    """Apply what fired; a ball that strays outside ring 0 is lost."""
    before = p[TOUCHING], p[MODE]
    if fired == START:
        _locate(q, p)
        _take_charge(q, p)
    elif fired == EDGE_BELOW:
        _cross_edge(q, p, mode, below(p), BELOW, FACE_BELOW, TIPS_BELOW)
        if number(p[MODE]) == BALANCE and number(p[BELOW]) != SOLID:
            _aim(q, p)
    elif fired == EDGE_ABOVE:
        _cross_edge(q, p, mode, above(p), ABOVE, FACE_ABOVE, TIPS_ABOVE)
    elif fired in (INWARD, OUTWARD):
        _cross_ring(q, p, mode, fired == INWARD)
    if fired != TOUCHED:
        _latch(q, p)
    if p[KIND] != OFF and number(p[CHANNEL]) > 0 and (fired == STRAYED or _cosine(q) <= STRAY):
        return int(LOST)
    _landed(p, mode)
    p[TOUCHING] = 1.0 if mode[FACE_BELOW] == CONTACT or mode[FACE_ABOVE] == CONTACT else 0.0
    same = fired == TOUCHED and before == (p[TOUCHING], p[MODE])
    return int(UNCHANGED) if same else int(CHANGED)
