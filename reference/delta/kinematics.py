"""Forward and inverse kinematics and the two Jacobians, with errors that say what cannot be reached."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import InvalidValue, SceneError
from crossbody.cases.arguments import shown
from crossbody.cases.arrays import frozen, numbers
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference.delta.kernels import kinematics as compiled
from crossbody.reference.delta.robot import Robot
from crossbody.reference.kinds import Floats

MOTORS = np.array([0, 3, 6])
OTHERS = np.array([1, 2, 4, 5, 7, 8])


def vector(name: str, value: ArrayLike, length: int) -> Floats:
    """Check a vector of a fixed length.

    Raises:
        InvalidValue: if it has another shape or is not finite.
    """
    array: Floats
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        array = np.ascontiguousarray(value)
    else:
        try:
            array = numbers("", name, value)
        except SceneError:
            raise InvalidValue(f"{name} is {shown(value)}; it must be {length} finite numbers.") from None
    if array.shape != (length,) or not np.all(np.isfinite(array)):
        raise InvalidValue(f"{name} is {array.tolist()}; it must be {length} finite numbers.")
    return array


def rotations(robot: Robot) -> Floats:
    """Rotation matrices of the arms (3, 3, 3): R1 = 1, R2 = Rz(-sign 120 deg), R3 = Rz(+sign 120 deg)."""
    c, s = -0.5, robot.sign * 0.75**0.5
    return np.array(
        [np.eye(3), [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]], [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]]
    )


def tips(robot: Robot, q: ArrayLike) -> Floats:
    """Tips of the three arms in the base frame (3, 3), m; equal where the pose is closed."""
    return _tips(robot, vector("q", q, 9))


def _tips(robot: Robot, q: Floats) -> Floats:
    """Tips (..., 3, 3) of poses (..., 9)."""
    a, b, c = np.moveaxis(q.reshape(*q.shape[:-1], 3, 3), -1, 0)
    x = robot.l2 * np.sin(b) * np.sin(c)
    y = robot.offset + robot.l1 * np.cos(a) + robot.l2 * np.cos(b)
    z = robot.l1 * np.sin(a) + robot.l2 * np.sin(b) * np.cos(c)
    turned: Floats = np.einsum("ijk,...ik->...ij", rotations(robot), np.stack([x, y, z], axis=-1))
    return turned


@checked_arguments
def flange(robot: Robot, q: ArrayLike) -> Floats:
    """Flange z = (psi(q1) + R2 psi(q2) + R3 psi(q3))/3 (3,), m."""
    mean: Floats = tips(robot, q).mean(axis=0)
    return mean


@checked_arguments
def flanges(robot: Robot, q: ArrayLike) -> Floats:
    """Flange (n, 3), m, of many poses q (n, 9)."""
    mean: Floats = _tips(robot, frozen("flanges", "q", q, (None, 9))).mean(axis=-2)
    return mean


@checked_arguments
def inverse(robot: Robot, z: ArrayLike, *, outward: bool = True) -> Floats:
    """Angles (9,) that bring the flange to z, explicitly.

    Args:
        robot: the robot.
        z (3,): flange, m.
        outward: elbows away from the axis, as robots are built; else the other solution.

    Raises:
        InvalidValue: if an arm cannot reach z; it says which, and what it spans.
    """
    target = vector("flange position", z, 3)
    local = np.einsum("ikj,k->ij", rotations(robot), target)
    faults = [f"arm {i + 1} {fault}" for i, own in enumerate(local) if (fault := _too_far(robot, own))]
    if faults:
        raise InvalidValue(f"The flange position {target.tolist()} m cannot be reached: {'; '.join(faults)}.")
    return np.concatenate([_arm_inverse(robot, own, outward) for own in local])


def _in_plane(robot: Robot, local: Floats) -> tuple[float, float, float]:
    """Place of the tip from the hinge in the arm's plane, and what of l2 lies in that plane, m."""
    left = robot.l2**2 - local[0] ** 2
    return local[1] - robot.offset, local[2], math.sqrt(left) if left >= 0 else -1.0


def _too_far(robot: Robot, local: Floats) -> str:
    """Why an arm cannot reach a tip position in its own frame; empty if it can."""
    across, depth, width = _in_plane(robot, local)
    if width < 0:
        return f"would have to reach {abs(local[0]):.6g} m sideways, more than l2 = {robot.l2:g} m"
    reach, low, high = math.hypot(across, depth), abs(robot.l1 - width), robot.l1 + width
    if low <= reach <= high and reach > 0:
        return ""
    return f"would have to reach {reach:.6g} m from its hinge, where it spans {low:.6g} to {high:.6g} m"


def _arm_inverse(robot: Robot, local: Floats, outward: bool) -> Floats:
    """Law of cosines in the arm's plane: q1 and the bearing of the tip differ by `bend`."""
    across, depth, width = _in_plane(robot, local)
    reach, l1 = math.hypot(across, depth), robot.l1
    bearing = math.atan2(depth, across)
    bend = math.acos(max(-1.0, min(1.0, (reach**2 + l1**2 - width**2) / (2 * l1 * reach))))
    q1 = bearing - bend if outward else bearing + bend
    y, down = across - l1 * math.cos(q1), depth - l1 * math.sin(q1)
    return np.array([q1, math.atan2(math.hypot(local[0], down), y), math.atan2(local[0], down)])


