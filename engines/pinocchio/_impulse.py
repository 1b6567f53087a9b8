"""Impacts in no time: `impulseDynamics` with the restitution that the law's own collision has."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Law, Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.closed_forms import damping_ratio
from crossbody.cases.closed_forms import restitution as restitution_at
from crossbody.engines._log import Modes
from crossbody.engines._machines import WATCHED, Fired, Passed, Settled, active, switched
from crossbody.engines.pinocchio._rows import ULP, PinRows

FREE, CONTACT, COLLISION = int(Mode.FREE), int(Mode.CONTACT), int(Mode.COLLISION)
GAP, TURN = 0, 1
PUSH = 1  # the functions watched of a row that is free, and of one that is held
SLOW = 1e-9  # part of the largest rate of a gap below which it stands still
WEAK = 1e-7
"""Part of a gap's largest acceleration below which a row at rest is not pressed: an error may be."""
TIES = 1e-12  # part of an approach, or of an impulse, within which two rows approach, or push, equally
PER_ROW = 1000  # impacts of one row at one instant that make a cycle


def constants(law: Law, row: int) -> tuple[float, float]:
    """a0 and a1 of a collision: the fast ones where the row has two sets."""
    quick = float(law.b0[row]) > 0.0
    return (float(law.b0[row]), float(law.b1[row])) if quick else (float(law.a0[row]), float(law.a1[row]))


def restitution(law: Law, row: int) -> float:
    """e(zeta) of the linear part of the law; 0 without stiffness, whose collision never ends."""
    a0, a1 = constants(law, row)
    return restitution_at(damping_ratio(a0, a1)) if a0 > 0.0 else 0.0


def capture_speed(press: float, a0: float, e: float) -> float:
    """Approach speed below which the law never lets go, m/s: press / (w e^(3/2)), press = -h'' without it."""
    if not (a0 > 0.0 and e > 0.0):
        return math.inf
    return max(press, 0.0) / (math.sqrt(a0) * math.pow(e, 1.5))


class Instant:
    """The rows at one instant, moved on by impacts.

    Attributes:
        q, v: state; v changes.
        modes: of every row; they change.
        passed: transitions so far.
        touching: the rows whose gap is closed.
        slow: rate below which a gap stands still, m/s.
        weak: acceleration below which a row at rest is not pressed, m/s^2.
        dropped: rows that were let go here: they are not caught again unless they approach.
    """

    def __init__(self, rows: PinRows, q: Floats, v: Floats, modes: Modes) -> None:
        self.rows, self.q, self.v, self.modes = rows, q, v, list(modes)
        self.slow = self.weak = 0.0
        self.passed: list[Passed] = []
        self.touching: list[int] = []
        self.dropped: set[int] = set()

    @property
    def held(self) -> tuple[int, ...]:
        """The rows that carry a multiplier."""
        return active(tuple(self.modes))

    def rates(self) -> Floats:
        """Rate of every gap (nc,), m/s; 0 where it stands still."""
        hd = self.rows.gaps(self.q, self.v)[1]
        return np.where(np.abs(hd) <= self.slow, 0.0, hd)

    def press(self) -> tuple[Floats, Floats]:
        """-h'' of every row that is not held, and its rounding (nc,), m/s^2."""
        vd, _ = self.rows.accelerate(self.q, self.v, tuple(self.modes))
        return self.rows.pressure(self.q, self.v, vd)

    def move(self, i: int, after: int, impulse: float = 0.0) -> None:
        """Switch one row."""
        self.passed.append((i, self.modes[i], after, impulse))
        self.modes[i] = after

    def release(self, i: int) -> None:
        """Let a held row go."""
        self.move(i, FREE)
        self.dropped.add(i)

    def release_pulling(self, fired: Fired) -> None:
        """Let every held row go that pulls, or whose multiplier was found to vanish."""
        if not self.held:
            return
        _, lam = self.rows.accelerate(self.q, self.v, tuple(self.modes))
        noise = self.press()[1] / np.diag(self.rows.delassus(self.q))
        for i, mode in enumerate(self.modes):
            if mode == CONTACT and (lam[i] < -noise[i] or (i, PUSH) in fired):
                self.release(i)

    def hold_resting(self) -> bool:
        """Hold a touching row that rests and is pressed; whether there was one."""
        hd, press = self.rates(), self.press()[0]
        for i in self.touching:
            if self.modes[i] == FREE and i not in self.dropped and hd[i] == 0.0 and press[i] > self.weak:
                self.move(i, CONTACT)
                return True
        return False


Impact = Callable[[Instant, list[float], list[float]], bool]
"""(instant, a0 and e of every row) -> whether something was struck."""


