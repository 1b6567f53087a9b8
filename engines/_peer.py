"""What the engines for bodies on a line share: a prepared run, and trajectories from what an engine recorded.

An adaptive integrator records its steps alone. Where a gap changes its sign between two of them, the state there is
put in from the one on the open side, whose acceleration is constant while nothing touches: a straight line would
misplace the touch by more than the run is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from crossbody.cases import Case, Event, Mode, Outcome, Trajectory
from crossbody.cases._arrays import Bytes, Floats
from crossbody.engines._line import FREE, MECHANISMS, Line


@dataclass(slots=True, kw_only=True)
class PeerRun:
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


def why_not(engine: str, case: Case) -> str | None:
    """The sentence for a mechanism that is not on a line."""
    if case.mechanism in MECHANISMS:
        return None
    return f"{engine} has no model of the mechanism {case.mechanism!r}; it has: {', '.join(MECHANISMS)}."


def sampled(
    line: Line, t: Floats, q: Floats, v: Floats, lam: Floats, **more: Any
) -> Trajectory:  # fmt: skip
    """The motion from the steps of an adaptive integrator, with touches and releases put in.

    Args:
        line: the scene.
        t: ends of the steps (n,), s.
        q: positions there (n, nb).
        v: velocities there.
        lam: multipliers there (n, nc), N.
        more: wall_s, steps, outcome and message, as in `Trajectory`.
    """
    at, new = _crossings(line, t, q, v)
    if len(at):
        t, q, v = (np.insert(a, at, b, axis=0) for a, b in zip((t, q, v), new, strict=True))
        lam = np.insert(lam, at, line.memoryless(*new[1:]), axis=0)
    gap, energy = line.observe(q, v)
    mode = line.modes(q, v, lam)
    return Trajectory(
        t=t, q=q, v=v, gap=gap, lam=lam, energy=energy, mode=mode, events=events(t, mode), **more
    )  # fmt: skip


def _crossings(line: Line, t: Floats, q: Floats, v: Floats) -> tuple[list[int], tuple[Floats, Floats, Floats]]:
    """Before which samples a gap passes zero, and t, q, v there, in order."""
    h, hd = line.gaps(q), line.rates(v)
    found = []
    for i, row in np.argwhere(h[1:] * h[:-1] < 0.0):
        side = i if h[i, row] > 0.0 else i + 1
        a = line.acceleration(q[side], v[side])
        tau = _root(0.5 * float(line.rates(a)[row]), float(hd[side, row]), float(h[side, row]))
        if t[i] < t[side] + tau < t[i + 1]:
            found.append((i + 1, t[side] + tau, q[side] + tau * (v[side] + 0.5 * tau * a), v[side] + tau * a))
    found.sort(key=lambda entry: entry[1])
    n = len(line.masses)
    where = [int(e[0]) for e in found]
    there = [np.reshape([e[k] for e in found], (-1, n)) for k in (2, 3)]
    return where, (np.array([e[1] for e in found]), there[0], there[1])


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
    """Whether a state is finite and within a million times the sizes of the scene."""
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        return Outcome.NOT_FINITE
    fast = math.hypot(line.sizes[1], float(np.max(np.abs(line.v0), initial=0.0)))
    return Outcome.DIVERGED if np.max(np.abs(v)) > 1e3 * fast else Outcome.FINISHED
