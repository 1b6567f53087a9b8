"""Scenes with friction in DART: rigid contacts, friction in a box, solved for within a step."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations
from typing import Any

import dartpy
import numpy as np
from scipy.spatial.transform import Rotation

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Body, Scene, Shape
from crossbody.cases.scene_contacts import contacts
from crossbody.engines._contacts import Contacts
from crossbody.engines._rubbing import RIGID, Push, steps_of, why_no_steps
from crossbody.engines._scene import Forces, masses
from crossbody.engines.nearest import Pose

THICK, WIDE = 1.0, 40.0  # sides of the box that stands for a plane, m
HOLDS, BOUND = 1e-3, 0.9
"""Part of the gravity of a step by which places may slip that hold: DART's mixing of constraint forces
leaves 1e-5 of what friction bears. And part of its bound below which friction holds: that is mu times the
normal force of a problem without friction, from which the normal force of a box that is pushed differs."""
LINK = 1e-12
"""Mass, of its body's, and moments of inertia, kg m^2, of what DART needs between joints and of points."""
JOINTS = {"free": "Free", "ball": "Ball", "hinge": "Revolute", "slide": "Prismatic"}
DETECTORS = {
    "dart": dartpy.collision.DARTCollisionDetector, "fcl": dartpy.collision.FCLCollisionDetector,
    "bullet": dartpy.collision.BulletCollisionDetector, "ode": dartpy.collision.OdeCollisionDetector,
}  # fmt: skip
OWN = "dart"
SOLIDS = ("plane", "sphere", "box", "capsule", "ellipsoid")


def detector_of(scene: Scene, usual: str) -> str:
    """Return what finds the contacts of a scene: FCL where DART's own detector would make a hull of an ellipsoid."""
    return "fcl" if usual == OWN and any(map(_slants, _touching(scene))) else usual


def _touching(scene: Scene) -> list[Shape]:
    return [shape for contact in contacts(scene) for shape in (contact.first, contact.second)]


def _slants(shape: Shape) -> bool:
    return shape.type == "ellipsoid" and len(set(shape.size)) > 1


def why_not(scene: Scene, detector: str) -> str | None:
    """Return why DART cannot run a scene with friction, with one of its detectors; None if it can."""
    if found := why_no_steps("DART", scene):
        return found
    forces = Forces(scene)
    if forces.armature.any():
        return "DART's joints have no armature."
    if any(tendon.bodies for tendon in scene.tendons):
        return "DART has no tendons between points."
    for contact in contacts(scene):
        if contact.second.type not in SOLIDS:
            return (
                f"DART is given only solids of type {', '.join(SOLIDS)}; {contact.second.name!r} is a "
                f"{contact.second.type}."
            )
        for shape in (contact.first, contact.second):
            if detector == "fcl" and shape.type == "capsule":
                return (
                    f"DART with FCL's detector treats the capsule {shape.name!r} as a sphere; its own "
                    "detector has capsules."
                )
            if detector == OWN and _slants(shape):
                return (
                    f"DART's own detector treats the ellipsoid {shape.name!r} as a hull of 162 points, which touches "
                    "late; FCL's has ellipsoids."
                )
    return None