def sequential(at: Instant, a0: list[float], e: list[float]) -> bool:
    """Strike the free touching row that approaches most (ties within 1e-12 by index); held rows stay if they push."""
    hd = at.rates()
    if not (coming := [i for i in at.touching if at.modes[i] == FREE and hd[i] < 0.0]):
        return False
    fastest = min(hd[i] for i in coming)
    i = next(j for j in coming if hd[j] <= fastest * (1.0 - TIES))
    captured = e[i] <= 0.0 or -hd[i] < capture_speed(float(at.press()[0][i]), a0[i], e[i])
    at.move(i, COLLISION)
    while True:
        together = at.held  # the struck row is among them
        bounce = [0.0 if captured or j != i else e[i] for j in together]
        v, p = at.rows.strike(at.q, at.v, together, bounce)
        noise = TIES * float(np.abs(p).max())
        pulling = [j for j, impulse in zip(together, p, strict=True) if impulse < -noise and at.modes[j] == CONTACT]
        if not pulling:
            break
        for j in pulling:
            at.release(j)
    at.v = v
    at.move(i, CONTACT if captured else FREE, float(p[together.index(i)]))
    return True


def simultaneous(at: Instant, a0: list[float], e: list[float]) -> bool:
    """Strike all touching rows at once: 0 <= p perp H v+ + e H v >= 0."""
    hd, press = at.rates(), at.press()[0]
    if not (coming := [i for i in at.touching if at.modes[i] == FREE and hd[i] < 0.0]):
        return False
    caught = {i for i in coming if e[i] <= 0.0 or -hd[i] < capture_speed(float(press[i]), a0[i], e[i])}
    bounce = [0.0 if i in caught or at.modes[i] != FREE else e[i] for i in range(at.rows.nc)]
    near = sorted({*at.touching, *at.held})
    struck, v, p = _complementary(at, near, bounce)
    for i in at.held:
        if at.modes[i] == CONTACT and i not in struck:
            at.release(i)
    for i, impulse in zip(struck, p, strict=True):
        if at.modes[i] == FREE:
            at.move(i, COLLISION)
            at.move(i, CONTACT if i in caught else FREE, float(impulse))
    at.v = v
    return True


def _complementary(at: Instant, near: list[int], e: list[float]) -> tuple[list[int], Floats, Floats]:
    """Rows with an impulse, velocities behind it, and the impulses: rows that pull leave, rows that close come back."""
    before, struck = at.rows.gaps(at.q, at.v)[1], list(near)
    for _ in range(PER_ROW * len(near)):
        v, p = at.rows.strike(at.q, at.v, struck, [e[i] for i in struck])
        if len(p) and float(p.min()) < 0.0:
            struck.pop(int(np.argmin(p)))
            continue
        after = at.rows.gaps(at.q, v)[1]
        closing = {i: after[i] + e[i] * before[i] for i in near if i not in struck}
        worst = min(closing, key=lambda i: closing[i], default=-1)
        if worst < 0 or closing[worst] >= -at.slow:
            break
        struck = sorted([*struck, worst])
    return struck, v, p


RULES: dict[str, Impact] = {"impulse": sequential, "impulse_simultaneous": simultaneous}
"""Profile -> rule for several contacts."""


class ImpulseMachine:
    """Rows are FREE or, once captured, held rigidly (CONTACT) until they would have to pull.

    A struck row passes through COLLISION within the instant. The rule strikes until no touching
    row approaches. One run uses one machine: it remembers the largest rates and accelerations
    that it saw, and which gaps are closed.
    """

    def __init__(self, rows: PinRows, a0: list[float], e: list[float], rule: Impact = sequential) -> None:
        self.rows: PinRows = rows
        self.own, self.a0, self.e, self.rule = switched(rows), a0, e, rule
        self.slow = self.weak = 0.0
        self._closed: set[int] = set()

    def watch(self, q: Floats, v: Floats, modes: Modes, out: NDArray[Any]) -> None:
        """FREE: h and h'; CONTACT: lam."""
        h, hd = self.rows.gaps(q, v)
        lam = self.rows.accelerate(q, v, modes)[1] if CONTACT in modes else None
        out[:] = 1.0
        for i in self.own:
            at = WATCHED * i
            if modes[i] == FREE:
                out[at + GAP] = max(h[i], hd[i] + self.slow) if i in self._closed else h[i]
                out[at + TURN] = hd[i]
            elif lam is not None:
                out[at + PUSH] = lam[i]

    def settle(self, q: Floats, v: Floats, modes: Modes, fired: Fired = frozenset()) -> Settled:
        """Release what pulls; hold what rests and is pressed; strike what approaches, until nothing does."""
        h, hd = self.rows.gaps(q, v)
        at, rounding = Instant(self.rows, q, v, modes), 8.0 * ULP * float(np.abs(q).max(initial=0.0))
        at.slow = self.slow = max(self.slow, SLOW * float(np.abs(hd).max(initial=0.0)))
        at.weak = self.weak = max(self.weak, WEAK * float(np.abs(at.press()[0]).max(initial=0.0)))
        at.release_pulling(fired)
        at.touching = [i for i in self.own if h[i] <= rounding or (i, GAP) in fired]
        cycle = True
        for _ in range(PER_ROW * len(modes)):
            if not at.hold_resting() and not self.rule(at, self.a0, self.e):
                cycle = False
                break
        self._closed = set(at.touching)
        return Settled(tuple(at.modes), at.v, tuple(at.passed), cycle=cycle)
