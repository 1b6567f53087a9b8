"""pymunk (Chipmunk 2-D): sequential impulses with a restitution in every time step, designed for games."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pymunk

from crossbody.cases import Case, CaseUnsupported
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Shape
from crossbody.engines import settings as _settings
from crossbody.engines._line import Line, line
from crossbody.engines._peer import HIDDEN, PeerRun, no_rigid_contact, settings, stepped, why_not
from crossbody.engines.contract import Engine

ITERATIONS = 200  # of the sequential impulses: enough for five balls in a row to 1e-10 of their momentum
WIDE = 1e3  # m, half the length of a plane
PLANE = [0, 2]  # of the world's axes
USUAL = 1.0 / 60.0  # s, the step of pymunk's own examples


class World:
    """A `Stepper`: bodies that do not turn in the plane x, z, with their shapes and the world's."""

    def __init__(self, scene: Line, e: float, matched: bool) -> None:
        self.scene, self.e, self.matched = scene, e, matched
        self.axis, self.places = pymunk.Vec2d(*scene.axis[PLANE]), [pymunk.Vec2d(*x) for x in scene.places[:, PLANE]]
        self.start()

    def start(self) -> None:
        """See `Stepper`: a new space, for Chipmunk remembers contacts, the last step and its pushes."""
        scene = self.scene
        space = self.space = pymunk.Space()
        space.gravity = -scene.gravity * self.axis
        if self.matched:
            space.collision_slop, space.iterations = 0.0, ITERATIONS
        self.bodies = [pymunk.Body(mass, math.inf) for mass in scene.masses.tolist()]
        start = zip(self.bodies, self.places, scene.q0.tolist(), scene.v0.tolist(), strict=True)
        for body, place, q, v in start:
            body.position, body.velocity = place + q * self.axis, v * self.axis
        space.add(*self.bodies)
        named = {"": space.static_body, **dict(zip(scene.bodies, self.bodies, strict=True))}
        for shape in scene.shapes:
            space.add(_solid(shape, named[shape.body], self.e))

    def step(self, dt: float) -> tuple[list[float], list[float]]:
        """See `Stepper`."""
        self.space.step(dt)
        along = [self.axis.dot(body.position - place) for body, place in zip(self.bodies, self.places, strict=True)]
        return along, [self.axis.dot(body.velocity) for body in self.bodies]


def _solid(shape: Shape, body: Any, e: float) -> Any:
    """Return a circle, or a plane's wide line, without friction: pairs multiply restitutions."""
    at, turned = pymunk.Vec2d(*np.array(shape.position)[PLANE]), matrices(np.array(shape.orientation))
    along = WIDE * pymunk.Vec2d(*turned[PLANE, 2]).perpendicular()
    solid = (
        pymunk.Circle(body, shape.size[0], at) if shape.type == "sphere"
        else pymunk.Segment(body, at - along, at + along, 0.0)
    )  # fmt: skip
    solid.elasticity, solid.friction = e**0.5, 0.0
    return solid


class Pymunk(Engine):
    """pymunk 7; see `crossbody.engines.Engine`."""

    name = "pymunk"
    profiles: Mapping[str, str] = {
        "matched": "the restitution of the law's linear part, no allowed overlap, 200 iterations, steps of 1 ms",
        "default": "default: overlap of 0.1 allowed, 10 iterations, steps of 1/60 s",
    }
    hidden = HIDDEN
    versions: Mapping[str, str] = {"pymunk": pymunk.version, "Chipmunk": pymunk.chipmunk_version}
    orders: Mapping[str, float] = dict.fromkeys(profiles, 1.0)
    steps: Mapping[str, float] = dict.fromkeys(profiles, 0.0)  # bodies are moved before velocities change

    def why_not(self, case: Case, profile: str) -> str | None:
        """Cases that are not of bodies on a line in the plane x, z, and rows that are always on."""
        _settings.check_case(case)
        _settings.profile_of(self.name, self.profiles, profile)
        if why := why_not("pymunk", case) or no_rigid_contact(case):
            return why
        return "pymunk's plane is x, z, but bodies also slide along y." if line(case).axis[1] else None

    def prepare(self, case: Case, profile: str = _settings.MATCHED, **given: Any) -> PeerRun:
        """Build the space; see `Engine.prepare`. Settings: dt, s; restitution; max_steps."""
        if (reason := self.why_not(case, profile)) is not None:
            raise CaseUnsupported(reason)
        scene = line(case)
        step = 1e-3 if profile == "matched" else USUAL
        used = _settings.chosen(self.name, profile, settings(case, scene, step), given)
        world = World(scene, float(used["restitution"]), profile == "matched")
        masses, space = [float(body.mass) for body in world.bodies], world.space
        used = used | {"iterations": int(space.iterations), "slop": float(space.collision_slop)}
        return stepped((self.name, profile), case, used, world, masses, -float(world.axis.dot(world.space.gravity)))


ENGINE = Pymunk()
