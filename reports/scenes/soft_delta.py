"""A delta robot with two fingers and a block on a table, in space; z points down."""

from __future__ import annotations

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reports.scenes import Parameters, Stage, delta, path

_PADS, _BLOCK = slice(9, 11), slice(12, 15)
_CUBE = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_EDGES = ((0, 1, 3, 2, 0), (4, 5, 7, 6, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_FROM = delta.FLANGE + 1
"""Points behind the robot's: two finger roots, two pads, eight corners of the block."""


def stage(p: Parameters) -> Stage:
    """The robot, a finger from flange to pad on either side, the block's edges, the table's rim."""
    robot = delta.stage(p)
    z, size = float(p["table"]), 5.0 * float(p["width"])
    table = path([(x * size, y * size, z) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))])
    fingers = tuple((delta.FLANGE, _FROM + side, _FROM + 2 + side) for side in (0, 1))
    block = tuple(tuple(_FROM + 4 + i for i in edge) for edge in _EDGES)
    return Stage(still=(*robot.still, table), lines=(*robot.lines, *fingers, *block), down=True)


def poses(q: Floats, p: Parameters) -> Floats:
    """Points of the robot, fingers and block."""
    robot = delta.poses(q[:, :9], p)
    flange, block = robot[:, delta.FLANGE], q[:, _BLOCK]
    # The pads' faces keep the flange's height.
    pads = np.stack([np.stack([q[:, 9 + side], flange[:, 1], flange[:, 2]], axis=1) for side in (0, 1)], axis=1)
    roots = pads + np.array([0.0, 0.0, -0.5 * float(p["width"])])
    return np.concatenate([robot, roots, pads, block[:, None, :] + float(p["width"]) * _CUBE], axis=1)


def arrows(q: Floats, lam: Floats, p: Parameters) -> Floats:
    """Loops, both pads on the block, and the table's push up."""
    block, half = q[:, _BLOCK], 0.5 * float(p["width"])
    ways = np.array([(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, -1.0)])
    own = [np.concatenate([block - half * way, lam[:, [6 + k]] * way], axis=1) for k, way in enumerate(ways)]
    return np.concatenate([delta.arrows(q[:, :9], lam[:, :6], p), np.stack(own, axis=1)], axis=1)
