"""Pinocchio's readers of robot files: `buildModelAndConstraintsFromMJCF`, `buildModelFromUrdf`."""

from __future__ import annotations

import os
import re
from typing import Any

import numpy as np

FORMATS, PACKAGE, MODULE = ("mjcf", "urdf"), "pin", "pinocchio"
TRIED = ("4.1", "4.1")
NO_SPRINGS = "Pinocchio's model has no springs."


def kind_of(name: str) -> str:
    """Return the kind of a joint by Pinocchio's name of its model."""
    short = name.removeprefix("JointModel")
    if short == "FreeFlyer":
        return "free"
    if short.startswith("Spherical") and "ZYX" not in short:
        return "ball"
    if re.fullmatch(r"RUB[XYZ]|RevoluteUnboundedUnaligned", short):
        return "unbounded"
    return "hinge" if re.fullmatch(r"R[XYZ]|RevoluteUnaligned", short) else (
        "slide" if re.fullmatch(r"P[XYZ]|PrismaticUnaligned", short) else short)  # fmt: skip


class _Robot:
    free, ball = "p, xyzw; body, body", "xyzw; body"
    hidden = {  # noqa: RUF012
        "stiffness": NO_SPRINGS, "stiffness x^2": NO_SPRINGS, "stiffness x^3": NO_SPRINGS,
        "rest": NO_SPRINGS, "damping v|v|": "Pinocchio's dampers are linear.",
        "damping v^3": "Pinocchio's dampers are linear.",
        "actuators": "Pinocchio's model has no actuators.", "tendons": "Pinocchio's model has no tendons.",
        "surfaces": "Pinocchio's shapes have no friction.",
        "softness": "Pinocchio's reader ignores solref.",
    }  # fmt: skip

    def __init__(self, path: str, urdf: bool) -> None:
        import pinocchio as pin

        self._pin, self._urdf = pin, urdf
        self.unseen = {"contacts": "Pinocchio's readers leave the choice of pairs to the user."}
        self.version = pin.__version__
        constraints: Any = []
        if urdf:
            self._m = pin.buildModelFromUrdf(path)
        else:
            self._m, *constraints = pin.buildModelAndConstraintsFromMJCF(path)
        self._d = self._m.createData()
        self._bare = self._m.copy()
        self._bare.armature[:] = 0.0
        self.nq, self.nv = self._m.nq, self._m.nv
        self._loops = [one for group in constraints for one in group]
        kinds = {"PointAnchorConstraintModel": "connect", "FrameAnchorConstraintModel": "weld"}
        self.loops: Any = [(kinds.get(type(one).__name__, ""), [], []) for one in self._loops]
        try:
            of = pin.GeometryType.COLLISION
            read = pin.buildGeomFromUrdf(self._m, path, of, package_dirs=[os.path.dirname(path)]) if urdf else (
                pin.buildGeomFromMJCF(self._m, path, of))  # fmt: skip
            self._shapes = list(read.geometryObjects)
        except Exception as error:  # shapes are read by a call of their own
            said = str(error).strip().rpartition("message:")[2].strip().rstrip(".")
            self.unseen = self.unseen | {"shapes": f"Pinocchio's reader of shapes fails: {said}."}
            self.refused = ("shapes",)
        self._bodies = [f for f in self._m.frames if f.type == pin.FrameType.BODY]
        self._last: dict[int, str] = {}
        self.joints = [joint for i in range(1, self._m.njoints) for joint in self._joints(i)]
        self.numbers = self._numbers()
        self.keys = {one.key(): one.data().tolist() for one in self._m.referenceConfigurations}

    def _joints(self, i: int) -> list[tuple[str, str, str, int, int]]:
        """Return the joints that one of Pinocchio's is: several of one body are a composite."""
        model, name = self._m.joints[i], self._m.names[i]
        bodies = [frame.name for frame in self._bodies if frame.parentJoint == i]
        body = bodies[0] if bodies else ""
        parts = list(model.extract().joints) if model.shortname() == "JointModelComposite" else [model]
        single = len(parts) == 1
        found = [
            (name if single else f"{name} {k}", body, kind_of(part.shortname()), part.idx_q, part.idx_v)
            for k, part in enumerate(parts)
        ]
        self._last[i] = found[-1][0]
        return found

    def _numbers(self) -> dict[str, dict[str, Any]]:
        m, told = self._m, dict[str, dict[str, Any]]()
        for name, _, kind, at, first in self.joints:
            bounded, dof = kind in ("hinge", "slide"), slice(first, first + {"free": 6, "ball": 3}.get(kind, 1))
            values = {
                "armature": m.armature[dof], "damping": m.damping[dof],
                "friction": m.upperDryFrictionLimit[dof],
                "lower": m.lowerPositionLimit[at] if bounded else -np.inf,
                "upper": m.upperPositionLimit[at] if bounded else np.inf,
                "least force": m.lowerEffortLimit[first], "most force": m.upperEffortLimit[first],
            }  # fmt: skip
            for key, value in values.items():
                values_ = np.atleast_1d(value).astype(float)
                values_[np.abs(values_) >= np.finfo(float).max] *= 2.0
                told.setdefault(key, {})[name] = values_.tolist()
        return told

    def place(self, q: Any, v: Any) -> None:
        """Of a URDF a joint that floats counts from where it stands."""
        self._q, self._v = np.array(q), v
        for name, _, kind, at, _ in self.joints if self._urdf else ():
            if kind == "free":
                stands = self._m.jointPlacements[self._m.getJointId(name)]
                self._q[at : at + 7] = self._pin.SE3ToXYZQUAT(stands.inverse() * self._pin.XYZQUATToSE3(q[at : at + 7]))
        self._pin.framesForwardKinematics(self._m, self._d, self._q)

    def ends(self) -> Any:
        told = []
        for one in self._loops:
            pairs = ((one.joint1_id, one.joint1_placement), (one.joint2_id, one.joint2_placement))
            placed = [self._d.oMi[i] * place for i, place in pairs]
            told.append([(np.array(M.translation), np.array(M.rotation)) for M in placed])
        return told

    def shapes(self) -> Any:
        told = []
        for one in self._shapes:
            M, kind, size, points = self._d.oMi[one.parentJoint] * one.placement, *_solid(one.geometry, one.meshScale)
            joint = self._last.get(one.parentJoint, "")
            told.append((one.name, kind, joint, size, points, np.array(M.translation), np.array(M.rotation)))
        return told

    def mass_matrix(self) -> Any:
        M = np.triu(self._pin.crba(self._m, self._d, self._q))
        return M + np.triu(M, 1).T

    def bias(self) -> Any:
        return np.array(self._pin.nonLinearEffects(self._m, self._d, self._q, self._v))

    def energy(self) -> float:
        """Of 4.1.0's kinetic energy some joints leave out armature, which M has: added here."""
        kinetic = self._pin.computeKineticEnergy(self._bare, self._d, self._q, self._v)
        kinetic += self._m.armature @ self._v**2 / 2
        return float(kinetic + self._pin.computePotentialEnergy(self._m, self._d, self._q))

    def frames(self) -> Any:
        placed = {f.name: self._d.oMi[f.parentJoint] * f.placement for f in self._bodies}
        return {name: (np.array(M.translation), np.array(M.rotation)) for name, M in placed.items()}

    def inertias(self) -> Any:
        told = []
        for i in range(1, self._m.njoints):
            Y = self._d.oMi[i].act(self._m.inertias[i])
            told.append((self._last[i], float(Y.mass), np.array(Y.lever), np.array(Y.inertia)))
        return told


def _solid(shape: Any, scale: Any) -> tuple[str, list[float], Any]:
    """Return kind, sizes as MuJoCo's, and corners of one of coal's shapes."""
    kind, none = type(shape).__name__, np.zeros((0, 3))
    own = {"Sphere": ("radius",), "Capsule": ("radius", "halfLength"), "Cylinder": ("radius", "halfLength")}
    if kind in own:
        return kind.lower(), [float(getattr(shape, key)) for key in own[kind]], none
    if kind in ("Box", "Ellipsoid"):
        return kind.lower(), list(map(float, shape.halfSide if kind == "Box" else shape.radii)), none
    if kind in ("Halfspace", "Plane"):
        return "plane", [], none
    points = shape.vertices() if callable(getattr(shape, "vertices", None)) else none
    if not len(points) and hasattr(shape, "points"):
        points = shape.points()
    return "mesh", [], np.array(points)


def open_robot(path: str, urdf: bool) -> _Robot:
    """Return what Pinocchio makes of a file; a URDF's root is fixed."""
    return _Robot(path, urdf)
