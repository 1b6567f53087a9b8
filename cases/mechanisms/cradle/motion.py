"""The exact motion of balls on a line that collide in no time: straight lines between impacts (tier A)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.cases.between import pieces
from crossbody.cases.errors import Outcome
from crossbody.cases.mechanisms.cradle.scene import Row
from crossbody.cases.trajectory import Event, Ledger, Mode, Trajectory

Touching = NDArray[np.bool_]
Impulses = dict[int, float]  # row -> impulse, N s, of all rows that act at once
Impact = Callable[[Floats, Floats, Touching, float, float], Iterator[Impulses]]

TIE = 1e-12  # rates are equal within this part of the fastest ball
STILL = 1e-9  # a gap whose rate is below this part of the fastest one seen so far stands still
MAX_IMPACTS = 100_000
TOUCH = 64.0 * float(np.finfo(np.float64).eps)
"""A gap this small, of the largest coordinate and at least of 1 m, is closed."""


def sequential(masses: Floats, v: Floats, touching: Touching, e: float, slow: float) -> Iterator[Impulses]:
    """The impulse of each collision in turn; v (n,) is moved on in place before each is told.

    Args:
        masses (n,): kg.
        v (n,): speeds, m/s.
        touching (n - 1,): which neighbours touch.
        e: restitution.
        slow: rate below which a gap stands still, m/s.
    """
    tie = TIE * float(np.max(np.abs(v), initial=0.0))
    rates, last = np.where(touching, np.diff(v), np.inf), len(touching) - 1
    while True:
        worst = float(rates.min())
        if worst >= -slow:
            return
        row = int(np.argmax(rates <= worst + tie))
        a, b = masses[row : row + 2]
        yield _push(masses, v, {row: float((1.0 + e) * a * b / (a + b) * (v[row] - v[row + 1]))})
        for i in range(max(row - 1, 0), min(row + 1, last) + 1):  # no other has changed
            if touching[i]:
                rates[i] = v[i + 1] - v[i]


def _push(masses: Floats, v: Floats, impulses: Impulses) -> Impulses:
    """Let impulses act on the speeds."""
    for row, impulse in impulses.items():
        v[row] -= impulse / masses[row]
        v[row + 1] += impulse / masses[row + 1]
    return impulses


def simultaneous(masses: Floats, v: Floats, touching: Touching, e: float, slow: float) -> Iterator[Impulses]:
    """All impulses of what touches and stays, again if some then approach; arguments as of `sequential`."""
    while (touching & (np.diff(v) < -slow)).any():
        rows = np.flatnonzero(touching & (np.diff(v) <= slow))
        impulses = pushes(delassus(masses)[np.ix_(rows, rows)], (1.0 + e) * np.diff(v)[rows])
        yield _push(masses, v, dict(zip(rows.tolist(), impulses.tolist(), strict=True)))


def delassus(masses: Floats) -> Floats:
    """G = H M^-1 H^T (n - 1, n - 1) of a row of balls, 1/kg: tridiagonal."""
    inverse = 1.0 / masses
    off = np.diag(-inverse[1:-1], 1)
    return np.diag(inverse[:-1] + inverse[1:]) + off + off.T


def pushes(G: Floats, b: Floats) -> Floats:
    """The solution x (k,) of 0 <= x, G x + b >= 0, x . (G x + b) = 0, G (k, k) positive definite.

    If not all push, the set that does is found by non-negative least squares on the Cholesky
    factor, in finitely many steps.
    """
    x: Floats = np.asarray(np.linalg.solve(G, -b), dtype=np.float64)
    if x.min() >= 0.0:
        return x
    from scipy.linalg import cholesky, solve_triangular  # which take longer to import than most runs
    from scipy.optimize import nnls

    R = cholesky(G)
    active = nnls(R, solve_triangular(R, -b, trans="T"))[0] > 0.0
    x[:] = 0.0
    if active.any():
        x[active] = np.linalg.solve(G[np.ix_(active, active)], -b[active])
    return x


RULES: dict[str, Impact] = {"sequential": sequential, "simultaneous": simultaneous}


@dataclass(slots=True)
class _Course:
    """Straight motions (start, x, v, work of each row), impacts, the fastest rate of a gap so far, m/s."""

    starts: list[float] = field(default_factory=list)
    x: list[Floats] = field(default_factory=list)
    v: list[Floats] = field(default_factory=list)
    work: list[Floats] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    fastest: float = 0.0
    full: bool = False

    def add(self, t: float, x: Floats, v: Floats, work: Floats) -> None:
        """One more piece."""
        for kept, value in ((self.x, x), (self.v, v), (self.work, work)):
            kept.append(value.copy())
        self.starts.append(t)


def _collisions(t: float, struck: dict[int, float]) -> list[Event]:
    """FREE -> COLLISION -> FREE at one instant, of all rows that are struck together."""
    begun = [Event(t=t, contact=row, before=Mode.FREE, after=Mode.COLLISION) for row in struck]
    return begun + [
        Event(t=t, contact=row, before=Mode.COLLISION, after=Mode.FREE, impulse=impulse)
        for row, impulse in struck.items()
    ]


class Motion:
    """The motion of a row of sliders under a frozen rule, to be evaluated at any times.

    The balls start at x = 0 (displacements) with `row.v0`; the rule is "sequential" or
    "simultaneous".
    """

    def __init__(self, row: Row, rule: str) -> None:
        self.row, self.impact = row, RULES[rule]

    @cached_property
    def _course(self) -> _Course:
        """From impact to impact until no gap closes."""
        row, course = self.row, _Course()
        t, x, v, work = 0.0, np.zeros(row.n), row.v0.copy(), np.zeros(row.n - 1)
        touching = np.full(row.n - 1, row.gap == 0.0)
        while True:
            course.add(t, x, v, work)
            if self._collide(t, v, touching, work, course):
                self._come_together(x, v, touching, STILL * course.fastest)
                course.add(t, x, v, work)
            wait = self._advance(x, v, touching, STILL * course.fastest)
            course.full = len(course.events) >= 2 * MAX_IMPACTS
            if math.isinf(wait) or course.full:
                return course
            t += wait

    def _collide(self, t: float, v: Floats, touching: Touching, work: Floats, course: _Course) -> bool:
        """Let the touching balls collide; whether any did. v and work are moved on in place.

        A collision is told of a row that closed; one that stood still and passes an impulse on
        has none of its own.
        """
        before, rates, last = len(course.events), np.diff(v).tolist(), len(touching) - 1
        course.fastest = max(course.fastest, *map(abs, rates))
        for impulses in self.impact(self.row.masses, v, touching, self.row.e, STILL * course.fastest):
            closed = {i: p for i, p in impulses.items() if p > 0.0 and rates[i] < -STILL * course.fastest}
            course.events += _collisions(t, closed)
            for row, impulse in impulses.items():
                work[row] += 0.5 * impulse * (rates[row] + float(v[row + 1] - v[row]))
            changed = {near for row in impulses for near in (row - 1, row, row + 1) if 0 <= near <= last}
            for row in changed:
                rates[row] = float(v[row + 1] - v[row])
                course.fastest = max(course.fastest, abs(rates[row]))
            if len(course.events) >= 2 * MAX_IMPACTS:
                break
        return len(course.events) > before

    def _closed(self, x: Floats) -> Touching:
        """Gaps that count as closed: collisions that follow each other ever faster end at one instant."""
        return np.asarray(self.row.gap + np.diff(x) <= TOUCH * max(1.0, float(np.abs(x).max())))

    def _come_together(self, x: Floats, v: Floats, touching: Touching, slow: float) -> None:
        """Give balls that touch and move together one speed, to which collisions without end lead."""
        still = (touching | self._closed(x)) & (np.abs(np.diff(v)) <= slow)
        touching |= still
        m, first = self.row.masses, np.concatenate([[0], np.flatnonzero(~still) + 1, [self.row.n]])
        for a, b in pairwise(first.tolist()):
            if b - a > 1:
                v[a:b] = m[a:b] @ v[a:b] / m[a:b].sum()

    def _advance(self, x: Floats, v: Floats, touching: Touching, slow: float) -> float:
        """Move to the next touch; the time that it takes, s, infinite if no gap closes faster than `slow`, m/s."""
        rates = np.diff(v)
        touching &= rates <= slow
        gaps = np.maximum(self.row.gap + np.diff(x), 0.0)
        closing = ~touching & (rates < -slow)
        times = np.divide(gaps, -rates, out=np.full(len(gaps), np.inf), where=closing)
        wait = float(times.min())
        if math.isfinite(wait):
            x += v * wait
            touching |= (times <= wait * (1.0 + TIE)) | self._closed(x)
        return wait

    @property
    def last(self) -> float:
        """When no gap closes any more, s."""
        return self._course.starts[-1]

    @property
    def final(self) -> Floats:
        """Speeds behind the last impact (n,), m/s."""
        return self._course.v[-1]

    @property
    def events(self) -> tuple[Event, ...]:
        """The impacts, each FREE -> COLLISION -> FREE at one instant."""
        return tuple(self._course.events)

    def __call__(self, t: Floats) -> Trajectory:
        """The motion at nondecreasing times t (n,), s; an impact's twice: before and after."""
        t, course, m = np.asarray(t, dtype=np.float64), self._course, self.row.masses
        piece = pieces(np.array(course.starts), t)
        v, work = np.array(course.v)[piece], np.array(course.work)[piece]
        x = np.array(course.x)[piece] + v * (t - np.array(course.starts)[piece])[:, None]
        kinetic = 0.5 * (m * v * v).sum(axis=1)
        shape = (len(t), self.row.n - 1)
        return Trajectory(
            t=t, q=x, v=v, gap=np.maximum(self.row.gap + np.diff(x, axis=1), 0.0), lam=np.zeros(shape),
            energy=np.stack([kinetic, np.zeros_like(t)], axis=1), mode=np.zeros(shape, dtype=np.int8),
            events=self.events, steps=len(course.starts),
            outcome=Outcome.STEP_LIMIT if course.full else Outcome.FINISHED,
            message=f"more than {MAX_IMPACTS} impacts" if course.full else "",
            ledger=Ledger(contact=work, input=np.zeros_like(t), dissipated=np.zeros_like(t)),
        )  # fmt: skip
