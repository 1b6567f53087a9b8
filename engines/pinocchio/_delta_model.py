"""The delta robot in Pinocchio from two sources: the MJCF that MuJoCo reads, and joint by joint (spec 3.8 and 4.3).

Both have the coordinates of `engines._delta.chart` and two point constraints in world axes, tips 2 and 3 against
tip 1.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Law, SceneError
from crossbody.cases.arrays import Floats
from crossbody.engines._delta.mjcf import mjcf
from crossbody.reference.delta import Robot
from crossbody.reference.delta.kinematics import rotations

_SETTINGS = 1e-12, 1e-10, 10
"""Accuracy, regularisation mu and iterations of the proximal solver."""


@dataclass(slots=True, kw_only=True)
class Closed:
    """A tree with its two loops.

    Attributes:
        model, data: Pinocchio's.
        ends: the frames at the tips.
        constraints, states: the two point constraints and their data.
        settings: of the proximal solver.
    """

    model: Any
    data: Any
    ends: tuple[int, int, int]
    constraints: Any
    states: Any
    settings: Any

    def accelerate(self, r: Floats, rd: Floats, tau: Floats) -> tuple[Floats, Floats]:
        """Accelerations of the tree (9,) and lam (6,), N, by Pinocchio's constrained forward dynamics.

        Args:
            r: angles of the tree (9,).
            rd: rates (9,).
            tau: generalised forces (9,).
        """
        pin.constraintDynamics(self.model, self.data, r, rd, tau, self.constraints, self.states, self.settings)
        return self.data.ddq.copy(), self.data.lambda_c.copy()

    def law(self, r: Floats, rd: Floats) -> Floats:
        """H' r' + a1 h' + a0 h (6,) of the loops."""
        (h, hd, drift), own = self.loops(r, rd), self.constants()
        gamma: Floats = drift + own["a1"] * hd + own["a0"] * h
        return gamma

    def loops(self, r: Floats, rd: Floats) -> tuple[Floats, Floats, Floats]:
        """H (6,), m, h' and H' r' of the loops."""
        pin.forwardKinematics(self.model, self.data, r, rd, np.zeros(9))
        pin.updateFramePlacements(self.model, self.data)
        ends = self.ends
        at = [self.data.oMf[i].translation.copy() for i in ends]
        kinds = (pin.getFrameVelocity, pin.getFrameClassicalAcceleration)
        rate, drift = (
            [np.array(get(self.model, self.data, i, pin.LOCAL_WORLD_ALIGNED).linear) for i in ends] for get in kinds
        )
        h, hd, Hdv = (np.concatenate((x[0] - x[1], x[0] - x[2])) for x in (at, rate, drift))
        return h, hd, Hdv

    def observe(self, r: Floats, rd: Floats) -> tuple[Floats, Floats]:
        """Gaps (n, 6), m, of the loops, and kinetic and potential energy (n, 2), J, of many states (n, 9)."""
        gaps, energy = np.empty((len(r), 6)), np.empty((len(r), 2))
        for i, (position, rate) in enumerate(zip(r, rd, strict=True)):
            gaps[i] = self.loops(position, rate)[0]
            energy[i, 0] = pin.computeKineticEnergy(self.model, self.data)
            energy[i, 1] = pin.computePotentialEnergy(self.model, self.data)
        return gaps, energy

    def derivatives(self, r: Floats, rd: Floats, tau: Floats) -> tuple[Floats, Floats, Floats]:
        """Of the accelerations by r, r' and tau (9, 9), as `computeConstraintDynamicsDerivatives` has them."""
        self.accelerate(r, rd, tau)
        pin.computeConstraintDynamicsDerivatives(
            self.model, self.data, self.constraints, self.states, self.settings
        )  # fmt: skip
        return self.data.ddq_dq.copy(), self.data.ddq_dv.copy(), self.data.ddq_dtau.copy()

    def turned(self, r: Floats) -> Floats:
        """What `derivatives` has too much in v' (9, 18), behind it: found from its residual, exact to rounding.

        It is M v' - H^T lam of arms 2 and 3, in the column of the first joint: J_i^T (-nv e x lam_i), e its axis.
        """
        M, _, H = self.terms(r, np.zeros(9))
        axis = pin.getJointJacobian(self.model, self.data, 1, pin.LOCAL_WORLD_ALIGNED)[3:, 0]
        wrong, K = np.zeros(15), np.block([[M, -H.T], [H, np.zeros((6, 6))]])
        for i, lam in enumerate(self.data.lambda_c.reshape(2, 3)):
            wrong[:9] += self.model.nv * np.cross(axis, lam) @ np.where(np.arange(9) < 3, 0.0, H[3 * i : 3 * i + 3])
        found = np.zeros((9, 18))
        found[:, 0] = np.linalg.solve(K, wrong)[:9]
        return found

    def masses(self) -> Floats:
        """Proximal link, distal link and tip of each arm (9,), kg: a joint has one inertia for all that it carries.

        Its centre tells a uniform rod from the point at its end: m c = m_rod l2/2 + m_tip l2.
        """
        found = []
        for i, end in enumerate(self.ends, start=1):
            frame = self.model.frames[end]
            far = self.model.inertias[frame.parentJoint]
            tip = far.mass * (2 * far.lever[1] / frame.placement.translation[1] - 1)
            found += [self.model.inertias[self.model.getJointId(f"q{i}")].mass, far.mass - tip, tip]
        return np.array(found)

    def constants(self) -> dict[str, Floats]:
        """A0, a1 and a2 of the six rows."""
        gains = [c.m_baumgarte_parameters for c in self.constraints]
        a0, a1 = ([np.ravel(getattr(g, name))[0] for g in gains] for name in ("Kp", "Kd"))
        return {"a0": np.repeat(a0, 3), "a1": np.repeat(a1, 3), "a2": np.zeros(6)}

    def terms(self, r: Floats, rd: Floats) -> tuple[Floats, Floats, Floats]:
        """Mass matrix (9, 9), bias (9,) and constraint Jacobian (6, 9) of the tree."""
        M = pin.crba(self.model, self.data, r)
        M = np.triu(M) + np.triu(M, 1).T
        bias = pin.nonLinearEffects(self.model, self.data, r, rd).copy()
        return M, bias, self.jacobian(r)

    def jacobian(self, r: Floats) -> Floats:
        """H (6, 9) of the loops."""
        pin.computeJointJacobians(self.model, self.data, r)
        pin.updateFramePlacements(self.model, self.data)
        ends = [pin.getFrameJacobian(self.model, self.data, i, pin.LOCAL_WORLD_ALIGNED)[:3] for i in self.ends]
        return np.vstack([ends[0] - ends[1], ends[0] - ends[2]])


