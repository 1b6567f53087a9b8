"""DART's readers of robot files (`dartpy.utils.MjcfParser`, `DartLoader`); the root of a URDF is fixed."""

from __future__ import annotations

from typing import Any

import numpy as np

FORMATS, PACKAGE, MODULE = ("mjcf", "urdf"), "dartpy", "dartpy"
TRIED = ("6.20", "6.20")
KINDS = {"FreeJoint": "free", "BallJoint": "ball", "RevoluteJoint": "hinge", "PrismaticJoint": "slide"}


class _Robot:
    free, ball = "rotation vector, p; world, world", "rotation vector; body"
    hidden = {  # noqa: RUF012
        "armature": "DART's joints have no armature.",
        "actuators": "DART's reader ignores actuators of a file.",
        "damping v|v|": "DART's dampers are linear.", "damping v^3": "DART's dampers are linear.",
        "stiffness x^2": "DART's springs are linear.",
        "stiffness x^3": "DART's springs are linear.", "tendons": "DART has no tendons.",
        "softness": "DART's rows have no solref.", "keyframes": "DART has no keyframes.",
        **dict.fromkeys(("spin", "roll", "margin"), "DART's contacts have only sliding friction."),
    }  # fmt: skip

    def __init__(self, path: str, urdf: bool) -> None:
        import dartpy

        self.version = dartpy.__version__
        loops = 0
        if urdf:
            options = dartpy.utils.DartLoaderOptions(defaultRootJointType=dartpy.utils.DartLoaderRootJointType.FIXED)
            loader = dartpy.utils.DartLoader()
            loader.setOptions(options)
            found = loader.parseSkeleton(path)
            gravity = np.array([0.0, 0.0, -9.81])  # a URDF has none; DART's World has it along z too, a Skeleton not
            self._s = [found] if found is not None else []
        else:
            if (world := dartpy.utils.MjcfParser.readWorld(path)) is None:
                raise ValueError("DART's reader returns nothing")
            self._s = [world.getSkeleton(i) for i in range(world.getNumSkeletons())]
            gravity = world.getGravity()
            loops = world.getConstraintSolver().getNumConstraints() if world.getNumSkeletons() else 0
            self._world = world
        if not self._s:
            raise ValueError("DART's reader returns nothing")
        bound = (s.getJoint(i) for s in self._s for i in range(s.getNumJoints()))
        loops += sum(joint.getActuatorType() == dartpy.dynamics.ActuatorType.MIMIC for joint in bound)
        self.loops: Any = [("", [], [])] * loops
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
        if any(node.getShape().getType() == "MeshShape" for _, node in self._solids()):
            self.unseen = {"shapes": "DART's Python does not show the corners of meshes."}
        self.numbers = self._numbers()

    def _numbers(self) -> dict[str, dict[str, Any]]:
        told: dict[str, dict[str, Any]] = {}
        for j, n in self._joints:
            bounds = (j.getPositionLowerLimit(0), j.getPositionUpperLimit(0))
            if n > 1 or (bounds == (0.0, 0.0) and not j.areLimitsEnforced()):
                bounds = (-np.inf, np.inf)
            values = {
                "damping": [j.getDampingCoefficient(k) for k in range(n)],
                "friction": [j.getCoulombFriction(k) for k in range(n)], "stiffness": j.getSpringStiffness(0),
                "rest": j.getRestPosition(0) if n == 1 and j.getSpringStiffness(0) else 0.0,
                "lower": bounds[0], "upper": bounds[1],
                "least force": j.getForceLowerLimit(0), "most force": j.getForceUpperLimit(0),
            }  # fmt: skip
            for key, value in values.items():
                told.setdefault(key, {})[j.getName()] = np.atleast_1d(value).astype(float).tolist()
        return told

    def place(self, q: Any, v: Any) -> None:
        """A free joint counts from where its body stands in the file, its velocities are the world's."""
        at, q, self._T = 0, np.array(q), np.eye(self.nv)
        for (_, _, kind, first, _), (joint, _) in zip(self.joints, self._joints, strict=True):
            if kind == "free":
                stands, here = joint.getTransformFromParentBodyNode(), slice(first, first + 6)
                on = joint.getChildBodyNode().getParentBodyNode()
                if on is not None:  # then its velocities are in the axes of that
                    stands = on.getWorldTransform().multiply(stands)
                    self._T[here, here] = np.kron(np.eye(2), np.array(on.getWorldTransform().rotation()).T)
                q[here] = joint.convertToPositions(stands.inverse().multiply(joint.convertToTransform(q[here])))
        v = self._T @ v
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
        return self._T.T @ M @ self._T

    def bias(self) -> Any:
        return self._T.T @ np.concatenate([s.getCoriolisAndGravityForces() for s in self._s])

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

    def _solids(self) -> Any:
        bodies = [s.getBodyNode(i) for s in self._s for i in range(s.getNumBodyNodes())]
        nodes = [(body, body.getShapeNode(k)) for body in bodies for k in range(body.getNumShapeNodes())]
        return [(body, node) for body, node in nodes if node.hasCollisionAspect()]

    def shapes(self) -> Any:
        told = []
        for body, node in self._solids():
            X, (kind, size, points) = node.getWorldTransform(), _solid(node.getShape())
            told.append(
                (node.getName(), kind, _mover(body), size, points, np.array(X.translation()), np.array(X.rotation()))
            )
        return told

    def contacts(self) -> Any:
        """Of one skeleton its bodies meet where it says so, those of one joint where it says that too."""
        bodies, found = [body for body, _ in self._solids()], []
        for i, a in enumerate(bodies):
            for j, b in enumerate(bodies[i + 1 :], start=i + 1):
                s, near = a.getSkeleton(), a.getParentBodyNode() == b or b.getParentBodyNode() == a
                own = s == b.getSkeleton()
                fixed = not (s.getNumDofs() or b.getSkeleton().getNumDofs())
                if a != b and not fixed and (not own or (
                    s.isEnabledSelfCollisionCheck() and (s.isEnabledAdjacentBodyCheck() or not near)
                )):  # fmt: skip
                    found.append((i, j))
        return found

    def surfaces(self) -> Any:
        """Of two shapes the lesser friction."""
        of = [node.getDynamicsAspect().getFrictionCoeff() if node.hasDynamicsAspect() else 1.0
              for _, node in self._solids()]  # fmt: skip
        rubs = (min(of[i], of[j]) for i, j in self.contacts())
        return [[mu, mu, 0.0, 0.0, 0.0, 0.0] for mu in rubs]

    def inertias(self) -> Any:
        told = []
        for s in self._s:
            for b in (s.getBodyNode(i) for i in range(s.getNumBodyNodes())):
                if joint := _mover(b):
                    X, own = b.getWorldTransform(), b.getInertia()
                    R, mass, c = np.array(X.rotation()), float(b.getMass()), np.array(own.getLocalCOM())
                    J = np.array(own.getMoment())
                    told.append((joint, mass, X.translation() + R @ c, R @ J @ R.T))
        return told


def _mover(body: Any) -> str:
    """Return the joint that moves a body; none of what stands on the world."""
    joint = body.getParentJoint()
    while not joint.getNumDofs() and joint.getParentBodyNode() is not None:
        joint = joint.getParentBodyNode().getParentJoint()
    return str(joint.getName()) if joint.getNumDofs() else ""


def _solid(shape: Any) -> tuple[str, list[float], Any]:
    """Return kind, sizes as MuJoCo's, and corners of one of DART's shapes."""
    kind, none = shape.getType().removesuffix("Shape").lower(), np.zeros((0, 3))
    if kind == "box":
        return kind, [float(x) / 2 for x in shape.getSize()], none
    if kind == "ellipsoid":
        return kind, [float(x) for x in shape.getRadii()], none
    if kind in ("sphere", "capsule", "cylinder"):
        return kind, [shape.getRadius(), *([] if kind == "sphere" else [shape.getHeight() / 2])], none
    return kind, [], none


def open_robot(path: str, urdf: bool) -> _Robot:
    """Return what DART makes of a file."""
    return _Robot(path, urdf)
