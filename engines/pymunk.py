"""pymunk (Chipmunk 2-D): sequential impulses with a restitution in every time step, made for games."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pymunk

from crossbody.cases import Case, CaseUnsupported
from crossbody.engines import settings as _settings
from crossbody.engines._line import Line, line
from crossbody.engines._peer import HIDDEN, PeerRun, why_not
from crossbody.engines._peer_steps import no_rigid_contact, settings, stepped
from crossbody.engines.contract import Engine

ITERATIONS = 200
"""Of the sequential impulses: enough for five balls in a row to 1e-10 of their momentum."""
WIDE = 1e3  # m, half the length of the floor
USUAL = 1.0 / 60.0  # s, the step of pymunk's own examples


class World:
    """A `Stepper`: circles that do not turn, along y above a floor, along x beside each other."""

    def __init__(self, scene: Line, e: float, matched: bool) -> None:
        self.scene, self.axis, self.e, self.matched = scene, "y" if scene.floor else "x", e, matched
        self.start()

    def start(self) -> None:
        """See `Stepper`: a new space, for Chipmunk remembers contacts, the last step and what it pushes apart."""
        scene = self.scene
        space = self.space = pymunk.Space()
        space.gravity = (0.0, -scene.gravity)
        if self.matched:
            space.collision_slop, space.iterations = 0.0, ITERATIONS
        self.bodies = [self._ball(i, self.e if scene.floor else self.e**0.5) for i in range(len(scene.masses))]
        if scene.floor:
            _surface(floor := pymunk.Segment(space.static_body, (-WIDE, 0.0), (WIDE, 0.0), 0.0), 1.0)
            space.add(floor)

    def _ball(self, i: int, e: float) -> Any:
        scene = self.scene
        body = pymunk.Body(float(scene.masses[i]), math.inf)
        _surface(circle := pymunk.Circle(body, scene.radius), e)
        place, v = self._place(i) + float(scene.q0[i]), float(scene.v0[i])
        body.position = (0.0, place) if scene.floor else (place, 0.0)
        body.velocity = (0.0, v) if scene.floor else (v, 0.0)
        self.space.add(body, circle)
        return body

    def _place(self, i: int) -> float:
        return self.scene.radius if self.scene.floor else i * (2.0 * self.scene.radius + self.scene.gap)

    def step(self, dt: float) -> tuple[list[float], list[float]]:
        """See `Stepper`."""
        self.space.step(dt)
        axis = self.axis
        places = [getattr(body.position, axis) - self._place(i) for i, body in enumerate(self.bodies)]
        return places, [getattr(body.velocity, axis) for body in self.bodies]


def _surface(shape: Any, e: float) -> None:
    """A restitution (that of a pair is the product of both) and no friction."""
    shape.elasticity, shape.friction = e, 0.0


class Pymunk(Engine):
    """pymunk 7; see `crossbody.engines.Engine`."""

    name = "pymunk"
    profiles: Mapping[str, str] = {
        "matched": "the restitution of the law's linear part, no allowed overlap, 200 iterations, steps of 1 ms",
        "default": "as it comes: overlap of 0.1 allowed, 10 iterations, steps of 1/60 s",
    }
    hidden = HIDDEN
    versions: Mapping[str, str] = {"pymunk": pymunk.version, "Chipmunk": pymunk.chipmunk_version}
    orders: Mapping[str, float] = dict.fromkeys(profiles, 1.0)

    def why_not(self, case: Case, profile: str) -> str | None:
        """Mechanisms that are not on a line, and rows that are always on."""
        _settings.check_case(case)
        _settings.profile_of(self.name, self.profiles, profile)
        return why_not("pymunk", case) or no_rigid_contact(case)

    def prepare(self, case: Case, profile: str = _settings.MATCHED, **given: Any) -> PeerRun:
        """Build the space.

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
        step = 1e-3 if profile == "matched" else USUAL
        used = _settings.chosen(self.name, profile, settings(case, scene, step), given)
        world = World(scene, float(used["restitution"]), profile == "matched")
        masses = [float(body.mass) for body in world.bodies]
        return stepped((self.name, profile), case, used, world, masses, -float(world.space.gravity.y))


ENGINE = Pymunk()
