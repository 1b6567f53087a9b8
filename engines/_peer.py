"""What engines for bodies on a line share: prepared runs, their trajectories, one loop of time steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, Protocol

import numpy as np

from crossbody.cases import Acts, Case, Event, Mode, Outcome, Parameter, Trajectory
from crossbody.cases import closed_forms as cf
from crossbody.cases.arrays import Bytes, Floats
from crossbody.cases.brent import brent
from crossbody.cases.scene_contacts import by_shapes, frictional
from crossbody.engines._line import CONTACT, FREE, Line, why_no_line
from crossbody.engines.contract import Run

ROUNDING = 1e-9  # a multiplier below this part of the largest is zero where a crossing was put in
Crossing = tuple[int, float, Floats, Floats, int]
"""Before which sample, when (s), q and v there, and the row whose gap is zero; -1 where a force turns."""
OPEN = float(np.finfo(np.float64).tiny)
"""Gap of a row at the instant at which it comes free, m: no more than a sign."""
_SCALAR = "Only bodies on a line are compared, which masses, gravity and constants determine completely."
LEAST_PUSH = 1e-9  # an impulse below this part of the momentum that a body has is none
STEPS = Parameter(default=2_000_000, doc="bound on the number of steps", low=1, high=1e9)


@dataclass(slots=True, kw_only=True)
class PeerRun(Run):
    """One prepared run; see `crossbody.engines.Run`."""

    engine: str
    profile: str
    settings: Mapping[str, Any]
    integrate: Callable[[], Trajectory]
    physics: Mapping[str, Any] = field(default_factory=dict)
    follows: Case | None = None

    def run(self) -> Trajectory:
        """Integrate from the start."""
        return self.integrate()

    def audit(self) -> Mapping[str, Any]:
        """The physics read back from the model."""
        return self.physics


HIDDEN: Mapping[str, Mapping[str, str]] = {
    "*": {"ledger": "Its steps keep no account of the work of its forces."}
    | dict.fromkeys(("M", "bias", "H", "lam", "constants"), _SCALAR)
}
"""What no engine for bodies on a line shows; see `crossbody.engines.Engine`."""


def why_beside(engine: str, case: Case) -> str | None:
    """Return why an engine that builds a scene's own parts cannot run a case; None if it has but these."""
    more = {"forces": case.force, "rows and gates": case.gates, "a scene in other coordinates": case.form}
    found = [name for name, part in more.items() if part is not None]
    return f"{engine} builds only the parts of a scene, but {case.label} also has {found[0]}." if found else None


def why_not(engine: str, case: Case) -> str | None:
    """The sentence for a case that is not of bodies on a line, or has friction."""
    if (found := why_beside(engine, case)) is not None:
        return found
    if case.scene is not None and (found := frictional(case.scene)):
        return found
    reason = why_no_line(case)
    return None if reason is None else f"{engine} supports only bodies on one line, but {case.label} {reason}"


def sampled(
    line: Line, t: Floats, q: Floats, v: Floats, lam: Floats, **more: Any
) -> Trajectory:  # fmt: skip
    """The motion from the steps of an adaptive integrator, with touches and releases put in.

    At ends of steps t (n,): q and v (n, nb) and lam (n, nc), N; `more` is as in `Trajectory`.
    """
    at, new, rows = _crossings(line, t, q, v)
    h = line.gaps(q)
    if len(at):
        t, q, v = (np.insert(a, at, b, axis=0) for a, b in zip((t, q, v), new, strict=True))
        there = _gaps_there(line, new[1], new[2], rows)
        push = line.memoryless(*new[1:], there)
        lam = np.insert(lam, at, np.where(push > ROUNDING * np.max(np.abs(lam), initial=0.0), push, 0.0), axis=0)
        h = np.insert(h, at, there, axis=0)
    gap, energy = line.observe(q, v)
    mode = line.modes(h, line.rates(v), lam)
    return Trajectory(
        t=t, q=q, v=v, gap=gap, lam=lam, energy=energy, mode=mode, events=events(t, mode), **more
    )  # fmt: skip


def _gaps_there(line: Line, q: Floats, v: Floats, rows: list[int]) -> Floats:
    """Gaps (n, nc) at crossings: that of the row that crosses is zero as it touches, and open as it leaves.

    Else the mode changes at the sample behind, and a touch or a release is told a step late.
    """
    h, rates = line.gaps(q).copy(), line.rates(v)
    for i, row in enumerate(rows):
        if row >= 0:
            h[i, row] = OPEN if rates[i, row] > 0.0 else 0.0
    return h


def _crossings(
    line: Line, t: Floats, q: Floats, v: Floats
) -> tuple[list[int], tuple[Floats, Floats, Floats], list[int]]:
    """Before which samples a gap, or below it what would push, passes zero; t, q, v, rows, in order."""
    h, lam = line.gaps(q), line.spring(q, v)
    found = [_touch(line, t, q, v, i, row) for i, row in np.argwhere(h[1:] * h[:-1] < 0.0)]
    below = (h[1:] < 0.0) & (h[:-1] < 0.0) & (lam[1:] * lam[:-1] < 0.0) & line.unilateral
    found += [_turn(line, t, q, v, i, row) for i, row in np.argwhere(below)]
    kept = sorted((e for e in found if e is not None), key=lambda entry: entry[1])
    n = len(line.masses)
    there = [np.reshape([e[k] for e in kept], (-1, n)) for k in (2, 3)]
    return [e[0] for e in kept], (np.array([e[1] for e in kept]), there[0], there[1]), [e[4] for e in kept]


