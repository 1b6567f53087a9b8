"""DART's readers of robot files (`dartpy.utils.MjcfParser`, `DartLoader`); the root of a URDF is fixed."""

from __future__ import annotations

from typing import Any

import numpy as np

FORMATS, PACKAGE, MODULE = ("mjcf", "urdf"), "dartpy", "dartpy"
KINDS = {"FreeJoint": "free", "BallJoint": "ball", "RevoluteJoint": "hinge", "PrismaticJoint": "slide"}


class _Robot:
    free, ball = "rotation vector, p; world, world", "rotation vector; body"
    hidden = {  # noqa: RUF012
        "armature": "DART's joints have no armature.", "actuators": "DART's reader makes no actuators of a file.",
    }  # fmt: skip
    precision = 0.0
    loops = 0

    def __init__(self, path: str, urdf: bool) -> None:
        import dartpy

        self.version = dartpy.__version__
        if urdf:
            options = dartpy.utils.DartLoaderOptions(defaultRootJointType=dartpy.utils.DartLoaderRootJointType.FIXED)
            loader = dartpy.utils.DartLoader()
            loader.setOptions(options)
            found = loader.parseSkeleton(path)
            gravity = np.array([0.0, 0.0, -9.81])  # a URDF has none; DART's World has it along z too, a Skeleton not
            self._s = [found] if found is not None else []
        else:
            world = dartpy.utils.MjcfParser.readWorld(path)
            if world is None:
                raise ValueError("DART's reader returns nothing")
            self._s = [world.getSkeleton(i) for i in range(world.getNumSkeletons())]
            gravity = world.getGravity()
            self.loops = world.getConstraintSolver().getNumConstraints() if world.getNumSkeletons() else 0
            self._world = world
        if not self._s:
            raise ValueError("DART's reader returns nothing")
        self.joints, self._joints = [], []
        self.nq = 0
        for s in self._s:
            s.setGravity(gravity)
            for j in (s.getJoint(i) for i in range(s.getNumJoints())):
                if n := j.getNumDofs():
                    kind = KINDS.get(j.getType(), j.getType())
                    self.joints.append(
                        (
                            j.getName(),
                            j.getChildBodyNode().getName(),
                            kind,
                            self.nq + j.getIndexInSkeleton(0),
                            self.nq + j.getIndexInSkeleton(0),
                        )
                    )
                    self._joints.append((j, n))
            self.nq += s.getNumDofs()
        self.nv = self.nq
        self.actuators: dict[str, list[str]] = {}
        self.numbers = self._numbers()

    def _numbers(self) -> dict[str, dict[str, Any]]:
        told: dict[str, dict[str, Any]] = {}
        for j, n in self._joints:
            bounds = (j.getPositionLowerLimit(0), j.getPositionUpperLimit(0))
            if n > 1 or (bounds == (0.0, 0.0) and not j.areLimitsEnforced()):
                bounds = (-np.inf, np.inf)
            values = {
                "damping": j.getDampingCoefficient(0), "friction": j.getCoulombFriction(0),
                "stiffness": j.getSpringStiffness(0),
                "rest": j.getRestPosition(0) if n == 1 and j.getSpringStiffness(0) else 0.0,
                "lower": bounds[0], "upper": bounds[1],
            }  # fmt: skip
            for key, value in values.items():
                told.setdefault(key, {})[j.getName()] = [float(value)]
        return told

    def place(self, q: Any, v: Any) -> None:
        """A free joint counts from where its body stands in the file, its velocities are the world's all the same."""
        at, q = 0, np.array(q)
        for (_, _, kind, first, _), (joint, _) in zip(self.joints, self._joints, strict=True):
            if kind == "free":
                stands, here = joint.getTransformFromParentBodyNode(), slice(first, first + 6)
                q[here] = joint.convertToPositions(stands.inverse().multiply(joint.convertToTransform(q[here])))
        for s in self._s:
            n = s.getNumDofs()
            s.setPositions(q[at : at + n])
            s.setVelocities(v[at : at + n])
            at += n

    def mass_matrix(self) -> Any:
        M, at = np.zeros((self.nv, self.nv)), 0
        for s in self._s:
            n = s.getNumDofs()
            M[at : at + n, at : at + n] = s.getMassMatrix()
            at += n
        return M

    def bias(self) -> Any:
        return np.concatenate([s.getCoriolisAndGravityForces() for s in self._s])

    def energy(self) -> float:
        bodies = [s.getBodyNode(i) for s in self._s for i in range(s.getNumBodyNodes())]
        return (
            float(
                sum(
                    b.computeKineticEnergy() + b.computePotentialEnergy(s.getGravity())
                    for s in self._s
                    for b in (s.getBodyNode(i) for i in range(s.getNumBodyNodes()))
                )
            )
            if bodies
            else 0.0
        )

    def frames(self) -> Any:
        bodies = [s.getBodyNode(i) for s in self._s for i in range(s.getNumBodyNodes())]
        placed = {b.getName(): b.getWorldTransform() for b in bodies}
        return {name: (np.array(X.translation()), np.array(X.rotation())) for name, X in placed.items()}

    def inertias(self) -> Any:
        told = []
        for s in self._s:
            for b in (s.getBodyNode(i) for i in range(s.getNumBodyNodes())):
                joint = b.getParentJoint()
                while not joint.getNumDofs() and joint.getParentBodyNode() is not None:
                    joint = joint.getParentBodyNode().getParentJoint()
                if joint.getNumDofs():
                    X, own = b.getWorldTransform(), b.getInertia()
                    R, mass, c = np.array(X.rotation()), float(b.getMass()), np.array(own.getLocalCOM())
                    J = np.array(own.getMoment())
                    told.append((joint.getName(), mass, X.translation() + R @ c, R @ J @ R.T))
        return told


def open_robot(path: str, urdf: bool) -> _Robot:
    """Return what DART makes of a file."""
    return _Robot(path, urdf)
