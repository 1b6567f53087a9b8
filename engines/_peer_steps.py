"""Engines that step bodies on a line in time, with impacts solved inside a step: one loop for all of them.

lam is the impulse of the step before an instant over its length, from the balance of momentum, M
(v+ - v) + M g dt.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Protocol

import numpy as np

from crossbody.cases import Case, Outcome, Parameter, Trajectory
from crossbody.cases import closed_forms as cf
from crossbody.cases.arrays import Floats
from crossbody.engines._line import CONTACT, FREE, Line
from crossbody.engines._peer import PeerRun, ended, events

ROUNDING = 1e-9  # an impulse below this part of the momentum that a body has is none
STEPS = Parameter(default=2_000_000, doc="bound on the number of steps", low=1, high=1e9)


class Stepper(Protocol):
    """An engine's world with the bodies in it.

    Attributes:
        scene: what it was built from.
    """

    scene: Line

    def start(self) -> None:
        """Back to the start of the case."""
        ...

    def step(self, dt: float) -> tuple[list[float], list[float]]:
        """One step of dt, s; positions and velocities of the bodies behind it."""
        ...


@dataclass(frozen=True, kw_only=True)
class Steps:
    """A run of an engine with fixed steps.

    Attributes:
        stepper: the engine.
        line: the scene.
        t_end, dt: horizon and step, s.
        max_steps: bound on their number.
    """

    stepper: Stepper
    line: Line
    t_end: float
    dt: float
    max_steps: int

    def __call__(self) -> Trajectory:
        """Step from the start to the horizon, the last step cut to end there."""
        t, q, v = [0.0], [self.line.q0.tolist()], [self.line.v0.tolist()]
        t_end, dt, step = self.t_end, self.dt, self.stepper.step
        self.stepper.start()
        start = perf_counter()
        while t_end - t[-1] > 1e-9 * dt and len(t) <= self.max_steps:
            tau = min(dt, t_end - t[-1])
            now = step(tau)
            t.append(t[-1] + tau)
            q.append(now[0])
            v.append(now[1])
            if not abs(now[1][0]) < np.inf:
                break
        return self._trajectory(np.array(t), np.array(q), np.array(v), perf_counter() - start)

    def _trajectory(self, t: Floats, q: Floats, v: Floats, wall_s: float) -> Trajectory:
        scene = self.line
        lam = self._multipliers(t, v)
        mode = np.where(lam > 0.0, CONTACT, FREE).astype(np.int8)
        gap, energy = scene.observe(q, v)
        outcome, what = ended(scene, q[-1], v[-1]), "the state left what the scene can reach"
        if outcome.ok and self.t_end - t[-1] > 1e-9 * self.dt:
            outcome, what = Outcome.STEP_LIMIT, f"{self.max_steps} steps of {self.dt:g} s were not enough"
        place = f"t = {t[-1]:g} s, q = {q[-1].tolist()}, v = {v[-1].tolist()}"
        return Trajectory(
            t=t, q=q, v=v, gap=gap, lam=lam, energy=energy, mode=mode, events=events(t, mode),
            outcome=outcome, message="" if outcome.ok else f"{place}: {what}.",
            steps=len(t) - 1, wall_s=wall_s,
        )  # fmt: skip

    def _multipliers(self, t: Floats, v: Floats) -> Floats:
        """Lam (n, nc), N; nothing at the start."""
        scene, dt = self.line, np.diff(t)[:, None]
        with np.errstate(all="ignore"):
            p = scene.transmitted(np.diff(v, axis=0) + scene.gravity * dt)
            size = scene.masses.max() * (np.abs(v[1:]).max(axis=1, keepdims=True) + abs(scene.gravity) * dt)
            return np.vstack([np.zeros((1, p.shape[1])), np.where(p > ROUNDING * size, p / dt, 0.0)])


def no_rigid_contact(case: Case) -> str | None:
    """The sentence for rows that cannot open, where contacts are rigid."""
    if case.law.unilateral.all():
        return None
    return "A rigid contact pushes only: a row that is always on, with a law of its own, is none."


def restitution(scene: Line) -> float:
    """Restitution of the law's linear part, that of the first row for all; 0 without stiffness."""
    a0, a1 = float(scene.a0[0]), float(scene.a1[0])
    return cf.restitution(cf.damping_ratio(a0, a1)) if a0 > 0.0 else 0.0


def settings(case: Case, scene: Line, step: float) -> Mapping[str, Parameter]:
    """dt, restitution and max_steps."""
    return {
        "dt": Parameter(default=min(step, case.t_end), unit="s", doc="time step", low=0.0, open_low=True),
        "restitution": Parameter(default=restitution(scene), doc="of every contact", low=0.0, high=1.0),
        "max_steps": STEPS,
    }


def stepped(
    who: tuple[str, str], case: Case, used: Mapping[str, Any], stepper: Stepper, masses: list[float], gravity: float
) -> PeerRun:
    """A prepared run with what reached the engine: in the audit a restitution stands where the law has constants.

    Args:
        who: engine and profile.
        case: the scene.
        used: the values of `settings`.
        stepper: the engine's world.
        masses: read back from it, kg.
        gravity: read back from it, m/s^2.
    """
    integrate = Steps(
        stepper=stepper, line=stepper.scene, t_end=case.t_end, dt=float(used["dt"]), max_steps=int(used["max_steps"])
    )
    physics = {
        "masses": masses, "gravity": gravity, "constants": {"restitution": used["restitution"]},
        "q0": case.q0, "v0": case.v0,
    }  # fmt: skip
    return PeerRun(engine=who[0], profile=who[1], settings=used, integrate=integrate, physics=physics)