def _touch(line: Line, t: Floats, q: Floats, v: Floats, i: int, row: int) -> Crossing | None:
    """From the state on the open side of a step, whose acceleration is constant."""
    side = i if line.gaps(q[i])[row] > 0.0 else i + 1
    a = line.acceleration(q[side], v[side])
    h, hd, hdd = (float(x[row]) for x in (line.gaps(q[side]), line.rates(v[side]), line.rates(a)))
    tau = _root(0.5 * hdd, hd, h)
    if not t[i] < t[side] + tau < t[i + 1]:
        return None
    return i + 1, float(t[side] + tau), q[side] + tau * (v[side] + 0.5 * tau * a), v[side] + tau * a, row


def _turn(line: Line, t: Floats, q: Floats, v: Floats, i: int, row: int) -> Crossing | None:
    """From the cubic through both ends of a step: only the rate of the acceleration jumps inside."""
    from scipy.interpolate import CubicHermiteSpline  # which takes longer to import than most runs

    cubic = CubicHermiteSpline(t[i : i + 2], q[i : i + 2], v[i : i + 2])
    rate = cubic.derivative()
    at = float(brent(lambda s: float(line.spring(cubic(s), rate(s))[row]), t[i], t[i + 1], xtol=1e-300, rtol=1e-15))
    return (i + 1, at, cubic(at), rate(at), -1) if t[i] < at < t[i + 1] else None


def _root(a: float, b: float, c: float) -> float:
    """The root of a x^2 + b x + c closest to zero; NaN if there is none."""
    square = b * b - 4.0 * a * c
    return -2.0 * c / (b + math.copysign(math.sqrt(square), b)) if square >= 0.0 and b != 0.0 else math.nan


def events(t: Floats, mode: Bytes) -> tuple[Event, ...]:
    """One event a change of mode; a start that is not free is its own first event."""
    before = np.vstack([np.where(mode[:1] == Mode.BILATERAL, mode[:1], FREE), mode[:-1]])
    changed = np.argwhere(mode != before)
    return tuple(
        Event(t=float(t[i]), contact=int(c), before=Mode(int(before[i, c])), after=Mode(int(mode[i, c])))
        for i, c in changed
    )


def ended(line: Line, q: Floats, v: Floats) -> Outcome:
    """Whether a state is finite and within a thousand times the speed of the scene."""
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        return Outcome.NOT_FINITE
    return Outcome.DIVERGED if np.max(np.abs(v)) > 1e3 * line.fastest else Outcome.FINISHED


class Stepper(Protocol):
    """An engine's world with the bodies of a scene in it."""

    scene: Line

    def start(self) -> None:
        """Back to the start of the case."""
        ...

    def step(self, dt: float) -> tuple[list[float], list[float]]:
        """One step of dt, s; positions and velocities of the bodies behind it."""
        ...


@dataclass(frozen=True, kw_only=True)
class Steps:
    """A run of an engine with fixed steps dt, s, up to a number of them."""

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
        outcome, what = ended(scene, q[-1], v[-1]), "the state left the region that the scene can reach"
        if outcome.ok and self.t_end - t[-1] > 1e-9 * self.dt:
            outcome, what = Outcome.STEP_LIMIT, f"{self.max_steps} steps of {self.dt:g} s did not reach the horizon"
        place = f"t = {t[-1]:g} s, q = {q[-1].tolist()}, v = {v[-1].tolist()}"
        return Trajectory(
            t=t, q=q, v=v, gap=gap, lam=lam, energy=energy, mode=mode, events=events(t, mode),
            acts=Acts.BEFORE, outcome=outcome, message="" if outcome.ok else f"{place}: {what}.",
            steps=len(t) - 1, wall_s=wall_s,
        )  # fmt: skip

    def _multipliers(self, t: Floats, v: Floats) -> Floats:
        """Lam (n, nc), N; nothing at the start."""
        scene, dt = self.line, np.diff(t)[:, None]
        with np.errstate(all="ignore"):
            p = scene.transmitted(np.diff(v, axis=0) + scene.gravity * dt)
            size = scene.masses.max() * (np.abs(v[1:]).max(axis=1, keepdims=True) + abs(scene.gravity) * dt)
            return np.vstack([np.zeros((1, p.shape[1])), np.where(p > LEAST_PUSH * size, p / dt, 0.0)])


def no_rigid_contact(case: Case) -> str | None:
    """The sentence for rows that cannot open, and bounds of no shapes, where contacts are rigid and between shapes."""
    if not case.law.unilateral.all():
        return "A rigid contact only pushes, so a row that is always active cannot be one."
    return no_shapes(case)


def no_shapes(case: Case) -> str | None:
    """Return the sentence for bounds at which no two shapes touch, where what touches are shapes."""
    bounded = () if case.scene is None else by_shapes(case.scene).bounded
    name = next((part.name for part in bounded if np.isfinite(part.range).any()), None)
    return None if name is None else f"A contact is between two shapes, but none touch at the bound of {name!r}."


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
    """A prepared run with what reached the engine: a restitution stands where the law has constants.

    `who` are engine and profile; masses, kg, and gravity, m/s^2, are read back from the engine.
    """
    integrate = Steps(
        stepper=stepper, line=stepper.scene, t_end=case.t_end, dt=float(used["dt"]), max_steps=int(used["max_steps"])
    )
    physics = {
        "masses": masses, "gravity": gravity, "constants": {"restitution": used["restitution"]},
        "q0": case.q0, "v0": case.v0,
    }  # fmt: skip
    return PeerRun(engine=who[0], profile=who[1], settings=used, integrate=integrate, physics=physics)
