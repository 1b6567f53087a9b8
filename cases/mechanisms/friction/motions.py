"""Exact motions with friction: how a body slides on a slope and stops, turns or goes on (docs/explanation/contacts.md).

A is the acceleration downhill, B = mu g cos(slope) that of friction. Straight slides are
parabolas. An oblique one turns downhill: with th from downhill, u = tan(th/2) and kappa = B/A,

    |v| = C u^kappa / sin th,    u' = -A u / |v|,

so that time and place are sums of powers of u; it stops at u = 0 if kappa > 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.between import pieces
from crossbody.cases.trajectory import Event, Mode, Trajectory

HALVINGS, LEAST = 100, 1e-300  # of ln u between its least value and its start
Rows = tuple[Floats, Floats, Floats, Floats]  # at instants (n,): q (n, nq), v (n, nv), gap and lam (n, nc)
Path = Callable[[Floats], tuple[Floats, Floats, Floats]]
"""Times since a start (n,) -> place, velocity and acceleration by friction in the plane of a floor (n, 2)."""


@dataclass(frozen=True, slots=True)
class Stage:
    """A part of a motion between two events.

    Attributes:
        start: s.
        modes (nc,): of all rows.
        at: times since the start (n,), s -> what is there.
    """

    start: float
    modes: tuple[int, ...]
    at: Callable[[Floats], Rows]


class Motion:
    """An exact motion of several stages, to be evaluated at any nondecreasing times.

    Args:
        stages: in order; the first begins at 0.
        normals: number of rows that have events, which stand first.
        energy: q (n, nq), v (n, nv) -> kinetic and potential energy (n, 2), J.
        t_end: horizon, s.
        before: mode of all rows before the first stage.
        held: how many of them, which stand first, are always on and have none.
    """

    def __init__(
        self, stages: Sequence[Stage], normals: int, energy: Callable[[Floats, Floats], Floats], t_end: float,
        before: Mode = Mode.FREE, held: int = 0,
    ) -> None:  # fmt: skip
        stages = [stage for stage in stages if stage.start <= t_end]
        self.stages, self.energy, self.starts = stages, energy, np.array([stage.start for stage in stages])
        modes = stages[0].modes
        free = Stage(0.0, (*modes[:held], *[int(before)] * (len(modes) - held)), stages[0].at)
        self.events = tuple(
            Event(t=b.start, contact=i, before=Mode(b_), after=Mode(a_))
            for a, b in pairwise((free, *stages))
            for i, (b_, a_) in enumerate(zip(a.modes[:normals], b.modes[:normals], strict=True))
            if b_ != a_ or (b is not stages[0] and a_ == Mode.SLIP)
        )

        self.held, self.normals, self.t_end = held, normals, t_end

    @property
    def presses(self) -> bool:
        """Whether no place would have to pull: else what lies on several tips."""
        ends = self(np.array([0.0, self.t_end])).lam[:, self.held : self.normals]
        return self.normals == 1 or bool((ends >= 0.0).all())

    def __call__(self, t: Floats) -> Trajectory:
        """Return the motion at times (n,), s; an event's instant that stands twice is before and after it."""
        t = np.asarray(t, dtype=np.float64)
        piece = pieces(self.starts, t)
        parts = [self.stages[k].at(t[piece == k] - self.starts[k]) for k in distinct(piece)]
        q, v, gap, lam = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        mode = np.array([self.stages[k].modes for k in piece], dtype=np.int8)
        return Trajectory(t=t, q=q, v=v, gap=gap, lam=lam, energy=self.energy(q, v), mode=mode, events=self.events,
                          steps=len(self.stages))  # fmt: skip


def shares(load: Floats, arms: Floats, torque: Floats) -> Floats:
    """Return what each of some places bears (n, k) of a load (n,), N, by least norm.

    Args:
        load: n instants.
        arms: of the places from their middle (k, 2), m, which no axis tells apart from its opposite.
        torque: sums of a place's part times its arm (n, 2), N m.
    """
    even = np.broadcast_to(load[:, None] / len(arms), (len(load), len(arms)))
    found: Floats = even + torque @ (arms / np.sum(arms**2, axis=0)).T
    return found


def power(p: float, u0: float, u: Floats) -> Floats:
    """Return the integral of x^(p - 1) from u (n,) to u0."""
    if p == 0.0:
        return math.log(u0) - np.log(u)
    found: Floats = (u0**p - u**p) / p
    return found


