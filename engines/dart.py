"""DART: rigid contacts with a restitution, a linear complementarity problem in every time step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import dartpy
import numpy as np

from crossbody.cases import Case, CaseUnsupported
from crossbody.engines import settings as _settings
from crossbody.engines._line import Line, line
from crossbody.engines._peer import HIDDEN, PeerRun, why_not
from crossbody.engines._peer_steps import no_rigid_contact, settings, stepped
from crossbody.engines.contract import Engine

THICK = 1.0  # m, of the floor


class World:
    """A `Stepper`: spheres on prismatic joints, along z above a floor, along x beside each other."""

    def __init__(self, scene: Line, e: float) -> None:
        self.scene, self.dt = scene, 0.0
        self.world = dartpy.simulation.World()
        self.world.setGravity([0.0, 0.0, -scene.gravity])
        self.bodies = [self._ball(i, e) for i in range(len(scene.masses))]
        if scene.floor:
            self._floor()

    def _ball(self, i: int, e: float) -> Any:
        scene = self.scene
        skeleton = dartpy.dynamics.Skeleton(f"ball {i}")
        joint, body = skeleton.createPrismaticJointAndBodyNodePair()
        joint.setAxis([0.0, 0.0, 1.0] if scene.floor else [1.0, 0.0, 0.0])
        along = i * (2.0 * scene.radius + scene.gap)
        place = dartpy.math.Isometry3()
        place.set_translation([0.0, 0.0, scene.radius] if scene.floor else [along, 0.0, 0.0])
        joint.setTransformFromParentBodyNode(place)
        mass = float(scene.masses[i])
        body.setInertia(dartpy.dynamics.Inertia(mass, [0.0, 0.0, 0.0], 0.4 * mass * scene.radius**2 * np.eye(3)))
        _surface(body.createShapeNode(dartpy.dynamics.SphereShape(scene.radius)), e if scene.floor else e**0.5)
        self.world.addSkeleton(skeleton)
        return skeleton

    def _floor(self) -> None:
        skeleton = dartpy.dynamics.Skeleton("floor")
        joint, body = skeleton.createWeldJointAndBodyNodePair()
        place = dartpy.math.Isometry3()
        place.set_translation([0.0, 0.0, -0.5 * THICK])
        joint.setTransformFromParentBodyNode(place)
        _surface(body.createShapeNode(dartpy.dynamics.BoxShape([2.0, 2.0, THICK])), 1.0)
        self.world.addSkeleton(skeleton)

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


def _surface(shape: Any, e: float) -> None:
    """A restitution (that of a pair is the product of both) and no friction."""
    shape.createCollisionAspect()
    surface = shape.createDynamicsAspect()
    surface.setRestitutionCoeff(e)
    surface.setFrictionCoeff(0.0)


class Dart(Engine):
    """DART 6; see `crossbody.engines.Engine`."""

    name = "dart"
    profiles: Mapping[str, str] = {
        "matched": "the restitution of the law's linear part, DART's own step (1 ms) and solver (Dantzig): first order"
    }
    hidden = HIDDEN
    versions: Mapping[str, str] = {"dartpy": dartpy.__version__}
    orders: Mapping[str, float] = dict.fromkeys(profiles, 1.0)

    def why_not(self, case: Case, profile: str) -> str | None:
        """Mechanisms that are not on a line, and rows that are always on."""
        _settings.check_case(case)
        _settings.profile_of(self.name, self.profiles, profile)
        return why_not("DART", case) or no_rigid_contact(case)

    def prepare(self, case: Case, profile: str = _settings.MATCHED, **given: Any) -> PeerRun:
        """Build the world.

        Args:
            case: the scene.
            profile: one of `profiles`.
            given: dt, s; restitution; max_steps.

        Raises:
            UnknownName, CaseUnsupported, InvalidValue: see `crossbody.engines.Engine`.
        """
        reason = self.why_not(case, profile)
        if reason is not None:
            raise CaseUnsupported(reason)
        scene = line(case)
        used = _settings.chosen(self.name, profile, settings(case, scene, 1e-3), given)
        world = World(scene, float(used["restitution"]))
        masses = [float(body.getMass()) for body in world.bodies]
        gravity = float(np.linalg.norm(world.world.getGravity()))
        return stepped((self.name, profile), case, used, world, masses, gravity)


ENGINE = Dart()
