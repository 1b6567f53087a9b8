"""The exact motion of a ball on a linear floor (a2 = 0): free flight and contact arcs joined at exact events (tier A).

Free and ballistic arcs are parabolas, contact arcs are solutions of h'' + a1 h' + a0 h = 0; the machine
is the level machine. A contact ends at the first root of lam/m = g + h'': h'' solves the same equation,
so its extrema are known and bracket the root, or show that there is none (the ball is captured).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, pairwise

import numpy as np

from crossbody.cases.arrays import Bytes, Floats, distinct
from crossbody.cases.between import pieces
from crossbody.cases.closed_forms import LinearArc
from crossbody.cases.errors import Outcome
from crossbody.cases.trajectory import Event, Ledger, Mode, Trajectory

MAX_ARCS = 20_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Ball:
    """Constants of the scene: mass kg, gravity m/s^2, a0 1/s^2, a1 1/s."""

    mass: float
    gravity: float
    a0: float
    a1: float
    bilateral: bool = False


@dataclass(frozen=True, slots=True)
class Arc:
    """One smooth piece of the motion: it starts at `t` with gap h and rate v, in `mode`."""

    t: float
    mode: Mode
    h: float
    v: float

    @property
    def closed(self) -> bool:
        """Whether the law acts."""
        return self.mode in (Mode.CONTACT, Mode.BILATERAL)

    def states(self, ball: Ball, s: Floats) -> tuple[Floats, Floats]:
        """Gap and rate at the times s after the start of the arc."""
        if self.closed:
            gap = LinearArc(ball.a0, ball.a1, self.h, self.v)
            return gap(s), gap.rate(s)
        return self.h + (self.v - 0.5 * ball.gravity * s) * s, self.v - ball.gravity * s


def release_time(ball: Ball, h: float, v: float) -> float:
    """Time from activation at (h, v) with lam > 0 until lam = 0, s; infinite if the ball is captured."""
    acceleration = LinearArc(ball.a0, ball.a1, v, -ball.a1 * v - ball.a0 * h).rate
    if ball.gravity == 0.0:
        return acceleration.first_zero()
    start, slope = 0.0, acceleration.x1
    if slope > 0.0 or (slope == 0.0 and acceleration.x0 < 0.0):
        start = acceleration.rate.first_zero()
        if math.isinf(start):
            return math.inf
    turned = LinearArc(ball.a0, ball.a1, *(float(x(start)) for x in (acceleration, acceleration.rate)))
    # Past its top the second time the slope is zero is the lowest point; later ones are higher.
    low = _next_turn(turned, at_top=start > 0.0)
    if math.isinf(low) or float(acceleration(start + low)) + ball.gravity >= 0.0:
        return math.inf
    early, late = start, start + low
    # To the last bit, at a thousandth of what SciPy takes to import.
    while early < (middle := 0.5 * (early + late)) < late:
        early, late = (middle, late) if float(acceleration(middle)) + ball.gravity > 0.0 else (early, middle)
    return late


def _next_turn(x: LinearArc, *, at_top: bool) -> float:
    """Time to the next zero of x'; `at_top` says that x' is zero now, whatever rounding says."""
    slope = x.rate
    return (LinearArc(x.a0, x.a1, 0.0, slope.x1) if at_top else slope).first_zero()


def _fall(ball: Ball, arc: Arc) -> Arc | None:
    """From FREE to touching; None if the ball never comes down."""
    g, h, v = ball.gravity, arc.h, arc.v
    speed = math.sqrt(max(v * v + 2.0 * g * h, 0.0))
    if speed == 0.0 or (g == 0.0 and v >= 0.0):
        return None
    t = (v + speed) / g if v >= 0.0 else 2.0 * h / (speed - v)
    return Arc(arc.t + t, Mode.CONTACT, 0.0, -speed)


def _rise(ball: Ball, arc: Arc) -> Arc | None:
    """From BALLISTIC to the surface, or back into contact at the apex below it."""
    g, h, v = ball.gravity, arc.h, arc.v
    square = v * v + 2.0 * g * h
    if v > 0.0 and square > 0.0:
        speed = math.sqrt(square)
        return Arc(arc.t - 2.0 * h / (v + speed), Mode.FREE, 0.0, speed)
    return Arc(arc.t + v / g, Mode.CONTACT, h + 0.5 * v * v / g, 0.0) if g > 0.0 else None


def _leave(ball: Ball, arc: Arc) -> Arc | None:
    """From CONTACT to BALLISTIC or, above the surface, FREE; None if captured."""
    s = 0.0 if ball.gravity < ball.a1 * arc.v + ball.a0 * arc.h else release_time(ball, arc.h, arc.v)
    if math.isinf(s):
        return None
    h, v = (float(x) for x in arc.states(ball, np.array(s)))
    return Arc(arc.t + s, Mode.FREE if h > 0.0 else Mode.BALLISTIC, h, v)


_NEXT: dict[Mode, Callable[[Ball, Arc], Arc | None]] = {
    Mode.FREE: _fall,
    Mode.BALLISTIC: _rise,
    Mode.CONTACT: _leave,
}


def arcs(ball: Ball, h: float, v: float, t_end: float) -> Iterator[Arc]:
    """The pieces of the motion from (h, v) at t = 0, in order; a start in contact is its first event."""
    if ball.bilateral:
        yield Arc(0.0, Mode.BILATERAL, h, v)
        return
    arc: Arc | None = Arc(0.0, Mode.FREE, h, v)
    touching = h < 0.0 or (h == 0.0 and (v < 0.0 or (v == 0.0 and ball.gravity > 0.0)))
    while arc is not None and arc.t <= t_end:
        yield arc
        arc = Arc(0.0, Mode.CONTACT, h, v) if touching else _NEXT[arc.mode](ball, arc)
        touching = False


class Motion:
    """The exact motion of one ball, from gap h, m, and rate v, m/s, at t = 0, to be evaluated at any times."""

    def __init__(self, ball: Ball, h: float, v: float, t_end: float) -> None:
        self.ball = ball
        self._start = (h, v, t_end)

    @cached_property
    def arcs(self) -> list[Arc]:
        """The pieces, worked out when the first is asked for."""
        return list(islice(arcs(self.ball, *self._start), MAX_ARCS))

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """The transitions up to the horizon."""
        return tuple(Event(t=b.t, contact=0, before=a.mode, after=b.mode) for a, b in pairwise(self.arcs))

    @cached_property
    def _starts(self) -> Floats:
        return np.array([arc.t for arc in self.arcs])

    def __call__(self, t: Floats) -> Trajectory:
        """The motion at nondecreasing times t (n,), s.

        An instant of an event that is asked for twice stands before and after it.
        """
        t = np.asarray(t, dtype=np.float64)
        piece = pieces(self._starts, t)
        h, v, lam = np.empty_like(t), np.empty_like(t), np.zeros_like(t)
        for i in distinct(piece):
            arc, on = self.arcs[i], piece == i
            h[on], v[on] = arc.states(self.ball, t[on] - arc.t)
            if arc.closed:
                lam[on] = self.ball.mass * (self.ball.gravity - self.ball.a1 * v[on] - self.ball.a0 * h[on])
        return self._trajectory(t, h, v, lam, np.array([self.arcs[i].mode for i in piece], dtype=np.int8))

    def _trajectory(self, t: Floats, h: Floats, v: Floats, lam: Floats, mode: Bytes) -> Trajectory:
        m, first = self.ball.mass, self.arcs[0]
        energy = np.stack([0.5 * m * v * v, m * self.ball.gravity * h], axis=1)
        # The floor is the only one that does work here: the account of its work is exact.
        work = energy.sum(axis=1) - m * (0.5 * first.v**2 + self.ball.gravity * first.h)
        full = len(self.arcs) >= MAX_ARCS
        return Trajectory(
            t=t, q=h[:, None], v=v[:, None], gap=h[:, None], lam=lam[:, None], energy=energy,
            mode=mode[:, None], events=self.events, steps=len(self.arcs),
            outcome=Outcome.STEP_LIMIT if full else Outcome.FINISHED,
            message=f"more than {MAX_ARCS} arcs" if full else "",
            ledger=Ledger(contact=work[:, None], input=np.zeros_like(t), dissipated=np.zeros_like(t)),
        )  # fmt: skip
