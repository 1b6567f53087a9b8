"""The level machine for one set of constants (spec 1.2), in plain Python: independent of the compiled core.

    FREE -> CONTACT       h <= 0 and (h' < 0 or h < 0), or at rest on the surface with a free h'' < 0
    CONTACT -> BALLISTIC  lam < 0 and h <= 0
    CONTACT -> FREE       lam < 0 and h > 0
    BALLISTIC -> FREE     h > 0
    BALLISTIC -> CONTACT  h <= 0 and h' < 0 and the lam that it would have is > 0

Velocities are continuous: every row follows its law in real time (for several contacts the rule `resolved`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from crossbody.cases import Mode
from crossbody.cases._arrays import Floats
from crossbody.engines._log import Modes
from crossbody.engines._machines import WATCHED, Fired, Rows, Settled, active

FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)
GAP, PUSH = 0, 1
"""The two functions watched of a row."""


@dataclass(frozen=True, slots=True)
class Instant:
    """One instant while it is settled: the state, gaps with located zeros set to 0, and what has switched so far."""

    q: Floats
    v: Floats
    h: list[float]
    hd: list[float]
    fired: Fired
    switched: set[int]


class LevelMachine:
    """Guards on levels, evaluated until nothing changes."""

    def __init__(self, rows: Rows) -> None:
        self.rows = rows

    def watch(self, q: Floats, v: Floats, modes: Modes, out: NDArray[Any]) -> None:
        """FREE: h and h' (whose zero is where a dip is deepest); CONTACT: lam; BALLISTIC: h and max(h', -lam)."""
        h, hd = self.rows.gaps(q, v)
        on = active(modes)
        lam = self.rows.accelerate(q, v, on)[1] if CONTACT in modes else None
        for i, mode in enumerate(modes):
            gap = push = 1.0
            if mode == FREE:
                gap, push = h[i], hd[i]
            elif mode == CONTACT and lam is not None:
                push = lam[i]
            elif mode == BALLISTIC:
                gap, push = h[i], max(hd[i], -self._would_push(q, v, on, i))
            out[WATCHED * i : WATCHED * i + 2] = gap, push

    def settle(self, q: Floats, v: Floats, modes: Modes, fired: Fired = frozenset()) -> Settled:
        """See `crossbody.engines._machines.Machine`."""
        h, hd = (x.tolist() for x in self.rows.gaps(q, v))
        for i, which in fired:
            if which == GAP:
                h[i] = 0.0
        at = Instant(q, v, h, hd, fired, set())
        seen, passed = {modes}, []
        while (after := self._once(at, modes)) != modes:
            passed += [(i, b, a) for i, (b, a) in enumerate(zip(modes, after, strict=True)) if a != b]
            at.switched.update(i for i, _, _ in passed)
            modes = after
            if modes in seen:
                return Settled(modes, v, tuple(passed), cycle=True)
            seen.add(modes)
        return Settled(modes, v, tuple(passed))

    def _once(self, at: Instant, modes: Modes) -> Modes:
        """Every row switched once by the guards that hold now."""
        vd, lam = self.rows.accelerate(at.q, at.v, active(modes))
        after = list(modes)
        for i, mode in enumerate(modes):
            if mode == FREE and self._touches(at, vd, i):
                after[i] = CONTACT
            elif mode == CONTACT and self._released(at, lam, i):
                after[i] = FREE if at.h[i] > 0.0 else BALLISTIC
            elif mode == BALLISTIC:
                after[i] = self._from_ballistic(at, modes, i)
        return tuple(after)

    def _touches(self, at: Instant, vd: Floats, i: int) -> bool:
        h, hd = at.h[i], at.hd[i]
        if h == 0.0 and hd == 0.0:
            return bool(self.rows.gap_acceleration(at.q, at.v, vd)[i] < 0.0)
        return h < 0.0 or (h == 0.0 and hd < 0.0)

    def _released(self, at: Instant, lam: Floats, i: int) -> bool:
        """Lam below zero; a row that was switched on at this very instant while closing is not let go on round-off."""
        if i in at.switched:
            return bool(lam[i] < 0.0) and at.hd[i] >= 0.0
        return bool(lam[i] < 0.0) or (i, PUSH) in at.fired

    def _from_ballistic(self, at: Instant, modes: Modes, i: int) -> int:
        if at.h[i] > 0.0 or ((i, GAP) in at.fired and at.hd[i] >= 0.0):
            return FREE
        if i in at.switched or not at.hd[i] < 0.0:
            return BALLISTIC
        would = self._would_push(at.q, at.v, active(modes), i)
        return CONTACT if would > 0.0 or (i, PUSH) in at.fired else BALLISTIC

    def _would_push(self, q: Floats, v: Floats, on: tuple[int, ...], i: int) -> float:
        return float(self.rows.accelerate(q, v, sorted((*on, i)))[1][i])
