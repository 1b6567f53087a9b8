"""Drake's parser of robot files (`pydrake.multibody.parsing.Parser`); the root of a URDF is welded to the world."""

from __future__ import annotations

from typing import Any

import numpy as np

FORMATS, PACKAGE, MODULE = ("mjcf", "urdf"), "drake", "pydrake"
KINDS = {"quaternion_floating": "free", "ball_rpy": "ball", "revolute": "hinge", "prismatic": "slide"}


class _Robot:
    free, ball = "wxyz, p; world, world", "rpy; parent"
    hidden = {"friction": "Drake's joints have no dry friction."}  # noqa: RUF012
    precision = 0.0

    def __init__(self, path: str, urdf: bool) -> None:
        from importlib.metadata import version

        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant
        from pydrake.multibody.tree import BodyIndex

        self.version = version("drake")
        self._p = plant = MultibodyPlant(1e-3)
        Parser(plant).AddModels(path)
        if urdf:
            moved = {plant.get_joint(i).child_body().name() for i in plant.GetJointIndices()}
            for body in (plant.get_body(BodyIndex(i)) for i in range(1, plant.num_bodies())):
                if body.name() not in moved:
                    plant.WeldFrames(plant.world_frame(), body.body_frame())
        plant.Finalize()
        self._c = plant.CreateDefaultContext()
        self.nq, self.nv, self.loops = plant.num_positions(), plant.num_velocities(), plant.num_constraints()
        self._joints = [plant.get_joint(i) for i in plant.GetJointIndices()]
        self._bodies = [plant.get_body(BodyIndex(i)) for i in range(1, plant.num_bodies())]
        self.joints = [
            (
                j.name(),
                j.child_body().name(),
                KINDS.get(kind := j.type_name(), kind),
                j.position_start(),
                j.velocity_start(),
            )
            for j in self._joints
            if j.num_velocities()
        ]
        motors = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
        self.actuators = {motor.name(): [motor.joint().name()] for motor in motors}
        self.numbers = self._numbers(motors)

    def _numbers(self, motors: Any) -> dict[str, dict[str, Any]]:
        told: dict[str, dict[str, Any]] = {
            key: {} for key in ("armature", "damping", "lower", "upper", "stiffness", "rest")
        }
        for joint in (joint for joint in self._joints if joint.num_velocities()):
            name, single = joint.name(), joint.num_positions() == 1
            told["armature"][name] = told["stiffness"][name] = told["rest"][name] = [0.0]
            told["damping"][name] = [float(joint.default_damping_vector()[0])] if joint.num_velocities() < 6 else [0.0]
            told["lower"][name] = [float(joint.position_lower_limits()[0])] if single else [-np.inf]
            told["upper"][name] = [float(joint.position_upper_limits()[0])] if single else [np.inf]
        for motor in motors:
            told["armature"][motor.joint().name()] = [motor.default_rotor_inertia() * motor.default_gear_ratio() ** 2]
        for k in range(1, self._p.num_force_elements()):
            spring = self._p.get_force_element(_index(k))
            if hasattr(spring, "stiffness") and hasattr(spring, "joint"):
                told["stiffness"][spring.joint().name()] = [float(spring.stiffness())]
                rest = spring.nominal_angle() if hasattr(spring, "nominal_angle") else spring.nominal_position()
                told["rest"][spring.joint().name()] = [float(rest)]
        return told

    def place(self, q: Any, v: Any) -> None:
        self._p.SetPositions(self._c, q)
        self._p.SetVelocities(self._c, v)

    def mass_matrix(self) -> Any:
        return self._p.CalcMassMatrix(self._c)

    def bias(self) -> Any:
        return self._p.CalcBiasTerm(self._c) - self._p.CalcGravityGeneralizedForces(self._c)

    def energy(self) -> float:
        return float(self._p.CalcKineticEnergy(self._c) + self._p.CalcPotentialEnergy(self._c))

    def frames(self) -> Any:
        placed = {body.name(): body.EvalPoseInWorld(self._c) for body in self._bodies}
        return {name: (np.array(X.translation()), X.rotation().matrix()) for name, X in placed.items()}

    def inertias(self) -> Any:
        moved = {j.child_body().name(): j for j in self._joints}
        told = []
        for body in self._bodies:
            joint, mass = moved.get(body.name()), body.default_mass()
            while joint is not None and not joint.num_velocities():
                joint = moved.get(joint.parent_body().name())
            if joint is not None:
                X, own = body.EvalPoseInWorld(self._c), body.CalcSpatialInertiaInBodyFrame(self._c)
                c, R = own.get_com(), X.rotation().matrix()
                J = own.CalcRotationalInertia().CopyToFullMatrix3() - mass * (c @ c * np.eye(3) - np.outer(c, c))
                told.append((joint.name(), float(mass), X.translation() + R @ c, R @ J @ R.T))
        return told


def _index(k: int) -> Any:
    from pydrake.multibody.tree import ForceElementIndex

    return ForceElementIndex(k)


def open_robot(path: str, urdf: bool) -> _Robot:
    """Return what Drake makes of a file."""
    return _Robot(path, urdf)
