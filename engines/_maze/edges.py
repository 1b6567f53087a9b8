"""Where a ring is solid: sectors of its wall, and how far the ball is from the edge of the one that it is in."""

from __future__ import annotations

import math

from crossbody.cases.mechanisms.maze.geometry import Maze, Ring

SOLID = -1
"""The sector of a ring where its wall is solid; a gap's sector is its number."""
DEAD_BAND = 1e-12
"""By how much a position must pass an edge before it can come back over it, relative."""


def walls(maze: Maze) -> tuple[Ring, ...]:
    """The rings from the centre outwards and the closed wall around them."""
    return (*maze.rings, Ring(inner=maze.wall, outer=math.inf))


def wrapped(angle: float) -> float:
    """The same angle within -pi..pi, rad."""
    return math.remainder(angle, math.tau)


def nearest_gap(ring: Ring, angle: float) -> int:
    """Number of the gap whose centre is nearest to an angle of the maze's frame, rad."""
    return round((angle - ring.phase) * ring.gaps / math.tau) % ring.gaps


def sector(ring: Ring, angle: float) -> int:
    """What the wall is at that angle of the maze's frame, rad: `SOLID` or the number of a gap."""
    if ring.gaps == 0:
        return SOLID
    k = nearest_gap(ring, angle)
    return k if abs(wrapped(angle - ring.centre(k))) < ring.reach else SOLID


def to_edge(ring: Ring, now: int, angle: float) -> float:
    """Angle to the nearest edge at which the sector `now` ends, rad: positive inside it, pi for a closed wall."""
    if now != SOLID:
        return ring.reach - abs(wrapped(angle - ring.centre(now))) + DEAD_BAND
    if ring.gaps == 0:
        return math.pi
    return abs(wrapped(angle - ring.centre(nearest_gap(ring, angle)))) - ring.reach + DEAD_BAND
