"""Impacts in no time: `impulseDynamics` with the restitution that the law's own collision has (spec 1.3, 4.3)."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

from numpy.typing import NDArray

from crossbody.cases import Law, Mode
from crossbody.cases._arrays import Floats
from crossbody.cases._closed_forms import damping_ratio
from crossbody.cases._closed_forms import restitution as restitution_at
from crossbody.engines._log import Modes
from crossbody.engines._machines import WATCHED, Fired, Passed, Settled, active
from crossbody.engines.pinocchio._rows import PinRows

FREE, CONTACT, COLLISION = int(Mode.FREE), int(Mode.CONTACT), int(Mode.COLLISION)
GAP, PUSH = 0, 1


def restitution(law: Law, row: int) -> float:
    """e(zeta) of the linear part of the law; 0 without stiffness, whose collision never ends."""
    a0, a1 = float(law.a0[row]), float(law.a1[row])
    return restitution_at(damping_ratio(a0, a1)) if a0 > 0.0 else 0.0


def capture_speed(press: float, a0: float, e: float) -> float:
    """Approach speed below which the law never lets go, m/s: press / (w e^(3/2)), press = -h'' without the row."""
    if not (a0 > 0.0 and e > 0.0):
        return math.inf
    return max(press, 0.0) / (math.sqrt(a0) * math.pow(e, 1.5))


class ImpulseMachine:
    """Rows are FREE or, once captured, held rigidly (CONTACT) until they would have to pull.

    A struck row passes through COLLISION within the instant. One row is struck at a time, the most approaching
    first, until none approaches.
    """

    def __init__(self, rows: PinRows, a0: Floats, e: list[float]) -> None:
        self.rows: PinRows = rows
        self.a0, self.e = a0, e

    def watch(self, q: Floats, v: Floats, modes: Modes, out: NDArray[Any]) -> None:
        """FREE: h and h'; CONTACT: lam."""
        h, hd = self.rows.gaps(q, v)
        lam = self.rows.accelerate(q, v, modes)[1] if CONTACT in modes else None
        for i, mode in enumerate(modes):
            pair = (h[i], hd[i]) if mode == FREE else (1.0, lam[i] if lam is not None else 1.0)
            out[WATCHED * i : WATCHED * i + 3] = (*pair, 1.0)

    def settle(self, q: Floats, v: Floats, modes: Modes, fired: Fired = frozenset()) -> Settled:
        """Release what pulls, then strike or hold what touches."""
        passed: list[Passed] = []
        now = list(modes)
        lam = self.rows.accelerate(q, v, modes)[1]
        for i, mode in enumerate(modes):
            if mode == CONTACT and (lam[i] < 0.0 or (i, PUSH) in fired):
                now[i] = FREE
                passed.append((i, CONTACT, FREE, 0.0))
        released = {i for i, *_ in passed}
        touching = [i for i, h in enumerate(self.rows.gaps(q, v)[0]) if h <= 0.0 or (i, GAP) in fired]
        for _ in range(1000 * len(modes)):
            i, approach = self._next(q, v, now, touching)
            if i < 0:
                break
            v, after = self._hit(q, v, now, i, approach) if approach > 0.0 else (v, CONTACT)
            if i in released and after == CONTACT and approach <= 0.0:
                break
            passed += (
                [(i, FREE, COLLISION, 0.0), (i, COLLISION, after, 0.0)] if approach > 0.0 else [(i, FREE, CONTACT, 0.0)]
            )
            now[i] = after
        else:
            return Settled(tuple(now), v, tuple(passed), cycle=True)
        return Settled(tuple(now), v, tuple(passed))

    def _next(self, q: Floats, v: Floats, now: list[int], touching: list[int]) -> tuple[int, float]:
        """The free touching row that approaches most, m/s, or lies pressed at rest (0); row -1 if none."""
        hd = self.rows.gaps(q, v)[1]
        best, speed = -1, 0.0
        for i in touching:
            if now[i] != FREE:
                continue
            if -hd[i] > speed or (hd[i] == 0.0 and best < 0 and self._press(q, v, now, i) > 0.0):
                best, speed = i, max(float(-hd[i]), 0.0)
        return best, speed

    def _press(self, q: Floats, v: Floats, now: list[int], i: int) -> float:
        vd, _ = self.rows.accelerate(q, v, tuple(now))
        return -float(self.rows.gap_acceleration(q, v, vd)[i])

    def _hit(self, q: Floats, v: Floats, now: list[int], i: int, approach: float) -> tuple[Floats, int]:
        """Velocities behind the impact, and the mode that the row leaves it in."""
        e = self.e[i]
        if e <= 0.0 or approach < capture_speed(self._press(q, v, now, i), float(self.a0[i]), e):
            return self.rows.strike(q, v, (*active(tuple(now)), i), 0.0), CONTACT
        return self.rows.strike(q, v, (i,), e), FREE