class Rubs:
    """A `Stepper` of a scene with friction; settings: dt, detector, restitution, sleep."""

    def __init__(self, case: Case, used: Mapping[str, Any]) -> None:
        assert case.scene is not None
        self.case, self.scene, self.dt = case, case.scene, steps_of(case, float(used["dt"]))[1]
        self.world, self.tree = dartpy.simulation.World(), dartpy.dynamics.Skeleton("scene")
        self.world.setGravity(np.array(self.scene.gravity))
        self.world.setTimeStep(self.dt)
        self.holds = HOLDS * float(np.linalg.norm(self.scene.gravity)) * self.dt
        sleep = self.world.getDeactivationOptions()
        sleep.mEnabled = bool(used["sleep"])
        self.world.setDeactivationOptions(sleep)
        self.forces, self.touching = Forces(self.scene), Contacts(self.scene)
        self.nodes: dict[str, Any] = {}
        for body in self.scene.bodies:
            self.nodes[body.name] = self._add(body)
        fixed = self.nodes[""] = self.tree.createWeldJointAndBodyNodePair()[1]
        fixed.setInertia(_small(1.0))
        self.shapes: dict[str, str] = {}
        self.friction: dict[str, float] = {}
        self._collide(float(used["restitution"]))
        self.tree.enableSelfCollisionCheck()
        self.tree.enableAdjacentBodyCheck()
        self.world.addSkeleton(self.tree)
        self._only_pairs(DETECTORS[str(used["detector"])]())
        self.joints = [(joint, self.tree.getJoint(joint.name)) for joint in self.scene.joints]
        self.start()

    def _add(self, body: Body) -> Any:
        """Add a body behind its joints, and what DART needs between them."""
        carrier: Any = self.nodes.get(body.parent)
        where = _placed(body.position, matrices(np.array(body.orientation)))
        own = [joint for joint in self.scene.joints if joint.body == body.name]
        for joint in own:
            made, node = getattr(self.tree, f"create{JOINTS[joint.type]}JointAndBodyNodePair")(carrier)
            made.setName(joint.name)
            if joint.type != "free":
                made.setTransformFromParentBodyNode(where.multiply(_placed(joint.anchor)))
                made.setTransformFromChildBodyNode(_placed(joint.anchor))
            if joint.type in ("hinge", "slide"):
                made.setAxis(np.array(joint.axis))
            node.setInertia(_small(body.mass or 1.0))
            carrier, where = node, _placed((0.0, 0.0, 0.0))
        if not own:
            made, carrier = self.tree.createWeldJointAndBodyNodePair(carrier)
            made.setTransformFromParentBodyNode(where)
        if body.mass:
            xx, yy, zz, xy, xz, yz = body.inertia
            moment = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            moment += LINK * np.eye(3) * (not moment.any())
            carrier.setInertia(dartpy.dynamics.Inertia(body.mass, np.array(body.com), moment))
        carrier.setName(body.name)
        return carrier

    def _collide(self, e: float) -> None:
        """Give every pair solids of its own, on bodies of their own: DART tells apart bodies alone, not solids.

        A pair's friction is the least of both, its restitution their product.
        """
        self.pairs = []
        for contact in contacts(self.scene):
            ends = []
            for shape in (contact.first, contact.second):
                joint, node = self.tree.createWeldJointAndBodyNodePair(self.nodes[shape.body])
                place, solid = _solid(shape)
                joint.setTransformFromParentBodyNode(place)
                node.setInertia(_small(1.0))
                node.setName(f"{contact.pair.name} {shape.name}")
                made = node.createShapeNode(solid)
                made.createCollisionAspect()
                surface = made.createDynamicsAspect()
                surface.setFrictionCoeff(contact.friction)
                surface.setRestitutionCoeff(e**0.5)
                self.shapes[made.getName()], self.friction[made.getName()] = shape.name, contact.friction
                ends.append(node)
            self.pairs.append(tuple(ends))

    def _only_pairs(self, detector: Any) -> None:
        solver = self.world.getConstraintSolver()
        solver.setCollisionDetector(detector)
        filters = solver.getCollisionOption().collisionFilter  # its own: the option is a copy
        nodes = [node for pair in self.pairs for node in pair]
        for one, two in combinations(nodes, 2):
            if (one, two) not in self.pairs:
                filters.addBodyNodePairToBlackList(one, two)

    def start(self) -> tuple[Floats, Floats]:
        """See `Stepper`."""
        self.forces.begin(self.case.act0)
        self.world.setTime(0.0)
        q, v = self.case.q0, self.case.v0
        self.tree.clearConstraintImpulses()
        self._put(q, v)
        return q, v

    def _put(self, q: Floats, v: Floats) -> None:
        for joint, own in self.joints:
            at, first = self.forces.at[joint.name], self.forces.place[joint.name]
            if joint.type == "free":
                turned = matrices(q[at + 3 : at + 7])
                own.setPositions(dartpy.dynamics.FreeJoint.convertToPositions(_placed(q[at : at + 3], turned)))
                own.setVelocities(np.concatenate([turned @ v[first + 3 : first + 6], v[first : first + 3]]))
            elif joint.type == "ball":
                own.setPositions(dartpy.dynamics.BallJoint.convertToPositions(matrices(q[at : at + 4])))
                own.setVelocities(v[first : first + 3])
            else:
                own.setPosition(0, q[at] - joint.reference)
                own.setVelocity(0, v[first])

    def _state(self) -> tuple[Floats, Floats]:
        q, v = np.empty(self.scene.nq), np.empty(self.scene.nv)
        for joint, own in self.joints:
            at, first = self.forces.at[joint.name], self.forces.place[joint.name]
            rates, places = own.getVelocities(), own.getPositions()
            if joint.type == "free":
                stands = own.getRelativeTransform()
                turned = np.array(stands.rotation())
                q[at : at + 3], q[at + 3 : at + 7] = stands.translation(), _quaternion(turned)
                v[first : first + 3], v[first + 3 : first + 6] = rates[3:], turned.T @ rates[:3]
            elif joint.type == "ball":
                q[at : at + 4] = _quaternion(np.array(dartpy.dynamics.BallJoint.convertToRotation(places)))
                v[first : first + 3] = rates
            else:
                q[at], v[first] = places[0] + joint.reference, rates[0]
        return q, v

    def change(self, values: Floats, t: float) -> None:
        """See `Stepper`."""
        self.forces.change(values, t)

    def step(self, t: float) -> tuple[Floats, Floats, list[Push]]:
        """See `Stepper`."""
        self.forces.t = t
        self._apply(*self._state())
        self.world.step()
        return *self._state(), list(map(self._push, self.world.getLastCollisionResult().getContacts()))

    def _apply(self, q: Floats, v: Floats) -> None:
        acting = self.forces(q, v)
        for joint, own in self.joints:
            force = acting[self.forces.moved(joint)]
            if joint.type == "free":
                at = self.forces.at[joint.name]
                force = np.concatenate([matrices(q[at + 3 : at + 7]) @ force[3:], force[:3]])
            own.setForces(force)
        gravity = np.array(self.scene.gravity)
        lifted = [(body, -body.weightless * body.mass * gravity) for body in self.scene.bodies if body.weightless]
        own_bodies = {body.name: body for body in self.scene.bodies}
        pushed = zip((own_bodies[push.body] for push in self.scene.pushes), self.forces.pushes, strict=True)
        for body, each in (*lifted, *pushed):
            self.nodes[body.name].addExtForce(each, np.array(body.com), False, True)

    def _push(self, met: Any) -> Push:
        names = [solid.getShapeFrame().getName() for solid in (met.collisionObject1, met.collisionObject2)]
        one, two = (self.shapes[name] for name in names)
        force, normal = np.array(met.force), np.array(met.normal)
        slip = self._velocity(met.collisionObject1, met.point) - self._velocity(met.collisionObject2, met.point)
        across = slip - float(slip @ normal) * normal
        bears = float(force @ normal)
        bound = np.linalg.norm(force - bears * normal) >= BOUND * self.friction[names[0]] * abs(bears)
        return Push(two, one, np.array(met.point), force, bool(bound and np.linalg.norm(across) > self.holds))

    @staticmethod
    def _velocity(solid: Any, point: Any) -> Floats:
        node = solid.getShapeFrame().asShapeNode().getBodyNodePtr()
        own = node.getWorldTransform().inverse().multiply(_placed(point)).translation()
        return np.array(node.getLinearVelocity(own))

    def pose(self, body: str) -> Pose:
        """See `Stepper`."""
        found = self.nodes[body].getWorldTransform()
        return np.array(found.rotation()), np.array(found.translation())

    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """See `Stepper`."""
        gaps, energy = np.empty((len(q), self.touching.count)), np.empty((len(q), 2))
        gravity = np.array(self.scene.gravity)
        for i, (place, rate) in enumerate(zip(q, v, strict=True)):
            self._put(place, rate)
            gaps[i] = self.touching.touches(self.pose).gap
            energy[i, 0] = 0.5 * rate @ self.mass_matrix(place) @ rate
            energy[i, 1] = -sum(
                (1.0 - body.weightless) * body.mass * float(gravity @ (R @ np.array(body.com) + p))
                for body in self.scene.bodies for R, p in (self.pose(body.name),)
            )  # fmt: skip
        energy[:, 1] += self.forces.energy(q)
        return gaps, energy

    def mass_matrix(self, q: Floats) -> Floats:
        """Return M (nv, nv) in the scene's coordinates, at DART's present positions, which are q."""
        J = self._turn(q)
        found: Floats = J @ self.tree.getMassMatrix() @ J.T
        return found

    def _turn(self, q: Floats) -> Floats:
        """Return dv/dv_d (nv, nv), v_d DART's: a free joint's angular velocity first, in world axes."""
        J: Floats = np.zeros((self.scene.nv, self.scene.nv))
        for joint, own in self.joints:
            at, first, to = self.forces.at[joint.name], self.forces.place[joint.name], own.getIndexInSkeleton(0)
            if joint.type == "free":
                J[first : first + 3, to + 3 : to + 6] = np.eye(3)
                J[first + 3 : first + 6, to : to + 3] = matrices(q[at + 3 : at + 7]).T
            else:
                moved = self.forces.moved(joint)
                J[moved, to : to + moved.stop - moved.start] = np.eye(moved.stop - moved.start)
        return J

    def physics(self) -> dict[str, Any]:
        """Return what the audit is told, read back from DART."""

        def M(q: Floats) -> Floats:
            self._put(q, np.zeros(self.scene.nv))
            return self.mass_matrix(q)

        def bias(q: Floats, v: Floats) -> Floats:
            self.forces.still()
            self._put(q, v)
            total: Floats = self._turn(q) @ self.tree.getCoriolisAndGravityForces() - self.forces(q, v)
            for body in (body for body in self.scene.bodies if body.weightless):
                J = self._turn(q) @ self.tree.getLinearJacobian(self.nodes[body.name], np.array(body.com)).T
                total += body.weightless * body.mass * J @ np.array(self.scene.gravity)
            return total

        own = {body.name: self.nodes[body.name].getMass() for body in self.scene.bodies}
        return {
            "masses": masses(self.scene, own), "gravity": float(np.linalg.norm(self.world.getGravity())),
            "M": M, "bias": bias, "q0": self.case.q0, "v0": self.case.v0,
            "set": self._set(), "hidden": dict.fromkeys(RIGID, "Its contacts are rigid, and are solved within a step."),
        }  # fmt: skip

    def _set(self) -> dict[str, Any]:
        """Return settings as the world has them: of pairs the product of both restitutions."""
        solver = self.world.getConstraintSolver()
        found: dict[str, Any] = {"detector": solver.getCollisionDetector().getType()}
        bounces = [
            math.prod(node.getShapeNode(0).getDynamicsAspect().getRestitutionCoeff() for node in pair)
            for pair in self.pairs
        ]
        found |= {"restitution": bounces[0]} if len(set(bounces)) == 1 else {}
        return found | {"sleep": bool(self.world.getDeactivationOptions().mEnabled)}

    def counts(self) -> Mapping[str, int]:
        """See `Stepper`."""
        return {}


