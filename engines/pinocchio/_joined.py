"""Points, and axes, of two bodies that are to meet, by Pinocchio's own kinematics; and equations with dependent rows.

Points: h = x1 - x2, H = J1 - J2, H' v = their accelerations at v' = 0. Axes: with the quaternion (e0, e) of R2' R1 and
A = s/2 (e0 1 - [e]x) R2', h = s e, H = A (J1 - J2) of the angular velocities w1, w2, and at v' = 0

    H' v = A (w1' - w2' - w2 x w1) - s/4 |w1 - w2|^2 e
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases._arrays import Floats
from crossbody.cases.scene import Loop
from crossbody.engines.pinocchio._rows import Solve, mass_matrix, point_jacobian

DEPENDENT = 1e-7  # singular value of the rows, over the largest, that counts as zero
AXES = pin.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, slots=True)
class End:
    """One end of a loop: the joint that carries it, and its pose in that joint's frame."""

    joint: int
    pose: Any


class Joined:
    """Rows of the loops in space: three of points, and three of axes where it is a weld.

    Args:
        model: Pinocchio's.
        placed: body -> joint that carries it, and its pose in that joint's frame.
        loops: of type connect or weld.
    """

    def __init__(self, model: Any, placed: dict[str, tuple[int, Any]], loops: tuple[Loop, ...]) -> None:
        self.model, self.data = model, model.createData()
        self.none, self.loops = np.zeros(model.nv), loops
        self.ends = [
            (
                _end(placed[loop.first], loop.first_position, loop.orientation),
                _end(placed[loop.second], loop.second_position, (1.0, 0.0, 0.0, 0.0)),
            )
            for loop in loops
        ]

    def heights(self, q: Floats) -> Floats:
        """Return h (rows,)."""
        pin.forwardKinematics(self.model, self.data, q)
        return self._stacked(
            lambda one, two: self._at(one).translation - self._at(two).translation,
            lambda one, two, scale: scale * self._between(one, two)[1],
        )

    def jacobian(self, q: Floats) -> Floats:
        """Return H (rows, nv)."""
        pin.computeJointJacobians(self.model, self.data, q)

        def moved(end: End) -> Floats:
            return point_jacobian(self.model, self.data, end.joint, self._at(end).translation)

        def turned(end: End) -> Floats:
            none: Floats = np.zeros((3, self.model.nv))
            return pin.getJointJacobian(self.model, self.data, end.joint, AXES)[3:] if end.joint else none

        return self._stacked(
            lambda one, two: moved(one) - moved(two),
            lambda one, two, scale: scale * self._map(one, two) @ (turned(one) - turned(two)),
        ).reshape(-1, self.model.nv)

    def drift(self, q: Floats, v: Floats) -> Floats:
        """Return H' v (rows,)."""
        pin.forwardKinematics(self.model, self.data, q, v, self.none)

        def bent(one: End, two: End, scale: float) -> Floats:
            (w1, c1), (w2, c2) = (self._angular(end) for end in (one, two))
            own: Floats = self._map(one, two) @ (c1 - c2 - np.cross(w2, w1))
            return scale * (own - 0.25 * (w1 - w2) @ (w1 - w2) * self._between(one, two)[1])

        return self._stacked(lambda one, two: self._pulled(one) - self._pulled(two), bent)

    def _stacked(
        self, points: Callable[[End, End], Floats], axes: Callable[[End, End, float], Floats]
    ) -> Floats:  # fmt: skip
        """Return what each loop's rows are, one below the other."""
        parts: list[Floats] = []
        for loop, (one, two) in zip(self.loops, self.ends, strict=True):
            parts += [points(one, two)] + ([axes(one, two, loop.torque_scale)] if loop.type == "weld" else [])
        return np.concatenate(parts) if parts else np.zeros(0)

    def _at(self, end: End) -> Any:
        return self.data.oMi[end.joint] * end.pose

    def _between(self, one: End, two: End) -> tuple[float, Floats]:
        """Return e0 and e of the first's axes seen from the second's."""
        x, y, z, w = pin.Quaternion(self._at(two).rotation.T @ self._at(one).rotation).coeffs()
        sign = 1.0 if w >= 0.0 else -1.0
        return sign * w, sign * np.array([x, y, z])

    def _map(self, one: End, two: End) -> Floats:
        """Return A over the torque scale."""
        e0, e = self._between(one, two)
        found: Floats = 0.5 * (e0 * np.eye(3) - pin.skew(e)) @ self._at(two).rotation.T
        return found

    def _angular(self, end: End) -> tuple[Floats, Floats]:
        """Return angular velocity and acceleration."""
        if end.joint == 0:
            return np.zeros(3), np.zeros(3)
        rate = pin.getVelocity(self.model, self.data, end.joint, AXES)
        return rate.angular, pin.getClassicalAcceleration(self.model, self.data, end.joint, AXES).angular

    def _pulled(self, end: End) -> Floats:
        if end.joint == 0:
            return np.zeros(3)
        arm = self.data.oMi[end.joint].rotation @ end.pose.translation
        turn, spin = self._angular(end)
        own = pin.getClassicalAcceleration(self.model, self.data, end.joint, AXES).linear
        pulled: Floats = own + np.cross(spin, arm) + np.cross(turn, np.cross(turn, arm))
        return pulled


def _end(placed: tuple[int, Any], position: Any, orientation: Any) -> End:
    joint, pose = placed
    w, x, y, z = orientation
    turned = pin.Quaternion(w, x, y, z).normalized().matrix()
    return End(joint, pose * pin.SE3(turned, np.array(position)))


def by_least_norm(model: Any, data: Any, tau: Floats) -> Solve:
    """The same equations where rows may depend on each other: v' is unique, lam the least."""

    def solve(q: Floats, v: Floats, J: Floats, gamma: Floats) -> tuple[Floats, Floats]:
        root = np.linalg.cholesky(mass_matrix(model, data, q))
        free = np.linalg.solve(root, tau - pin.nonLinearEffects(model, data, q, v))
        A = np.linalg.solve(root, J.T).T
        U, s, Vt = np.linalg.svd(A, full_matrices=False)
        kept = s > DEPENDENT * s[0]
        wanted = U[:, kept].T @ (-gamma - A @ free) / s[kept]
        vd = np.linalg.solve(root.T, free + Vt[kept].T @ wanted)
        return vd, U[:, kept] @ (wanted / s[kept])

    return solve
