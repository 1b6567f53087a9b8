"""Where the numbers of the maze's rows, gates and torque stand: constants, rings, what is discrete."""

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