def imported(robot: Robot, law: Law) -> Closed:
    """The model from the MJCF. The importer reads neither gravity nor solref.

    Raises:
        SceneError: if Pinocchio understood the file otherwise: another size, or other joints in the loops.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "delta.xml"
        path.write_text(mjcf(robot), encoding="utf-8")
        model, loops = pin.buildModelAndLegacyConstraintsFromMJCF(path)
    ends = [(int(c.joint1_id), int(c.joint2_id)) for c in loops]
    tips = [model.frames[model.getFrameId(f"tip{i}", pin.FrameType.BODY)] for i in (1, 2, 3)]
    wanted = [(tips[0].parentJoint, tips[i].parentJoint) for i in (1, 2)]
    if model.nv != 9 or ends != wanted:
        raise SceneError(f"Pinocchio read nv = {model.nv} and loops {ends}; the model has nv = 9 and loops {wanted}.")
    return _closed(model, robot, law, [(f.parentJoint, f.placement.translation.copy()) for f in tips])


def by_hand(robot: Robot, law: Law) -> Closed:
    """The same model joint by joint, without the file."""
    model, tips = pin.Model(), []
    for i, R in enumerate(rotations(robot), start=1):
        hinge = pin.SE3(R, robot.offset * R[:, 1])
        q = model.addJoint(0, pin.JointModelRX(), hinge, f"q{i}")
        knee = pin.SE3(np.eye(3), np.array([0.0, robot.l1, 0.0]))
        alpha = model.addJoint(q, pin.JointModelRX(), knee, f"alpha{i}")
        gamma = model.addJoint(alpha, pin.JointModelRZ(), pin.SE3.Identity(), f"gamma{i}")
        model.appendBodyToJoint(q, _rod(robot.m1, robot.l1), pin.SE3.Identity())
        model.appendBodyToJoint(gamma, _rod(robot.m2, robot.l2), pin.SE3.Identity())
        end = np.array([0.0, robot.l2, 0.0])
        model.appendBodyToJoint(gamma, pin.Inertia(robot.m3 / 3, end, np.zeros((3, 3))), pin.SE3.Identity())
        armature = model.armature.copy()
        armature[model.joints[q].idx_v] = robot.jm
        model.armature = armature
        tips.append((gamma, end))
    return _closed(model, robot, law, tips)


def _rod(mass: float, length: float) -> Any:
    """A slender uniform rod along y from the joint."""
    about = mass * length**2 / 12
    return pin.Inertia(mass, np.array([0.0, length / 2, 0.0]), np.diag([about, 0.0, about]))


def _closed(model: Any, robot: Robot, law: Law, tips: list[tuple[int, Floats]]) -> Closed:
    model.gravity.linear = np.array([0.0, 0.0, robot.g])
    places = [(joint, pin.SE3(np.eye(3), end)) for joint, end in tips]
    ends = [model.addFrame(pin.Frame(f"end of arm {i}", *at, pin.FrameType.OP_FRAME)) for i, at in enumerate(places, 1)]
    constraints, states = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for i in (1, 2):
        loop = pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D, model, *places[0], *places[i], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        row = 3 * i - 3  # one pair of constants serves the three rows of a loop
        loop.setBaumgarteCorrectorParameters(pin.BaumgarteCorrectorParameters(float(law.a0[row]), float(law.a1[row])))
        constraints.append(loop)
        states.append(loop.createData())
    data, settings = model.createData(), pin.ProximalSettings(*_SETTINGS)
    pin.initConstraintDynamics(model, data, constraints, states)  # once: the active set never changes
    return Closed(
        model=model, data=data, ends=tuple(ends), constraints=constraints, states=states, settings=settings
    )  # fmt: skip