@checked_arguments
def forward(robot: Robot, y: ArrayLike, guess: ArrayLike | None = None) -> Floats:
    """Angles (9,) of the closed pose with these motor angles.

    Args:
        robot: the robot.
        y (3,): motor angles, rad.
        guess (9,): a pose nearby, for Newton's method; without it the pose with the flange below
            the elbows is found in closed form (three spheres) and polished.

    Raises:
        InvalidValue: if the arms cannot meet, or Newton's method does not converge from the guess.
        SceneError: if the direct kinematics is singular there.
    """
    angles = vector("motor angles", y, 3)
    start = inverse_of_spheres(robot, angles) if guess is None else vector("guess", guess, 9)
    x = start[OTHERS].copy()
    steps = compiled.forward(robot.array(), angles, x, 1e-9, 30)
    if steps == compiled.DIVIDED_BY_ZERO:
        raise SceneError(_singular(angles))
    if steps == compiled.NOT_CONVERGED:
        raise InvalidValue(
            f"Newton's method finds no closed pose at motor angles {angles.tolist()} rad from the guess."
        )
    return assemble(angles, x)


def assemble(y: Floats, x: Floats) -> Floats:
    """The nine angles from the three of the motors and the six others."""
    q = np.empty(9)
    q[MOTORS], q[OTHERS] = y, x
    return q


def _singular(y: Floats) -> str:
    return (
        f"The control Jacobian is singular at motor angles {y.tolist()} rad: the distal links "
        "are parallel or in one plane, so the motors do not determine the flange."
    )


def inverse_of_spheres(robot: Robot, y: Floats) -> Floats:
    """The pose whose flange lies below the elbows: the intersection of three spheres of radius l2."""
    local = np.column_stack([np.zeros(3), robot.offset + robot.l1 * np.cos(y), robot.l1 * np.sin(y)])
    a, b, c = np.einsum("ijk,ik->ij", rotations(robot), local)
    u, w = b - a, c - a
    normal = np.cross(u, w)
    area = float(normal @ normal)
    if area < 1e-16 * robot.l1**4:
        raise SceneError(_singular(y))
    centre = a + np.cross(normal, (u @ u) * w - (w @ w) * u) / (-2 * area)
    height = robot.l2**2 - float((centre - a) @ (centre - a))
    if height < 0:
        raise InvalidValue(
            f"The arms cannot meet at motor angles {y.tolist()} rad: the elbows lie on a circle of radius "
            f"{math.sqrt(robot.l2**2 - height):.6g} m, more than l2 = {robot.l2:g} m."
        )
    below = normal if normal[2] > 0 else -normal
    z = centre + below * math.sqrt(height / area)
    distal = np.einsum("ikj,ik->ij", rotations(robot), z - np.array([a, b, c]))
    q2 = np.arctan2(np.hypot(distal[:, 0], distal[:, 2]), distal[:, 1])
    return np.column_stack([y, q2, np.arctan2(distal[:, 0], distal[:, 2])]).ravel()


@checked_arguments
def closed_pose(robot: Robot, q: ArrayLike, tolerance: float = 1e-9) -> Floats:
    """Check that a pose closes the loops.

    Raises:
        SceneError: if it does not; the message offers the pose with the same motor angles that does.
    """
    given = vector("q", q, 9)
    h = (tips(robot, given)[0] - tips(robot, given)[1:]).ravel()
    if np.abs(h).max() <= tolerance:
        return given
    near = forward(robot, given[MOTORS])
    raise SceneError(
        f"The start does not close the loops: |h| = {np.abs(h).max():.3g} m. "
        f"The closed pose with the same motor angles is q = {near.tolist()}."
    )


@checked_arguments
def jacobians(robot: Robot, q: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Flange z (3,), control Jacobian Jy = dz/dy (3, 3) and X = dx/dy (6, 3) of a closed pose.

    Raises:
        SceneError: if the control Jacobian is singular.
    """
    given = vector("q", q, 9)
    y, x = given[MOTORS].copy(), given[OTHERS].copy()
    z, Jy, X, tau = np.zeros(3), np.zeros((3, 3)), np.zeros((6, 3)), np.zeros(3)
    if not abs(compiled.jacobians(robot.array(), y, x, z, Jy, X, tau)) > compiled.SINGULAR:
        raise SceneError(_singular(y))
    return z, Jy, X


@checked_arguments
def virtual_jacobian(robot: Robot, q: ArrayLike) -> Floats:
    """Jv = [dpsi1, R2 dpsi2, R3 dpsi3]/3 (3, 9): a flange force f acts as Jv^T f on all nine joints."""
    angles = vector("q", q, 9).reshape(3, 3)
    blocks = [R @ _tip_jacobian(robot, arm) for R, arm in zip(rotations(robot), angles, strict=True)]
    return np.hstack(blocks) / 3


def _tip_jacobian(robot: Robot, arm: Floats) -> Floats:
    (c1, c2, c3), (s1, s2, s3) = np.cos(arm), np.sin(arm)
    l1, l2 = robot.l1, robot.l2
    return np.array(
        [
            [0.0, l2 * c2 * s3, l2 * s2 * c3],
            [-l1 * s1, -l2 * s2, 0.0],
            [l1 * c1, l2 * c2 * c3, -l2 * s2 * s3],
        ]
    )
