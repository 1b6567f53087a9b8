"""Points of two bodies that are to meet, by Pinocchio's own kinematics; and equations with dependent rows.

h = x1 - x2,    H = J1 - J2 of the points,    H' v = their accelerations at v' = 0
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases._arrays import Floats
from crossbody.cases.scene import Loop
from crossbody.engines.pinocchio._rows import Solve, mass_matrix, point_jacobian

DEPENDENT = 1e-7  # singular value of the rows, over the largest, that counts as zero
AXES = pin.LOCAL_WORLD_ALIGNED


class Joined:
    """Rows of the loops that join points, three a loop.

    Args:
        model: Pinocchio's.
        placed: body -> joint that carries it, and its pose in that joint's frame.
        loops: of type connect.
    """

    def __init__(self, model: Any, placed: dict[str, tuple[int, Any]], loops: tuple[Loop, ...]) -> None:
        self.model, self.data = model, model.createData()
        self.none = np.zeros(model.nv)
        self.ends = [
            [_point(placed[loop.first], loop.first_position), _point(placed[loop.second], loop.second_position)]
            for loop in loops
        ]

    def heights(self, q: Floats) -> Floats:
        """Return h (3 loops,)."""
        pin.forwardKinematics(self.model, self.data, q)
        at = [[self.data.oMi[joint].act(point) for joint, point in ends] for ends in self.ends]
        return np.array([one - other for one, other in at]).ravel()

    def jacobian(self, q: Floats) -> Floats:
        """Return H (3 loops, nv)."""
        pin.computeJointJacobians(self.model, self.data, q)
        found = [
            [point_jacobian(self.model, self.data, joint, self.data.oMi[joint].act(point)) for joint, point in ends]
            for ends in self.ends
        ]
        return np.array([one - other for one, other in found]).reshape(-1, self.model.nv)

    def drift(self, q: Floats, v: Floats) -> Floats:
        """Return H' v (3 loops,)."""
        pin.forwardKinematics(self.model, self.data, q, v, self.none)
        found = [[self._pulled(joint, point) for joint, point in ends] for ends in self.ends]
        return np.array([one - other for one, other in found]).ravel()

    def _pulled(self, joint: int, point: Floats) -> Floats:
        if joint == 0:
            return np.zeros(3)
        arm = self.data.oMi[joint].rotation @ point
        turn = pin.getVelocity(self.model, self.data, joint, AXES).angular
        a = pin.getClassicalAcceleration(self.model, self.data, joint, AXES)
        pulled: Floats = a.linear + np.cross(a.angular, arm) + np.cross(turn, np.cross(turn, arm))
        return pulled


def _point(placed: tuple[int, Any], position: Any) -> tuple[int, Floats]:
    joint, pose = placed
    return joint, pose.act(np.array(position))


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
