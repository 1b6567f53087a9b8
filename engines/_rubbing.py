"""Scenes with friction in engines that step in time: one loop, and their forces at points as the rows of a scene.

An engine finds contacts by itself: it tells points, and forces there. A point is the place of its pair
that is nearest, a force is laid along the frame of that place's rows. lam is the force in the step before
an instant. Inputs change with the step at or behind their instant; the horizon is a whole number of steps.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, NamedTuple, Protocol

import numpy as np

from crossbody.cases import Acts, Case, Mode, Outcome, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.cases.scene_contacts import WAYS, Contact
from crossbody.engines._acting import Acting
from crossbody.engines._contacts import Contacts, Poses
from crossbody.engines._log import Log, Modes
from crossbody.engines.contract import Run
from crossbody.engines.nearest import across

AT_GRID = 1e-9  # part of a step by which an instant may be off the grid of steps
AT_BOUND = 1e-6
"""Part of its bound, mu times the normal force, by which friction may be off it where it slides."""
RIGID = ("constants", "H", "lam")  # quantities of the audit that engines with rigid contacts do not show
FASTEST = 1e6  # speed, m/s or rad/s, at which a run has diverged


class Push(NamedTuple):
    """What one contact of an engine does.

    Attributes:
        first, second: its shapes.
        point (3,): where, in the world, m.
        force (3,): on the second shape, N.
        slides: whether the engine has its friction at its bound, or slips faster than it holds.
    """

    first: str
    second: str
    point: Floats
    force: Floats
    slides: bool


class Rubbing:
    """The contacts of a scene by the engine's poses, some of which have friction."""

    def __init__(self, scene: Scene) -> None:
        self.touching = Contacts(scene)
        bounds = sum(int(np.isfinite(part.range).sum()) for part in scene.bounded)
        self.before = sum(loop.width for loop in scene.loops) + bounds
        self.always = sum(loop.width for loop in scene.loops)
        self.of: dict[frozenset[str], tuple[Contact, int, int]] = {}
        self.led: list[int] = []
        normal, tangent = self.before, self.before + self.touching.count
        for contact in self.touching.all:
            self.of[frozenset((contact.first.name, contact.second.name))] = (contact, normal, tangent)
            self.led += [row for row in range(normal, normal + contact.places) for _ in WAYS if contact.friction > 0.0]
            normal, tangent = normal + contact.places, tangent + len(contact.tangents)
        self.nc = tangent

    def rows(self, poses: Poses, pushes: Iterable[Push]) -> tuple[Floats, Modes]:
        """Return the multipliers (nc,) and the modes of all rows, from the bodies' poses."""
        lam, slides = np.zeros(self.nc), dict[int, bool]()
        met = None
        for push in pushes:
            met = met or self.touching.touches(poses)
            contact, normal, tangent = self.of[frozenset((push.first, push.second))]
            first = normal - self.before
            k = int(np.argmin(np.linalg.norm(met.point[first : first + contact.places] - push.point, axis=1)))
            force = push.force if push.second == contact.second.name else -push.force
            lam[normal + k] += met.normal[first + k] @ force
            if contact.friction > 0.0:
                (one, _), (two, _) = self.touching.ends(poses, contact)
                ways = across(contact.first.type, one, two, met.normal[first + k])
                lam[tangent + len(WAYS) * k :][: len(WAYS)] += ways @ force
                slides[normal + k] = push.slides
        pushing = lam[: self.before + self.touching.count] > 0.0
        modes = np.where(pushing, int(Mode.CONTACT), int(Mode.FREE)).tolist()
        modes[: self.always] = [int(Mode.BILATERAL)] * self.always
        for row in (row for row in slides if pushing[row]):
            modes[row] = int(Mode.SLIP if slides[row] else Mode.STICK)
        return lam, (*modes, *(modes[row] for row in self.led))


