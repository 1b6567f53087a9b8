"""DART: rigid contacts with a restitution, a linear complementarity problem in every time step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import dartpy
import numpy as np

from crossbody.cases import Case, CaseUnsupported, Parameter
from crossbody.cases import closed_forms as cf
from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Shape
from crossbody.cases.scene_contacts import frictional
from crossbody.engines import settings as _settings
from crossbody.engines._line import Line, line
from crossbody.engines._peer import HIDDEN, STEPS, no_rigid_contact, settings, stepped, why_beside, why_not
from crossbody.engines._real_time import one_set
from crossbody.engines._rubbing import RubbingRun
from crossbody.engines.contract import Engine, Run
from crossbody.engines.dart import _contacts

THICK, WIDE = 1.0, 2.0  # m, of the box that stands for a plane
DETECTOR = {"matched": "dart", "default": "fcl"}


class World:
    """A `Stepper`: bodies on prismatic joints along the line, with their shapes and the world's."""

    def __init__(self, scene: Line, e: float) -> None:
        self.scene, self.dt = scene, 0.0
        self.world = dartpy.simulation.World()
        self.world.setGravity(-scene.gravity * scene.axis)
        self.bodies = [self._body(i, e) for i in range(len(scene.masses))]
        self._add(dartpy.dynamics.Skeleton("world"), "", e)

    def _body(self, i: int, e: float) -> Any:
        scene = self.scene
        skeleton = dartpy.dynamics.Skeleton(scene.bodies[i])
        joint, body = skeleton.createPrismaticJointAndBodyNodePair()
        joint.setAxis(scene.axis)
        joint.setTransformFromParentBodyNode(_placed(scene.places[i]))
        body.setInertia(
            dartpy.dynamics.Inertia(float(scene.masses[i]), np.zeros(3), float(scene.masses[i]) * np.eye(3))
        )
        return self._add(skeleton, scene.bodies[i], e)

    def _add(self, skeleton: Any, name: str, e: float) -> Any:
        """Add the shapes of a body, without friction: a pair's restitution is the product of both."""
        for shape in (shape for shape in self.scene.shapes if shape.body == name):
            place, solid = _solid(shape)
            body = skeleton.getBodyNode(0) if name else skeleton.createWeldJointAndBodyNodePair()[1]
            node = body.createShapeNode(solid)
            node.setRelativeTransform(_placed(*place))
            node.createCollisionAspect()
            surface = node.createDynamicsAspect()
            surface.setRestitutionCoeff(e**0.5)
            surface.setFrictionCoeff(0.0)
        self.world.addSkeleton(skeleton)
        return skeleton

    def start(self) -> None:
        """See `Stepper`."""
        self.world.setTime(0.0)
        for body, q, v in zip(self.bodies, self.scene.q0.tolist(), self.scene.v0.tolist(), strict=True):
            body.setPositions([q])
            body.setVelocities([v])
            body.clearConstraintImpulses()

    def step(self, dt: float) -> tuple[list[float], list[float]]:
        """See `Stepper`."""
        if dt != self.dt:
            self.world.setTimeStep(dt)
            self.dt = dt
        self.world.step()
        return [b.getPosition(0) for b in self.bodies], [b.getVelocity(0) for b in self.bodies]


def _placed(position: Any, turned: Any = None) -> Any:
    found = dartpy.math.Isometry3()
    found.set_translation(position)
    if turned is not None:
        found.set_rotation(turned)
    return found


def _solid(shape: Shape) -> tuple[tuple[Floats, Floats], Any]:
    """Return place and solid of a shape; of a plane a box below it."""
    turned, at = matrices(np.array(shape.orientation)), np.array(shape.position)
    if shape.type == "sphere":
        return (at, turned), dartpy.dynamics.SphereShape(shape.size[0])
    return (at - 0.5 * THICK * turned[:, 2], turned), dartpy.dynamics.BoxShape([WIDE, WIDE, THICK])


class Dart(Engine):
    """DART 6; see `crossbody.engines.Engine`."""

    name = "dart"
    profiles: Mapping[str, str] = {
        "matched": "the restitution of the law's linear part, own step (1 ms) and solver (Dantzig): first order; "
        "for solids with friction DART's own detector, which treats boxes as boxes, or FCL's where there are "
        "ellipsoids, of which that makes hulls, and nothing is put to sleep",
        "default": "default: no restitution, FCL's detector, which supports meshes; only for scenes with friction",
    }
    hidden = HIDDEN
    versions: Mapping[str, str] = {"dartpy": dartpy.__version__}
    orders: Mapping[str, float] = dict.fromkeys(profiles, 1.0)
    steps: Mapping[str, float] = dict.fromkeys(profiles, 1.0)

    def why_not(self, case: Case, profile: str) -> str | None:
        """Cases that are not of bodies on a line, and rows that are always on."""
        _settings.check_case(case)
        _settings.profile_of(self.name, self.profiles, profile)
        if case.scene is not None and frictional(case.scene):
            detector = _contacts.detector_of(case.scene, DETECTOR[profile])
            return why_beside("DART", case) or _contacts.why_not(case.scene, detector)
        if profile == "default":
            return "Without friction it differs from the profile matched only in its restitution, which is a setting."
        return why_not("DART", case) or no_rigid_contact(case)

    def prepare(self, case: Case, profile: str = _settings.MATCHED, **given: Any) -> Run:
        """Build the world; see `Engine.prepare`. Settings: dt, s; restitution; max_steps."""
        if (reason := self.why_not(case, profile)) is not None:
            raise CaseUnsupported(reason)
        if case.scene is not None and frictional(case.scene):
            return self._stepped(case, profile, given)
        scene = line(case)
        used = _settings.chosen(self.name, profile, settings(case, scene, 1e-3), given)
        world = World(scene, float(used["restitution"]))
        masses = [float(body.getMass()) for body in world.bodies]
        gravity = float(np.linalg.norm(world.world.getGravity()))
        return stepped((self.name, profile), case, used, world, masses, gravity)

    def _stepped(self, case: Case, profile: str, given: Mapping[str, Any]) -> Run:
        """Return a run of a scene with friction."""
        assert case.scene is not None
        matched = profile == "matched"
        known = {
            "dt": Parameter(default=min(1e-3, case.t_end), unit="s", doc="time step", low=0.0, open_low=True),
            "restitution": Parameter(default=_bounce(case) if matched else 0.0, doc="of contacts", low=0.0, high=1.0),
            "detector": Parameter(
                default=_contacts.detector_of(case.scene, DETECTOR[profile]), choices=tuple(_contacts.DETECTORS),
                doc="what finds contacts",
            ),
            "sleep": Parameter(default=not matched, doc="whether bodies at rest are put to sleep", low=0, high=1),
            "max_steps": STEPS,
        }  # fmt: skip
        used = _settings.chosen(self.name, profile, known, given)
        if reason := _contacts.why_not(case.scene, str(used["detector"])):
            raise CaseUnsupported(reason)
        stepper = _contacts.Rubs(case, used)
        return RubbingRun(
            case=case, engine=self.name, profile=profile, settings=used, stepper=stepper,
            physics=stepper.physics(),
        )  # fmt: skip


def _bounce(case: Case) -> float:
    """Return the restitution of the law's linear part, of the first contact; 0 without stiffness."""
    law = one_set(case.law)
    first = int(np.flatnonzero(law.unilateral & (law.a0 > 0.0))[0]) if (law.unilateral & (law.a0 > 0.0)).any() else -1
    return cf.restitution(cf.damping_ratio(float(law.a0[first]), float(law.a1[first]))) if first >= 0 else 0.0


ENGINE = Dart()
