"""What metrics must say of motions that touch later than the truth: of what goes on, and of what bounces.

Of a body that slides while its touch is told late, positions and velocities are off by what they are off at equal
times. Of one that bounces later and later and is the same but for that, by nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from crossbody.cases import Case, Event, Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports import metrics
from crossbody.reports.judging.asked import Found
from crossbody.reports.judging.made_up import case_of
from crossbody.reports.measuring.truth import from_run

END, SAMPLES = 1.0, 1001
SPEED, HEIGHT = 3.0, 0.2
"""Of what slides, m/s, and from which what bounces falls, m."""
EARLY, LATE, OFF = 1e-6, 2e-3, 1e-5
"""When the truth of what slides touches, and its run, s; and the part of its speed by which that is off."""
SAME = 1e-6
"""What splines leave, and part of an answer by which it may differ."""
G = 9.81


@cache
def wrong() -> tuple[Found, ...]:
    """Return metric, number, least and most, and motion, of what is another number than it must be."""
    asked = (("slides", _slides(EARLY, 0.0), _slides(LATE, OFF), OFF), ("bounces", _bounces(0.0), _bounces(LATE), 0.0))
    return tuple(_wrong(asked))


def _wrong(asked: tuple[tuple[str, Trajectory, Trajectory, float], ...]) -> Iterator[Found]:
    case = case_of(("m", "m"), (True,), 1)
    for said, exact, run, wanted in asked:
        for name in ("position", "velocity"):
            found = _measured(name, exact, run, case)
            if not abs(found - wanted) <= SAME * (wanted or 1.0):
                yield name, found, (wanted, wanted), f"a body that {said} and touches late"


def _measured(name: str, exact: Trajectory, run: Trajectory, case: Case) -> float:
    value = metrics.load(name).measure(from_run(exact, Tier.A, "made up"), run, case)
    return np.nan if value is None else value


def _motion(t: Floats, x: Floats, z: Floats, u: Floats, w: Floats, touches: Floats) -> Trajectory:
    """Return a motion along a floor and above it, with its touches, s."""
    none = np.zeros((len(t), 1))
    events = [
        Event(t=float(at), contact=0, before=a, after=b)
        for at in touches for a, b in ((Mode.FREE, Mode.CONTACT), (Mode.CONTACT, Mode.FREE))
    ]  # fmt: skip
    return Trajectory(
        t=t, q=np.column_stack([x, z]), v=np.column_stack([u, w]), gap=z[:, None], lam=none,
        energy=np.zeros((len(t), 2)), mode=none.astype(np.int8), events=tuple(events[: 2 * len(touches) - 1]),
    )  # fmt: skip


def _slides(touch: float, off: float) -> Trajectory:
    """Return a slide at one speed, off by a part of it, whose touch is told at an instant, s."""
    t, speed = np.linspace(0.0, END, SAMPLES), SPEED * (1.0 + off)
    none = np.zeros(len(t))
    return _motion(t, speed * t, none, none + speed, none, np.array([touch]))


def _bounces(late: float) -> Trajectory:
    """Return a body that bounces to the same height, each time later by as much, s: time is straight between."""
    first = np.sqrt(2.0 * HEIGHT / G)
    touches = np.arange(first, END, 2.0 * first)
    t = np.sort(np.concatenate([np.linspace(0.0, END, SAMPLES), touches, touches]))
    past = np.searchsorted(touches, t, side="left") + np.append(False, t[1:] == t[:-1])
    fallen = t - 2.0 * first * np.minimum(past, len(touches))
    later = late * np.arange(len(touches) + 1)
    shown = t + np.interp(t, np.append(0.0, touches), later)
    return _motion(shown, 0.0 * t, HEIGHT - 0.5 * G * fallen**2, 0.0 * t, -G * fallen, touches + later[1:])