def slide(A: float, B: float, speed: float, angle: float) -> list[tuple[float, Mode, Path]]:
    """Return the stages of a body that slides, holds or turns on a slope: start, s, mode, and path from there.

    Args:
        A: acceleration downhill (along x), m/s^2.
        B: that of friction.
        speed: at the start, m/s.
        angle: of its velocity from downhill, rad.
    """
    if abs(math.sin(angle)) * speed > 0.0 and A > 0.0 and abs(math.cos(angle)) < 1.0 - 1e-12:
        return _oblique(A, B, speed, angle)
    ways = (math.cos(angle), math.sin(angle)) if A == 0.0 else (math.copysign(1.0, math.cos(angle)), 0.0)
    return _straight(A, B, speed, np.array(ways))


def _straight(A: float, B: float, speed: float, way: Floats) -> list[tuple[float, Mode, Path]]:
    down, place, t = np.array([A, 0.0]), np.zeros(2), 0.0
    stages: list[tuple[float, Mode, Path]] = []
    if speed > 0.0:
        push = -B * way
        stages.append((0.0, Mode.SLIP, _parabola(place, speed * way, down, push)))
        brake = -float((down + push) @ way)
        if brake <= 0.0:
            return stages
        t, place = speed / brake, 0.5 * speed**2 / brake * way
    holds = B >= A
    push = -down if holds else np.array([-B, 0.0])
    return [*stages, (t, Mode.STICK if holds else Mode.SLIP, _parabola(place, np.zeros(2), down, push))]


def _parabola(place: Floats, v: Floats, down: Floats, push: Floats) -> Path:
    a = down + push

    def path(s: Floats) -> tuple[Floats, Floats, Floats]:
        s = s[:, None]
        return place + s * v + 0.5 * s**2 * a, v + s * a, np.broadcast_to(push, (len(s), 2))

    return path


def _oblique(A: float, B: float, speed: float, angle: float) -> list[tuple[float, Mode, Path]]:
    slides = _Oblique(A, B, speed, angle)
    stages: list[tuple[float, Mode, Path]] = [(0.0, Mode.SLIP, slides)]
    if math.isfinite(slides.stop):
        end, down = slides.place(np.array([LEAST]))[0], np.array([A, 0.0])
        stages.append((slides.stop, Mode.STICK, _parabola(end, np.zeros(2), down, -down)))
    return stages


class _Oblique:
    """An oblique slide, as functions of u = tan(th/2); `stop` is when it ends, s.

    Called, it is the path at times since its start.
    """

    def __init__(self, A: float, B: float, speed: float, angle: float) -> None:
        self.A, self.B, self.kappa, self.side = A, B, B / A, math.copysign(1.0, angle)
        self.u0 = math.tan(0.5 * abs(angle))
        self.C = speed * math.sin(abs(angle)) / self.u0**self.kappa
        self.stop = float(self.left(np.array(self.u0))) if self.kappa > 1.0 else math.inf

    def __call__(self, s: Floats) -> tuple[Floats, Floats, Floats]:
        """Return place, velocity and acceleration by friction (n, 2) at times s (n,)."""
        u = self.tangent(s)
        way = np.stack([1.0 - u**2, self.side * 2.0 * u], axis=-1) / (1.0 + u**2)[:, None]
        speed = 0.5 * self.C * (u ** (self.kappa - 1.0) + u ** (self.kappa + 1.0))
        return self.place(u), speed[:, None] * way, -self.B * way

    def left(self, u: Floats) -> Floats:
        """Return the time that is left until it stops, where kappa > 1."""
        less, more = self.kappa - 1.0, self.kappa + 1.0
        found: Floats = 0.5 * self.C / self.A * (u**less / less + u**more / more)
        return found

    def elapsed(self, u: Floats) -> Floats:
        """Return the time since the start."""
        both = power(self.kappa - 1.0, self.u0, u) + power(self.kappa + 1.0, self.u0, u)
        found: Floats = 0.5 * self.C / self.A * both
        return found

    def tangent(self, s: Floats) -> Floats:
        """Return u at times s (n,), by halving ln u: close to the stop the time that is left tells it."""
        low, high = np.full(len(s), math.log(LEAST)), np.full(len(s), math.log(self.u0))
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            u = np.exp(middle)
            above = self.left(u) > self.stop - s if math.isfinite(self.stop) else self.elapsed(u) < s
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        found: Floats = np.exp(0.5 * (low + high))
        return found

    def place(self, u: Floats) -> Floats:
        """Return where it is (n, 2), m."""
        twice = 2.0 * self.kappa
        x = 0.5 * (power(twice - 2.0, self.u0, u) - power(twice + 2.0, self.u0, u))
        y = self.side * (power(twice - 1.0, self.u0, u) + power(twice + 1.0, self.u0, u))
        found: Floats = 0.5 * self.C**2 / self.A * np.stack([x, y], axis=-1)
        return found