def _small(mass: float) -> Any:
    return dartpy.dynamics.Inertia(LINK * mass, np.zeros(3), LINK * np.eye(3))


def _placed(position: Any, turned: Any = None) -> Any:
    found = dartpy.math.Isometry3()
    found.set_translation(np.array(position))
    if turned is not None:
        found.set_rotation(turned)
    return found


def _quaternion(turned: Floats) -> Floats:
    return np.asarray(Rotation.from_matrix(turned).as_quat(scalar_first=True))


def _solid(shape: Shape) -> tuple[Any, Any]:
    """Return place and solid of a shape; of a plane a box below it."""
    turned, at, size = matrices(np.array(shape.orientation)), np.array(shape.position), np.array(shape.size)
    own = dartpy.dynamics
    if shape.type == "plane":
        return _placed(at - 0.5 * THICK * turned[:, 2], turned), own.BoxShape([WIDE, WIDE, THICK])
    solids = {
        "sphere": lambda: own.SphereShape(size[0]), "box": lambda: own.BoxShape(2.0 * size),
        "capsule": lambda: own.CapsuleShape(size[0], 2.0 * size[1]),
        "ellipsoid": lambda: own.EllipsoidShape(2.0 * size),
    }  # fmt: skip
    return _placed(at, turned), solids[shape.type]()
