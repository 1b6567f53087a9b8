"""What changes at once in the maze: channel, sectors, the controller's mode, rows; and the torque that balances.

    edge      the ball passes the end of a wall: the row of the face hands its mode to that of the tip there, and back
    middle    its centre passes the circle on which a gap's tips lie: they are those of the ring on its other side
    control   BALANCE -> SNATCH where the ring below opens; SNATCH -> BALANCE or CENTRE at the next touch of a face

Written apart from the reference's kernels, so that each checks the other; see `crossbody.cases.gates`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.cases.gates import CHANGED, LOST, SEEN, START, UNCHANGED
from crossbody.cases.mechanisms.maze.rows import (
    ABOVE,
    BALANCE,
    BALL_INERTIA,
    BALL_MASS,
    BELOW,
    CENTRE,
    CENTRE0,
    CENTRE1,
    CENTRE2,
    CHANNEL,
    COLUMNS,
    CONTROL,
    DRAG,
    GAPS,
    GRAVITY,
    INNER,
    MAZE_INERTIA,
    MOST_TORQUE,
    MOST_TURN,
    NORMALS,
    OFF,
    OMEGA,
    ON,
    OUTER,
    PHASE,
    RADIUS,
    REACH,
    RINGS,
    SECTOR_ABOVE,
    SECTOR_BELOW,
    SNATCH,
    SOLID,
    TABLE,
    TARGET,
    TOP0,
    TOP1,
    TOP2,
    TOUCHING,
    WN,
    bounded,
    line,
    wrapped,
)

Modes = NDArray[np.int8]
EDGE_BELOW, EDGE_ABOVE, INWARD, OUTWARD, STRAYED = range(5)
GUARDS = 5
DEAD_BAND = 1e-12  # by how much a position must pass an edge before it can come back over it, relative
GIVEN_UP = math.radians(60.0)  # angle from the top beyond which the controller has no way back, rad
FREE, CONTACT = 0, 1


def guards(q: Floats, p: Floats, g: Floats) -> None:
    """Write how far the ball is from its sectors' edges, from the rings' middles, and from being lost."""
    below, above = line(p, True), line(p, False)
    rho = math.sqrt(q[1] * q[1] + q[2] * q[2])
    inside = p[CHANNEL] == 0.0
    g[EDGE_BELOW] = 1.0 if inside else _to_edge(q, p, below, int(p[SECTOR_BELOW]))
    g[EDGE_ABOVE] = _to_edge(q, p, above, int(p[SECTOR_ABOVE]))
    g[INWARD] = 1.0 if p[SECTOR_BELOW] == SOLID else rho / _middle(p, below) - 1.0 + DEAD_BAND
    g[OUTWARD] = 1.0 if p[SECTOR_ABOVE] == SOLID else 1.0 - rho / _middle(p, above) + DEAD_BAND
    g[STRAYED] = 1.0 if inside or p[ON] == 0.0 else GIVEN_UP - _from_top(q)


def switch(q: Floats, p: Floats, modes: Modes, fired: int) -> int:
    """Apply what fired; a ball that strays outside ring 0 is lost."""
    channel, below, above, control, touching = p[CHANNEL], p[SECTOR_BELOW], p[SECTOR_ABOVE], p[CONTROL], p[TOUCHING]
    if fired in (START, SEEN):
        _locate(q, p)
    if fired == START:
        p[CONTROL] = OFF if p[ON] == 0.0 else CENTRE if p[CHANNEL] == 0.0 else BALANCE
    elif fired == EDGE_BELOW:
        _over_edge(q, p, modes, True)
    elif fired == EDGE_ABOVE:
        _over_edge(q, p, modes, False)
    elif fired in (INWARD, OUTWARD):
        _through_gap(q, p, modes, fired == INWARD)
    if fired != START and p[CHANNEL] != channel and p[ON] != 0.0:
        p[CONTROL] = SNATCH
    if fired == STRAYED or (p[ON] != 0.0 and p[CHANNEL] > 0.0 and _from_top(q) >= GIVEN_UP):
        return LOST
    if p[CONTROL] == BALANCE and p[SECTOR_BELOW] != SOLID:
        p[CONTROL], p[TARGET] = SNATCH, q[0] + _off_centre(q, p, line(p, True), int(p[SECTOR_BELOW]))
    p[TOUCHING] = modes[BELOW] == CONTACT or modes[ABOVE] == CONTACT
    if p[CONTROL] == SNATCH and p[TOUCHING] and p[SECTOR_BELOW] == SOLID:
        p[CONTROL] = CENTRE if p[CHANNEL] == 0.0 else BALANCE
    moved = channel != p[CHANNEL] or below != p[SECTOR_BELOW] or above != p[SECTOR_ABOVE]
    return CHANGED if moved or control != p[CONTROL] or touching != p[TOUCHING] else UNCHANGED


def _middle(p: Floats, at: int) -> float:
    """Return the radius of the circle on which a ring's tips lie, m."""
    return float(0.5 * (p[at + INNER] + p[at + OUTER]))


def _from_top(q: Floats) -> float:
    return abs(math.atan2(q[1], q[2]))


def _angle(q: Floats) -> float:
    """Return that of the ball in the maze's frame, rad."""
    return float(math.atan2(q[2], q[1]) - q[0])


def _off_centre(q: Floats, p: Floats, at: int, gap: int) -> float:
    """Return the angle of the ball from the middle of a gap, rad."""
    return wrapped(_angle(q) - p[at + PHASE] - math.tau * gap / p[at + GAPS])


