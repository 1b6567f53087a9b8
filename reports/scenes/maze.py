"""A ball among rings that turn; q = angle of the maze, centre and spin of the ball."""

from __future__ import annotations

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.maze.geometry import Maze, Ring, maze_of
from crossbody.reports.scenes import Parameters, Shape, Stage, circle, path

ARC = 0.06  # angle between two points of a drawn arc, rad
_FACES, _TIPS, _SLIPS = {0: 1.0, 3: -1.0}, (1, 2, 4, 5), (6, 7)


def stage(p: Parameters) -> Stage:
    """Rings and wall turn together; the ball has a spoke."""
    maze = maze_of(p)
    turning = tuple(shape for ring in maze.rings for shape in _walls(ring))
    rim = (circle(0.0, 0.0, maze.wall, fill=False), path([(0.95 * maze.wall, 0.0), (maze.wall, 0.0)]))
    ball = (circle(0.0, 0.0, maze.ball), path([(0.0, 0.0), (maze.ball, 0.0)]))
    return Stage(bodies=((*turning, *rim), ball))


def poses(q: Floats, p: Parameters) -> Floats:
    """Maze and ball."""
    zero = np.zeros(len(q))
    return np.stack([np.stack([zero, zero, q[:, 0]], axis=1), q[:, 1:4]], axis=1)


def arrows(q: Floats, lam: Floats, p: Parameters) -> Floats:
    """Forces on the ball: faces along the radius, tips away from the nearest cap, rolling across."""
    maze = maze_of(p)
    ball = q[:, 1:3]
    out = ball / np.maximum(np.linalg.norm(ball, axis=1, keepdims=True), 1e-12)
    across = np.stack([-out[:, 1], out[:, 0]], axis=1)
    tip = _from_nearest_tip(q, maze)
    found = []
    for k in range(lam.shape[1]):
        way = tip if k in _TIPS else across if k in _SLIPS else _FACES[k] * out
        found.append(np.concatenate([ball, way * lam[:, [k]]], axis=1))
    return np.stack(found, axis=1)


def _walls(ring: Ring) -> list[Shape]:
    """The solid pieces of one ring between its gaps, with round ends."""
    if not ring.gaps:
        return [circle(0.0, 0.0, ring.inner, fill=False), circle(0.0, 0.0, ring.outer, fill=False)]
    shapes = []
    for gap in range(ring.gaps):
        start, stop = ring.tips(gap)[1], ring.tips(gap + 1)[0]
        at = np.linspace(start, stop, max(2, round((stop - start) / ARC)))
        end, begin = (_cap(ring, angle, half) for angle, half in ((stop, 0.0), (start, np.pi)))
        shapes.append(path([*_arc(ring.outer, at), *end, *_arc(ring.inner, at[::-1]), *begin], closed=True))
    return shapes


def _arc(radius: float, at: Floats) -> Floats:
    return radius * np.stack([np.cos(at), np.sin(at)], axis=1)


def _cap(ring: Ring, angle: float, half: float) -> Floats:
    """Half a circle around a cap's centre, from the outer face to the inner one, or back for `half` = pi."""
    turn = angle + half + np.linspace(0.0, np.pi, 7)[1:-1]
    return _arc(ring.middle, np.array([angle])) + _arc(ring.cap, turn)


def _from_nearest_tip(q: Floats, maze: Maze) -> Floats:
    """Direction from the nearest cap's centre to the ball (n, 2)."""
    angles = [(ring.middle, angle) for ring in maze.rings for gap in range(ring.gaps) for angle in ring.tips(gap)]
    if not angles:
        return np.zeros((len(q), 2))
    radius, angle = np.array(angles).T
    turned = angle + q[:, [0]]
    away = q[:, None, 1:3] - np.stack([radius * np.cos(turned), radius * np.sin(turned)], axis=2)
    nearest = np.argmin(np.linalg.norm(away, axis=2), axis=1)
    chosen: Floats = away[np.arange(len(q)), nearest]
    unit: Floats = chosen / np.maximum(np.linalg.norm(chosen, axis=1, keepdims=True), 1e-12)
    return unit
