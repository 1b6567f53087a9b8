"""The eight constraint rows of the maze, what changes at once in it, and the torque that balances the ball.

q = (theta maze, x, y, phi spin). With rho = |(x, y)|, s = -1 outside a face of radius R and +1 inside it,
gap, derivative and drift of the rows are (Bortoff, AMC 2020):

    face    h = s (R - rho) - r                 H = (0, -s x/rho, -s y/rho, 0)       H' v = -s vt^2/rho
    slip    vt + s r phi' - R theta'            H = (-R, -y/rho, x/rho, s r)         H' v = -vt vr/rho
    tip     h = |p - p_tip(theta)| - cap - r    H = (-n . dp_tip/dtheta, n, 0)

Channel, sectors, the controller's mode and which row a contact is of change at

    edge      the ball passes the end of a wall: the row of the face hands its mode to that of the tip there, and back
    middle    its centre passes the circle on which a gap's tips lie: they are those of the ring on its other side
    control   BALANCE -> SNATCH where the ring below opens; SNATCH -> BALANCE or CENTRE at the next touch of a face

Written apart from the reference's kernels, so that each checks the other; see `crossbody.cases.gates`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Value
from crossbody.cases.gates import CHANGED, LOST, SEEN, START, UNCHANGED
from crossbody.cases.mechanisms.maze.geometry import Maze, tilted_gravity

(
    RADIUS, DRAG, RINGS, ON, MOST_TURN, MOST_TORQUE, WN, OMEGA, BALL_MASS, BALL_INERTIA,
    MAZE_INERTIA, GRAVITY, TOP2, TOP1, TOP0, CENTRE2, CENTRE1, CENTRE0, TABLE,
) = range(19)  # fmt: skip
"""Of ball and maze, what the controller believes of them, its gains on a ring and in the centre."""
INNER, OUTER, GAPS, REACH, PHASE, COLUMNS = range(6)
"""Of every ring from the centre outwards; the closed wall stands last."""
CHANNEL, SECTOR_BELOW, SECTOR_ABOVE, CONTROL, TARGET, TOUCHING = range(-6, 0)
"""Discrete: rings inside the ball's distance from the axis; number of the gap beside the ball in
the ring below and above, SOLID beside a wall; mode of the controller. Then the angle that a
snatch goes to, and whether a face is touched.
"""
DISCRETE, LATCHED = 4, 2
SOLID = -1
OFF, BALANCE, SNATCH, CENTRE = range(4)
"""Modes of the controller: no torque; on top of a ring; at a gap until the next face; in the centre."""
BELOW, ABOVE, NORMALS = 0, 3, 6
"""Rows of faces, each with both tips of a gap behind it; then those of the slip on both faces."""
Modes = NDArray[np.int8]
EDGE_BELOW, EDGE_ABOVE, INWARD, OUTWARD, STRAYED = range(5)
GUARDS = 5
DEAD_BAND = 1e-12  # by how much a position must pass an edge before it can come back over it, relative
GIVEN_UP = math.radians(60.0)  # angle from the top beyond which the controller has no way back, rad
FREE, CONTACT = 0, 1


def numbers(p: Mapping[str, Value], maze: Maze) -> Floats:
    """Return all of them, with the discrete ones at zero."""

    def number(name: str) -> float:
        return float(p[name])

    mass, gravity = number("ball_mass") * number("model_mass"), tilted_gravity(p) * number("model_gravity")
    natural = math.sqrt(gravity / 1.4 / (maze.rings[0].inner - maze.ball))  # of a solid ball that rolls in the centre
    pole, third = number("pole"), number("centre_pole")
    head = [
        maze.ball, number("rolling_damping"), len(maze.rings), p["controller"] != "off",
        number("a_max") or math.inf, number("u_max") or math.inf, number("wn"), number("omega"),
        mass, 0.4 * mass * maze.ball**2, number("maze_inertia") * number("model_inertia"), gravity,
        3.0 * pole, 3.0 * pole**2, pole**3,
        natural + third, natural * (natural + third), natural**2 * third,
    ]  # fmt: skip
    rings = [[ring.inner, ring.outer, ring.gaps, ring.reach, ring.phase] for ring in maze.rings]
    return np.array([*head, *np.ravel(rings), maze.wall, math.inf, 0.0, 0.0, 0.0, *[0.0] * (DISCRETE + LATCHED)])


def line(p: Floats, below: bool) -> int:
    """Return where the ring below or above the ball stands in the table."""
    return TABLE + COLUMNS * (int(p[CHANNEL]) - 1 if below else int(p[CHANNEL]))


def wrapped(angle: float) -> float:
    """Return the same angle within -pi..pi, rad."""
    return angle - math.tau * float(np.rint(angle / math.tau))


def bounded(x: float, most: float) -> float:
    """Return x within -most..most."""
    return min(max(x, -most), most)


def rows(q: Floats, v: Floats, p: Floats, h: Floats, H: Floats, Hdv: Floats) -> None:
    """Write those of the two rings beside the ball; the others are as far away as the wall."""
    h[:NORMALS] = p[TABLE + COLUMNS * int(p[RINGS]) + INNER]
    h[NORMALS:], H[:], Hdv[:] = 0.0, 0.0, 0.0
    if p[CHANNEL] > 0.0:
        _ring(q, v, p, line(p, True), int(p[SECTOR_BELOW]), BELOW, h, H, Hdv)
    _ring(q, v, p, line(p, False), int(p[SECTOR_ABOVE]), ABOVE, h, H, Hdv)


def _ring(
    q: Floats, v: Floats, p: Floats, at: int, sector: int, row: int, h: Floats, H: Floats, Hdv: Floats
) -> None:  # fmt: skip
    """Write the face of a ring where it is solid, both tips of the gap where it is not."""
    if sector != SOLID:
        _tip(q, v, p, at, sector, -1.0, row + 1, h, H, Hdv)
        _tip(q, v, p, at, sector, 1.0, row + 2, h, H, Hdv)
        return
    s, R = (-1.0, p[at + OUTER]) if row == BELOW else (1.0, p[at + INNER])
    x, y, r = q[1], q[2], p[RADIUS]
    rho = math.sqrt(x * x + y * y)
    vt, vr = (x * v[2] - y * v[1]) / rho, (x * v[1] + y * v[2]) / rho
    h[row], H[row, 1], H[row, 2], Hdv[row] = s * (R - rho) - r, -s * x / rho, -s * y / rho, -s * vt * vt / rho
    if len(h) > NORMALS:
        slip = NORMALS if row == BELOW else NORMALS + 1
        H[slip, 0], H[slip, 1], H[slip, 2], H[slip, 3] = -R, -y / rho, x / rho, s * r
        Hdv[slip] = -vt * vr / rho


def _tip(
    q: Floats, v: Floats, p: Floats, at: int, gap: int, side: float, row: int, h: Floats, H: Floats, Hdv: Floats
) -> None:  # fmt: skip
    """Write the round end of a wall on one side of a gap."""
    middle, cap = 0.5 * (p[at + INNER] + p[at + OUTER]), 0.5 * (p[at + OUTER] - p[at + INNER])
    angle = q[0] + p[at + PHASE] + math.tau * gap / p[at + GAPS] + side * p[at + REACH]
    px, py = middle * math.cos(angle), middle * math.sin(angle)
    dx, dy = q[1] - px, q[2] - py
    d = math.sqrt(dx * dx + dy * dy)
    nx, ny = dx / d, dy / d
    across = ny * (v[1] + py * v[0]) - nx * (v[2] - px * v[0])
    h[row], H[row, 0], H[row, 1], H[row, 2] = d - cap - p[RADIUS], nx * py - ny * px, nx, ny
    Hdv[row] = across * across / d + v[0] * v[0] * (nx * px + ny * py)


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