def _nearest(q: Floats, p: Floats, at: int) -> int:
    """Return the number of the gap whose middle is nearest to the ball's angle."""
    return int(np.rint((_angle(q) - p[at + PHASE]) * p[at + GAPS] / math.tau)) % int(p[at + GAPS])


def _sector(q: Floats, p: Floats, at: int) -> int:
    """Return the number of the gap that the ball's angle is in, or SOLID."""
    if p[at + GAPS] == 0.0:
        return SOLID
    gap = _nearest(q, p, at)
    return gap if abs(_off_centre(q, p, at, gap)) < p[at + REACH] else SOLID


def _to_edge(q: Floats, p: Floats, at: int, sector: int) -> float:
    """Return the angle to the nearest end of the sector that the ball is in, rad; pi on a closed wall."""
    if p[at + GAPS] == 0.0:
        return math.pi
    if sector != SOLID:
        return float(p[at + REACH]) - abs(_off_centre(q, p, at, sector)) + DEAD_BAND
    return abs(_off_centre(q, p, at, _nearest(q, p, at))) - float(p[at + REACH]) + DEAD_BAND


def _locate(q: Floats, p: Floats) -> None:
    """Find channel and sectors of a ball anywhere."""
    rho, channel = math.sqrt(q[1] * q[1] + q[2] * q[2]), 0
    while channel < int(p[RINGS]) and rho > _middle(p, TABLE + COLUMNS * channel):
        channel += 1
    p[CHANNEL] = channel
    p[SECTOR_BELOW] = _sector(q, p, line(p, True)) if channel > 0 else SOLID
    p[SECTOR_ABOVE] = _sector(q, p, line(p, False))


def _over_edge(q: Floats, p: Floats, modes: Modes, below: bool) -> None:
    """Let face and tip of the ring below or above hand over what they were doing."""
    at, face, sector = line(p, below), BELOW if below else ABOVE, SECTOR_BELOW if below else SECTOR_ABOVE
    opened = p[sector] != SOLID
    gap = int(p[sector]) if opened else _nearest(q, p, at)
    tip = face + 2 if _off_centre(q, p, at, gap) > 0.0 else face + 1
    if opened:
        modes[face], modes[face + 1], modes[face + 2], p[sector] = modes[tip], FREE, FREE, SOLID
    else:
        modes[tip], modes[face], p[sector] = modes[face], FREE, gap


def _through_gap(q: Floats, p: Floats, modes: Modes, inward: bool) -> None:
    """Let both tips keep what they were doing on the ring's other side."""
    source, aim = (BELOW, ABOVE) if inward else (ABOVE, BELOW)
    first, second = modes[source + 1], modes[source + 2]
    modes[:NORMALS] = FREE
    modes[aim + 1], modes[aim + 2] = first, second
    if inward:
        p[SECTOR_ABOVE] = p[SECTOR_BELOW]
        p[CHANNEL] -= 1.0
        p[SECTOR_BELOW] = _sector(q, p, line(p, True)) if p[CHANNEL] > 0.0 else SOLID
    else:
        p[SECTOR_BELOW] = p[SECTOR_ABOVE]
        p[CHANNEL] += 1.0
        p[SECTOR_ABOVE] = _sector(q, p, line(p, False))


def force(t: float, q: Floats, v: Floats, p: Floats, out: Floats) -> None:
    """Write the controller's torque on the maze, and rolling damping between maze and ball."""
    brake = p[DRAG] * p[TOUCHING] * (v[3] - v[0])
    out[0], out[1], out[2], out[3] = torque(q, v, p) + brake, 0.0, 0.0, -brake


def torque(q: Floats, v: Floats, p: Floats) -> float:
    """Return that of the controller's mode, N m."""
    if p[CONTROL] == OFF:
        return 0.0
    if p[CONTROL] == SNATCH:
        turn = bounded(-2.0 * p[WN] * v[0] - p[WN] ** 2 * (q[0] - p[TARGET]), p[MOST_TURN])
        return bounded(p[MAZE_INERTIA] * turn, p[MOST_TORQUE])
    if p[CONTROL] == BALANCE:
        R = p[line(p, True) + OUTER]
        return _hold(q, v, p, R, R + p[RADIUS], 1.0, p[TOP2], p[TOP1], p[TOP0], p[OMEGA])
    R = p[line(p, False) + INNER]
    return _hold(q, v, p, R, R - p[RADIUS], -1.0, p[CENTRE2], p[CENTRE1], p[CENTRE0], 0.0)


def _hold(
    q: Floats, v: Floats, p: Floats, R: float, rho: float, s: float, k2: float, k1: float, k0: float, omega: float
) -> float:  # fmt: skip
    """Return the torque that holds a rolling ball, N m: the law above, bounded."""
    k, x, y = p[BALL_INERTIA] / p[RADIUS] ** 2, q[1], q[2]
    kk, square = k / p[BALL_MASS], x * x + y * y
    rate, cosine = (x * v[2] - y * v[1]) / square, x / math.sqrt(square)
    flat = kk * R * v[0] - (1.0 + kk) * rho * rate
    off = wrapped(math.atan2(y, x) - 0.5 * math.pi * s)
    w = -k2 * rate - k1 * off + s * k0 * (flat - kk * R * omega) / p[GRAVITY]
    turn = bounded(((1.0 + kk) * rho * w + p[GRAVITY] * cosine) / (kk * R), p[MOST_TURN])
    return bounded(p[MAZE_INERTIA] * turn + k * R * (R * turn - rho * w), p[MOST_TORQUE])
