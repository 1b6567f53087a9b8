"""Drake's parser of robot files (`pydrake.multibody.parsing.Parser`); a URDF's root is welded."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

import numpy as np

FORMATS, PACKAGE, MODULE = ("mjcf", "urdf"), "drake", "pydrake"
TRIED = ("1.51", "1.51")
FORCES = ("least force", "most force")
BOUNDED = "Drake bounds the forces of actuators, and a joint without one has no bound."
KINDS = {"quaternion_floating": "free", "ball_rpy": "ball", "revolute": "hinge", "prismatic": "slide"}


class _Robot:
    free, ball = "wxyz, p; world, world", "rpy; parent"
    hidden = {  # noqa: RUF012
        "friction": "Drake's joints have no dry friction.", "tendons": "Drake has no tendons.",
        "damping v|v|": "Drake's dampers are linear.", "damping v^3": "Drake's dampers are linear.",
        "stiffness x^2": "Drake's springs are linear.", "stiffness x^3": "Drake's springs are linear.",
        **dict.fromkeys(FORCES, BOUNDED), "softness": "Drake's rows have no solref.",
        **dict.fromkeys(("spin", "roll", "margin"), "Drake's contacts have only sliding friction."),
    }  # fmt: skip

    def __init__(self, path: str, urdf: bool) -> None:
        from importlib.metadata import version

        from pydrake.geometry import Role, SceneGraph
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant
        from pydrake.multibody.tree import BodyIndex

        self.version = version("drake")
        self._p = plant = MultibodyPlant(1e-3)
        self._scene = SceneGraph()
        plant.RegisterAsSourceForSceneGraph(self._scene)
        Parser(plant).AddModels(path)
        if urdf:
            moved = {plant.get_joint(i).child_body().name() for i in plant.GetJointIndices()} | _floating(path)
            for body in (plant.get_body(BodyIndex(i)) for i in range(1, plant.num_bodies())):
                if body.name() not in moved:
                    plant.WeldFrames(plant.world_frame(), body.body_frame())
        plant.Finalize()
        self._c = plant.CreateDefaultContext()
        self.nq, self.nv = plant.num_positions(), plant.num_velocities()
        self.loops: Any = [("", [], [])] * plant.num_constraints()
        self._look = self._scene.model_inspector()
        self._shapes = list(self._look.GetAllGeometryIds(Role.kProximity))
        self._joints = [plant.get_joint(i) for i in plant.GetJointIndices()]
        self._moved = {j.child_body().name(): j for j in self._joints}
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
        self._motors = motors
        self.actuators = {motor.name(): [motor.joint().name()] for motor in motors}
        self.numbers = self._numbers(motors)

    def _numbers(self, motors: Any) -> dict[str, dict[str, Any]]:
        from pydrake.multibody.tree import ForceElementIndex

        told: dict[str, dict[str, Any]] = {
            key: {} for key in ("armature", "damping", "lower", "upper", "stiffness", "rest", *FORCES)
        }
        for joint in (joint for joint in self._joints if joint.num_velocities()):
            name, single = joint.name(), joint.num_positions() == 1
            told["armature"][name] = told["stiffness"][name] = told["rest"][name] = [0.0]
            told["damping"][name] = np.array(joint.default_damping_vector(), dtype=float).tolist()
            told["lower"][name] = [float(joint.position_lower_limits()[0])] if single else [-np.inf]
            told["upper"][name] = [float(joint.position_upper_limits()[0])] if single else [np.inf]
        for motor in motors:
            told["armature"][motor.joint().name()] = [motor.default_rotor_inertia() * motor.default_gear_ratio() ** 2]
            told["least force"][motor.joint().name()] = [-motor.effort_limit()]
            told["most force"][motor.joint().name()] = [motor.effort_limit()]
        for k in range(1, self._p.num_force_elements()):
            spring = self._p.get_force_element(ForceElementIndex(k))
            if hasattr(spring, "stiffness") and hasattr(spring, "joint"):
                told["stiffness"][spring.joint().name()] = [float(spring.stiffness())]
                rest = spring.nominal_angle() if hasattr(spring, "nominal_angle") else spring.nominal_position()
                told["rest"][spring.joint().name()] = [float(rest)]
        return told

    def drives(self) -> Any:
        """A motor that has a controller is told an angle, any other a force."""
        q, v = self._p.GetPositions(self._c), self._p.GetVelocities(self._c)
        driven, held = {}, np.zeros(self.nv)
        for motor in self._motors:
            joint, unit = motor.joint(), np.zeros(self.nv)
            unit[joint.velocity_start()] = 1.0
            if motor.has_controller():
                gains = motor.get_controller_gains()
                held -= unit * (gains.p * q[joint.position_start()] + gains.d * v[joint.velocity_start()])
                unit *= gains.p
            driven[motor.name()] = unit
        return driven, held

    def shapes(self) -> Any:
        told = []
        for geometry in self._shapes:
            body = self._p.GetBodyFromFrameId(self._look.GetFrameId(geometry))
            X = body.EvalPoseInWorld(self._c).multiply(self._look.GetPoseInFrame(geometry))
            kind, size, points = _solid(self._look.GetShape(geometry))
            name = self._look.GetName(geometry).rpartition("::")[2]
            told.append((name, kind, self._mover(body), size, points, np.array(X.translation()), X.rotation().matrix()))
        return told

    def contacts(self) -> Any:
        ids = list(enumerate(self._shapes))
        return [(i, j) for i, a in ids for j, b in ids[i + 1 :] if not self._look.CollisionFiltered(a, b)]

    def surfaces(self) -> Any:
        from pydrake.multibody.plant import CalcContactFrictionFromSurfaceProperties

        of = [self._look.GetProximityProperties(one).GetPropertyOrDefault("material", "coulomb_friction", None)
              for one in self._shapes]  # fmt: skip
        mixed = CalcContactFrictionFromSurfaceProperties
        rubs = (mixed(of[i], of[j]).dynamic_friction() if of[i] and of[j] else 0.0 for i, j in self.contacts())
        return [[mu, mu, 0.0, 0.0, 0.0, 0.0] for mu in rubs]

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

    def _mover(self, body: Any) -> str:
        """Return the joint that moves a body; none of what stands on the world."""
        joint = self._moved.get(body.name())
        while joint is not None and not joint.num_velocities():
            joint = self._moved.get(joint.parent_body().name())
        return joint.name() if joint is not None else ""

    def inertias(self) -> Any:
        told = []
        for body in self._bodies:
            name, mass = self._mover(body), body.default_mass()
            if name:
                X, own = body.EvalPoseInWorld(self._c), body.CalcSpatialInertiaInBodyFrame(self._c)
                c, R = own.get_com(), X.rotation().matrix()
                J = own.CalcRotationalInertia().CopyToFullMatrix3() - mass * (c @ c * np.eye(3) - np.outer(c, c))
                told.append((name, float(mass), X.translation() + R @ c, R @ J @ R.T))
        return told


def _solid(shape: Any) -> tuple[str, list[float], Any]:
    """Return kind, sizes as MuJoCo's, and corners of one of Drake's shapes."""
    kind, none = type(shape).__name__, np.zeros((0, 3))
    if kind == "Box":
        return "box", [shape.width() / 2, shape.depth() / 2, shape.height() / 2], none
    if kind == "Ellipsoid":
        return "ellipsoid", [shape.a(), shape.b(), shape.c()], none
    if kind in ("Sphere", "Capsule", "Cylinder"):
        return kind.lower(), [shape.radius(), *([] if kind == "Sphere" else [shape.length() / 2])], none
    if kind == "HalfSpace":
        return "plane", [], none
    hull = shape.GetConvexHull()
    return "mesh", [], np.array([hull.vertex(i) for i in range(hull.num_vertices())])


def _floating(path: str) -> set[str]:
    """Return the links of a URDF that float: Drake makes no joints of theirs, and leaves them free."""
    joints = [joint for joint in ElementTree.parse(path).getroot().findall("joint") if joint.get("type") == "floating"]
    return {child.get("link", "") for joint in joints for child in joint.findall("child")}


def open_robot(path: str, urdf: bool) -> _Robot:
    """Return what Drake makes of a file."""
    return _Robot(path, urdf)
