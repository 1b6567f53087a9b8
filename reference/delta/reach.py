"""Inverse kinematics of many flange positions at once: what a map of the workspace needs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crossbody.cases.arrays import frozen
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference.delta.kinematics import rotations
from crossbody.reference.delta.robot import Robot
from crossbody.reference.kinds import Floats


@checked_arguments
def inverses(robot: Robot, z: ArrayLike) -> tuple[Floats, NDArray[np.bool_]]:
    """Angles that bring the flange to each of many positions, elbows outward, and where the robot reaches.

    Args:
        robot: the robot.
        z: flange (N, 3), m.

    Returns:
        q (N, 9), rad, NaN where an arm does not reach; and whether all reach (N,).

    Raises:
        SceneError: for an array of another shape.
    """
    targets = frozen("inverses", "z", z, (None, 3))
    local = np.einsum("ikj,nk->nij", rotations(robot), targets)
    side, across, depth = local[..., 0], local[..., 1] - robot.offset, local[..., 2]
    with np.errstate(invalid="ignore", divide="ignore"):
        width = np.sqrt(robot.l2**2 - side**2)
        reach = np.hypot(across, depth)
        bend = np.arccos((reach**2 + robot.l1**2 - width**2) / (2.0 * robot.l1 * reach))
        q1 = np.arctan2(depth, across) - bend
    y, down = across - robot.l1 * np.cos(q1), depth - robot.l1 * np.sin(q1)
    q = np.stack([q1, np.arctan2(np.hypot(side, down), y), np.arctan2(side, down)], axis=-1).reshape(len(targets), 9)
    there = np.isfinite(q).all(axis=1)
    q[~there] = np.nan
    return q, there
