"""Any scene's bodies on joints as a MultibodyPlant, and the map between its coordinates and Drake's.

    scene  free: q = (p, w x y z), v = (p', angular in body axes);  ball: q = (w x y z), v in body axes
    Drake  free: q = (w x y z, p), v = (angular, p') in world axes;  ball: roll, pitch and yaw, v in the parent's axes

With v = J v_d: tau_d = J^T tau and M = J M_d J^T, for J permutes and turns. J v_d' is v': d/dt of
R^T w is R^T w'.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    JacobianWrtVariable,
    PrismaticJoint,
    QuaternionFloatingJoint,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
    WeldJoint,
)

from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Body, Joint, Scene
from crossbody.engines._scene import places


class Tree:
    """A scene's bodies as a plant.

    Attributes:
        plant: Drake's, finalised.
        at, place: joint -> its first position, and its first velocity; q, v: those in Drake.

    Args:
        scene: whose.
        armature: what joints and actuators add to M (nv,).
        dt: step of a plant in discrete time, s, which has bounds; 0 for continuous time.
        plant: to which the bodies are added; a new one if not given.
        register: adds what collides, before the plant is final.
    """

    def __init__(
        self, scene: Scene, armature: Floats, dt: float = 0.0, plant: Any = None,
        register: Callable[[Any], None] = lambda _: None,
    ) -> None:  # fmt: skip
        self.scene, self.plant = scene, MultibodyPlant(dt) if plant is None else plant
        self.plant.mutable_gravity_field().set_gravity_vector(np.array(scene.gravity))
        for body in scene.bodies:
            self._add(body)
        self.at, self.place = places(scene)
        for joint in scene.joints:
            if dt and joint.type in ("slide", "hinge"):
                low, high = (np.array([bound - joint.reference]) for bound in joint.range)
                self.plant.GetJointByName(joint.name).set_position_limits(low, high)
            if joint.type in ("slide", "hinge") and armature[self.place[joint.name]]:
                motor = self.plant.AddJointActuator(joint.name, self.plant.GetJointByName(joint.name))
                motor.set_default_rotor_inertia(float(armature[self.place[joint.name]]))
        register(self.plant)
        self.plant.Finalize()
        found = {joint.name: self.plant.GetJointByName(joint.name) for joint in scene.joints}
        self.q = {name: joint.position_start() for name, joint in found.items()}
        self.v = {name: joint.velocity_start() for name, joint in found.items()}

    def _add(self, body: Body) -> None:
        """Add a body: every joint but the last carries a body without mass that stands where it does."""
        plant, joints = self.plant, [joint for joint in self.scene.joints if joint.body == body.name]
        carrier = plant.GetFrameByName(body.parent) if body.parent else plant.world_frame()
        stands = RigidTransform(RotationMatrix(matrices(np.array(body.orientation))), body.position)
        for joint in joints[:-1]:
            link = plant.AddRigidBody(f"{body.name} under {joint.name}", SpatialInertia.Zero())
            self._join(joint, carrier, stands, link.body_frame())
            carrier, stands = link.body_frame(), RigidTransform()
        last = plant.AddRigidBody(body.name, _inertia(body)).body_frame()
        if joints:
            self._join(joints[-1], carrier, stands, last)
        else:
            plant.AddJoint(WeldJoint(f"{body.name} is fixed", carrier, last, stands))

    def _join(self, joint: Joint, carrier: Any, stands: RigidTransform, moved: Any) -> None:
        anchor = RigidTransform(np.array(joint.anchor))
        if joint.type == "free":
            self.plant.AddJoint(QuaternionFloatingJoint(joint.name, self.plant.world_frame(), moved))
            return
        before = self.plant.AddFrame(FixedOffsetFrame(f"before {joint.name}", carrier, stands @ anchor))
        behind = self.plant.AddFrame(FixedOffsetFrame(f"behind {joint.name}", moved, anchor))
        kinds = {"hinge": RevoluteJoint, "slide": PrismaticJoint}
        self.plant.AddJoint(
            BallRpyJoint(joint.name, before, behind) if joint.type == "ball"
            else kinds[joint.type](joint.name, before, behind, np.array(joint.axis))
        )  # fmt: skip

    def theirs(self, q: Floats, v: Floats) -> Floats:
        """Return Drake's state (n,)."""
        at = self.at
        found: Floats = np.empty(self.plant.num_multibody_states())
        for joint in self.scene.joints:
            to, one = self.q[joint.name], at[joint.name]
            if joint.type == "free":
                found[to : to + 4], found[to + 4 : to + 7] = q[one + 3 : one + 7], q[one : one + 3]
            elif joint.type == "ball":
                found[to : to + 3] = RollPitchYaw(RotationMatrix(matrices(q[one : one + 4]))).vector()
            else:
                found[to] = q[one] - joint.reference
        found[self.plant.num_positions() :] = self.J(q).T @ v
        return found

    def ours(self, x: Floats) -> tuple[Floats, Floats]:
        """Return q (nq,) and v (nv,) of a scene from Drake's state."""
        q: Floats = np.empty(self.scene.nq)
        for joint in self.scene.joints:
            to, one = self.q[joint.name], self.at[joint.name]
            if joint.type == "free":
                turn = x[to : to + 4]
                q[one : one + 3], q[one + 3 : one + 7] = x[to + 4 : to + 7], turn / np.linalg.norm(turn)
            elif joint.type == "ball":
                q[one : one + 4] = RollPitchYaw(x[to : to + 3]).ToQuaternion().wxyz()
            else:
                q[one] = x[to] + joint.reference
        return q, self.J(q) @ x[self.plant.num_positions() :]

    def J(self, q: Floats) -> Floats:
        """Return J (nv, nv) at the scene's positions; its inverse is its transpose."""
        found: Floats = np.zeros((self.scene.nv, self.scene.nv))
        for joint in self.scene.joints:
            one, to = self.place[joint.name], self.v[joint.name]
            if joint.type in ("slide", "hinge"):
                found[one, to] = 1.0
                continue
            if joint.type == "free":
                found[one : one + 3, to + 3 : to + 6] = np.eye(3)
                one += 3
            first = self.at[joint.name] + (3 if joint.type == "free" else 0)
            found[one : one + 3, to : to + 3] = matrices(q[first : first + 4]).T
        return found

    def put(self, context: Any, q: Floats, v: Floats) -> None:
        """Put the scene's state into a context of the plant."""
        self.plant.SetPositionsAndVelocities(context, self.theirs(q, v))

    def mass_matrix(self, context: Any, q: Floats) -> Floats:
        """Return M (nv, nv) in the scene's coordinates."""
        J = self.J(q)
        found: Floats = J @ self.plant.CalcMassMatrix(context) @ J.T
        return found

    def point(self, context: Any, body: str, place: Any) -> tuple[Floats, Floats]:
        """Return a point (3,) of a body, m, and its derivative (3, n) along Drake's velocities."""
        plant, world = self.plant, self.plant.world_frame()
        frame = plant.GetFrameByName(body) if body else world
        H: Floats = plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, frame, np.array(place), world, world
        )  # fmt: skip
        at: Floats = plant.CalcPointsPositions(context, frame, np.array(place), world).ravel()
        return at, H


def _inertia(body: Body) -> SpatialInertia:
    xx, yy, zz, xy, xz, yz = body.inertia
    if not body.mass:
        return SpatialInertia.Zero()
    about_com = RotationalInertia(xx, yy, zz, xy, xz, yz)
    return SpatialInertia.MakeFromCentralInertia(body.mass, np.array(body.com), about_com)