class Stepper(Protocol):
    """An engine's world with the scene in it, and steps of one length."""

    def start(self) -> tuple[Floats, Floats]:
        """Go back to the start; q and v in the scene's coordinates."""

    def change(self, values: Floats, t: float) -> None:
        """Put inputs (nu,) in force from t on, s."""

    def step(self, t: float) -> tuple[Floats, Floats, list[Push]]:
        """Make one step from t, s; q and v behind it, and what contacts did in it."""

    def pose(self, body: str) -> Any:
        """Return rotation (3, 3) and position (3,) of a body, m."""

    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Return the gaps of bounds and contacts (n, m), and energies (n, 2), of recorded states."""

    def counts(self) -> Mapping[str, int]:
        """Return what the engine counts."""


def why_no_steps(engine: str, scene: Scene, bounds: bool = False) -> str | None:
    """Return why an engine that steps contacts, perhaps bounds, runs no scene with friction; or None."""
    if dry := next((part for part, _ in scene.dry), None):
        return f"{engine} supports contacts only, but {dry.name!r} has dry friction (friction_loss, without=friction)."
    if scene.loops:
        return f"{engine} supports contacts only, but the loop {scene.loops[0].name!r} is always on."
    bounded = next((part for part in scene.bounded if np.isfinite(part.range).any()), None)
    if bounded is not None and not bounds:
        return f"{engine} supports contacts only, but {bounded.name!r} has bounds (without=limits leaves a file's out)."
    return None


def steps_of(case: Case, dt: float) -> tuple[int, float]:
    """Return how many steps of about dt the horizon has, and their length, s."""
    count = max(1, math.ceil(case.t_end / dt - AT_GRID))
    return count, case.t_end / count


@dataclass(slots=True, kw_only=True)
class RubbingRun(Run):
    """One prepared run; see `crossbody.engines.Run`."""

    case: Case
    engine: str
    profile: str
    settings: Mapping[str, Any]
    stepper: Stepper
    physics: Mapping[str, Any] = field(default_factory=dict)
    follows: Case | None = None
    rubbing: Rubbing = field(init=False)
    acting: Acting = field(init=False)

    def __post_init__(self) -> None:
        """Lay out the rows."""
        assert self.case.scene is not None
        self.rubbing, self.acting = Rubbing(self.case.scene), Acting(self.case)

    def run(self) -> Trajectory:
        """Step from the start."""
        log = Log()
        log.acts = Acts.BEFORE
        self.acting.reset()
        start = perf_counter()
        outcome, message = self._steps(log)
        wall = perf_counter() - start

        def observe(q: Floats, v: Floats) -> tuple[Floats, Floats]:
            gaps, energy = self.stepper.observe(q, v)
            return np.pad(gaps, ((0, 0), (0, self.rubbing.nc - gaps.shape[1]))), energy

        counts = self.stepper.counts()
        found = log.trajectory(observe, outcome, message, len(log.motion) - 1, wall, counts)
        return self.acting.told(found)

    def _steps(self, log: Log) -> tuple[Outcome, str]:
        count, dt = steps_of(self.case, float(self.settings["dt"]))
        q, v = self.stepper.start()
        instants, lam, modes = list(self.acting.instants), *self.rubbing.rows(self.stepper.pose, ())
        log.add(0.0, q, v, lam, modes)
        for k in range(count):
            t = k * dt
            place = f"t = {t:g} s"
            if k >= int(self.settings["max_steps"]):
                return Outcome.STEP_LIMIT, f"{place}: {k} steps of {dt:g} s did not reach the horizon."
            while instants and instants[0] <= t + AT_GRID * dt:
                self.stepper.change(self.acting.at(instants.pop(0), q, v), t)
            try:
                q, v, pushes = self.stepper.step(t)
            except (RuntimeError, FloatingPointError) as error:
                return Outcome.STEP_TOO_SMALL, f"{place}: {self.engine} says: {' '.join(str(error).split())}"
            if not (np.isfinite(q).all() and np.isfinite(v).all()):
                return Outcome.NOT_FINITE, f"{place}: the next state is not finite."
            lam, after = self.rubbing.rows(self.stepper.pose, pushes)
            log.switch((k + 1) * dt, modes, after)
            modes = after
            log.add((k + 1) * dt, q, v, lam, modes)
            if not np.abs(v).max(initial=0.0) < FASTEST:
                return Outcome.DIVERGED, f"{place}: v = {v.tolist()} is faster than {FASTEST:g}."
        return Outcome.FINISHED, ""

    def audit(self) -> Mapping[str, Any]:
        """The physics read back from the engine."""
        return self.physics
