"""The eight constraint rows of the maze: gap, derivative and drift (Bortoff, AMC 2020); see `crossbody.cases.gates`.

q = (theta maze, x, y, phi spin). With rho = |(x, y)|, s = -1 outside a face of radius R and +1 inside it:

    face    h = s (R - rho) - r                 H = (0, -s x/rho, -s y/rho, 0)       H' v = -s vt^2/rho
    slip    vt + s r phi' - R theta'            H = (-R, -y/rho, x/rho, s r)         H' v = -vt vr/rho
    tip     h = |p - p_tip(theta)| - cap - r    H = (-n . dp_tip/dtheta, n, 0)

Written apart from the reference's kernels, so that each checks the other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Value
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
