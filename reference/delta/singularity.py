"""Where the robot's kinematics ends, and how far a pose is from there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import InvalidValue
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference.delta.kinematics import rotations, vector
from crossbody.reference.delta.robot import Robot
from crossbody.reference.kinds import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Margins:
    """Distances from the singularities, all 0 there and at most 1.

    Attributes:
        direct: smallest singular value of the distal directions stacked as rows: at 0 the motors do
            not determine the flange, the control Jacobian ends and forward kinematics breaks down.
        inverse (3,): |n . d| of each arm: at 0 it is stretched or folded and cannot move its tip
            along itself.
        chart (3,): |sin q_i2|: at 0 the distal link points along x and q_i3 is undefined.
    """

    direct: float
    inverse: Floats
    chart: Floats


@checked_arguments
def margins(robot: Robot, q: ArrayLike) -> Margins:
    """The distances of a pose q (9,) from the singularities."""
    a, b, c = np.reshape(vector("q", q, 9), (3, 3)).T
    local = np.column_stack([np.sin(b) * np.sin(c), np.cos(b), np.sin(b) * np.cos(c)])
    D = np.einsum("ijk,ik->ij", rotations(robot), local)
    along = np.cos(a) * local[:, 2] - np.sin(a) * local[:, 1]
    direct = float(np.linalg.svd(D, compute_uv=False)[-1])
    return Margins(direct=direct, inverse=np.abs(along), chart=np.abs(np.sin(b)))


@checked_arguments
def elbow_angle(robot: Robot) -> float:
    """The motor angle y* at which the three elbows coincide: R + l1 cos y* = 0, rad.

    Raises:
        InvalidValue: if the proximal links are too short for that.
    """
    if robot.offset > robot.l1:
        raise InvalidValue(f"The elbows never meet: l1 = {robot.l1:g} m is less than R = {robot.offset:g} m.")
    return math.acos(-robot.offset / robot.l1)


@checked_arguments
def ill_posed_tilts(robot: Robot) -> Floats:
    """Directions (3, 3) of the distal links, unit vectors, at which H loses rank with the elbows together.

    The links hang parallel from the common elbow; tan phi = 2 R/sqrt(l1^2 - R^2), towards 0, 120
    and 240 degrees from +y.
    """
    R = robot.offset
    phi = math.atan2(2 * R, math.sin(elbow_angle(robot)) * robot.l1)
    bearing = np.deg2rad([0.0, 120.0, 240.0])
    return np.column_stack(
        [math.sin(phi) * np.sin(bearing), math.sin(phi) * np.cos(bearing), np.full(3, math.cos(phi))]
    )


@checked_arguments
def pendulum_rate(robot: Robot) -> float:
    """Angular frequency of small swings with the elbows held together, rad/s.

    w^2 = g (1.5 m2 + m3)/(l2 (m2 + m3)).
    """
    return math.sqrt(robot.g * (1.5 * robot.m2 + robot.m3) / (robot.l2 * (robot.m2 + robot.m3)))


def hanging_pose(robot: Robot, direction: ArrayLike) -> Floats:
    """The pose (9,) with the elbows together and the distal links along a direction (3,)."""
    d = vector("direction", direction, 3)
    local = np.einsum("ikj,k->ij", rotations(robot), d / np.linalg.norm(d))
    q2 = np.arctan2(np.hypot(local[:, 0], local[:, 2]), local[:, 1])
    return np.column_stack([np.full(3, elbow_angle(robot)), q2, np.arctan2(local[:, 0], local[:, 2])]).ravel()
