"""What the motors carry: gravity and the mass felt at them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import InvalidValue, SceneError
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference.delta.kernels import kinematics as compiled
from crossbody.reference.delta.kinematics import MOTORS, OTHERS, vector, virtual_jacobian
from crossbody.reference.delta.robot import Robot
from crossbody.reference.kinds import Floats


def closure_jacobian(robot: Robot, q: ArrayLike) -> Floats:
    """H = dh/dq (6, 9)."""
    blocks: Floats = 3 * virtual_jacobian(robot, q)
    zero = np.zeros((3, 3))
    first, second, third = blocks[:, :3], blocks[:, 3:6], blocks[:, 6:]
    return np.block([[first, -second, zero], [first, zero, -third]])


def gravity_gradient(robot: Robot, q: ArrayLike) -> Floats:
    """DV/dq (9,), N m."""
    angles = vector("q", q, 9).reshape(3, 3)
    (c1, c2, c3), (_, s2, s3) = np.cos(angles).T, np.sin(angles).T
    k1 = (robot.m1 / 2 + robot.m2 + robot.m3 / 3) * robot.g * robot.l1
    k2 = (robot.m2 / 2 + robot.m3 / 3) * robot.g * robot.l2
    return np.column_stack([-k1 * c1, -k2 * c2 * c3, k2 * s2 * s3]).ravel()


@checked_arguments
def gravity_torque(robot: Robot, q: ArrayLike, cutoff: float = 1e-3) -> tuple[Floats, Floats]:
    """Motor torques (3,), N m, and lam (6,), N, that hold a pose: [B H^T](tau; lam) = dV/dq.

    Near a singular pose, the smallest solution in the sense of least squares.

    Args:
        robot: the robot.
        q (9,): pose, rad.
        cutoff: singular values below this part of the largest count as zero.
    """
    matrix = np.hstack([np.eye(9)[:, MOTORS], closure_jacobian(robot, q).T])
    solution = np.asarray(np.linalg.lstsq(matrix, gravity_gradient(robot, q), rcond=cutoff)[0], dtype=np.float64)
    return solution[:3], solution[3:]


@checked_arguments
def holding_pose(robot: Robot, y: float) -> Floats:
    """The symmetric pose (9,) with all motors at y and the flange on the axis below the elbows.

    Raises:
        InvalidValue: if the distal links are too short for it.
    """
    c2 = -(robot.offset + robot.l1 * math.cos(y)) / robot.l2
    if not abs(c2) < 1:
        raise InvalidValue(f"No symmetric pose at y = {y:g} rad: the elbows are {abs(c2) * robot.l2:g} m off the axis.")
    return np.tile([y, math.acos(c2), 0.0], 3)


@checked_arguments
def task_mass(robot: Robot, q: ArrayLike, *, exact: bool = True) -> Floats:
    """Mass matrix felt by the motors (3, 3), kg m^2.

    Args:
        robot: the robot.
        q (9,): a closed pose, rad.
        exact: S^T M S with S = [I; X]; else M11 - M12 h_x^-1 h_y, without the reflected constraint force.

    Raises:
        SceneError: if the control Jacobian is singular.
    """
    given, My = vector("q", q, 9), np.zeros((3, 3))
    det = compiled.task_mass(robot.array(), given[MOTORS].copy(), given[OTHERS].copy(), exact, My)
    if not abs(det) > compiled.SINGULAR:
        raise SceneError("The mass seen by the motors is undefined here: the control Jacobian is singular.")
    return My
