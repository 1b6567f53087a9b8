"""Loops as Pinocchio's own constraints: where no row opens, its dynamics solve for all at once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Law
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.engines.pinocchio._rows import point_jacobian

ACCURACY, MU, ITERATIONS = 1e-12, 1e-10, 10  # of the proximal solver
LEFT = 1e-2  # part of an error that an iteration may leave: ten leave nothing


class Native:
    """Points of bodies that stay together, in world axes.

    Args:
        model: Pinocchio's.
        placed: body -> joint that carries it, and its pose in that joint's frame.
        scene: with loops of type connect and no other rows.
        law: of their rows, linear; one pair of constants serves the three of a loop.
    """

    def __init__(self, model: Any, placed: Mapping[str, tuple[int, Any]], scene: Scene, law: Law) -> None:
        self.model, self.data = model, model.createData()
        self.constraints, self.states = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        for k, loop in enumerate(scene.loops):
            points = ((loop.first, loop.first_position), (loop.second, loop.second_position))
            ends = [(placed[body][0], placed[body][1] * pin.SE3(np.eye(3), np.array(at))) for body, at in points]
            found = pin.RigidConstraintModel(
                pin.ContactType.CONTACT_3D, model, *ends[0], *ends[1], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
            a0, a1 = float(law.a0[3 * k]), float(law.a1[3 * k])
            found.setBaumgarteCorrectorParameters(pin.BaumgarteCorrectorParameters(a0, a1))
            self.constraints.append(found)
            self.states.append(found.createData())
        self.settings = pin.ProximalSettings(ACCURACY, MU, ITERATIONS)
        pin.initConstraintDynamics(model, self.data, self.constraints, self.states)

    def accelerate(self, q: Floats, v: Floats, tau: Floats) -> tuple[Floats, Floats]:
        """Return accelerations (nv,) and multipliers (nc,), N, under generalised forces (nv,)."""
        pin.constraintDynamics(
            self.model, self.data, q, v, tau, self.constraints, self.states, self.settings
        )  # fmt: skip
        return self.data.ddq.copy(), self.data.lambda_c.copy()

    def derivatives(self, q: Floats, v: Floats, tau: Floats) -> tuple[Floats, Floats, Floats]:
        """Return those of the accelerations by q, v and tau (nv, nv), as Pinocchio has them."""
        self.accelerate(q, v, tau)
        pin.computeConstraintDynamicsDerivatives(
            self.model, self.data, self.constraints, self.states, self.settings
        )  # fmt: skip
        return self.data.ddq_dq.copy(), self.data.ddq_dv.copy(), self.data.ddq_dtau.copy()

    def turned(self, q: Floats, lam: Floats, M: Floats, H: Floats) -> Floats:
        """Return what `derivatives` has too much in v' (nv, 2 nv): found from its residual, exact to rounding.

        It is M v' - H^T lam of the second bodies, in the column of the first joint: J^T (-nv e x
        lam), e its axis.
        """
        model, data, nv = self.model, self.data, self.model.nv
        pin.computeJointJacobians(model, data, q)
        axis = pin.getJointJacobian(model, data, 1, pin.LOCAL_WORLD_ALIGNED)[3:, 0]
        wrong, K = np.zeros(nv + len(lam)), np.block([[M, -H.T], [H, np.zeros((len(lam),) * 2)]])
        for loop, force in zip(self.constraints, lam.reshape(-1, 3), strict=True):
            carrier, point = loop.joint2_id, data.oMi[loop.joint2_id].act(loop.joint2_placement.translation)
            wrong[:nv] -= nv * np.cross(axis, force) @ point_jacobian(model, data, carrier, point)
        found: Floats = np.zeros((nv, 2 * nv))
        found[:, 0] = np.linalg.solve(K, wrong)[:nv]
        return found


def apt(scene: Scene, law: Law, A: Floats) -> bool:
    """Return whether points that stay together, under a linear law, are a scene's only rows, and surely hold.

    An iteration of the proximal solver leaves mu / (mu + s^2) of the error of a row, s^2 its part
    of H M^-1 H^T over the largest: one that nearly depends on others would be left behind its law.
    A is H M^-1/2 of the loops (rows, nv).
    """
    points = bool(scene.loops) and all(loop.type == "connect" for loop in scene.loops)
    only = points and law.linear and len(law.a0) == len(A)
    return only and MU * float(np.linalg.cond(A)) ** 2 < LEFT
