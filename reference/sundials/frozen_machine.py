"""The level machine with frozen collisions (docs/explanation/model.md), in plain Python: the check on the compiled one.

A touching row with fast constants collides at one instant, by one of the rules of `_collisions`, until no touching gap
closes any more. At rest it is in CONTACT if it presses, with its slow constants, else FREE.

    FREE, BALLISTIC -> COLLISION -> FREE or CONTACT     impulse beside the second
    CONTACT -> FREE                                     where the collision would make the row pull
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from crossbody.cases import Mode, Outcome
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.collisions import RULES, Jump, Touching
from crossbody.reference.sundials.equations import ACTIVE, Ended, Equations
from crossbody.reference.sundials.level_machine import DEEP, SLOW, LevelMachine, View, Watch

LOCATED = 0.5  # of the least speed of approach: one that was located is not lost to rounding
STILL = 1e-13  # part of the largest rate seen: a rate below it is 0 but for rounding
FEW, A_PAIR = 1000, 64  # collisions at one instant; a chain of n equal bodies needs n (n - 1) / 2, inelastic ones more


class FrozenMachine(LevelMachine):
    """Modes of all rows; rows with fast constants collide in no time.

    Args:
        system: the mechanism.
        equations: its equations.
        collisions: "sequential" or "simultaneous".
        rtol: of the integrator: so deep may a row in contact drift, and no deeper, m.
    """

    def __init__(self, system: System, equations: Equations, collisions: str, rtol: float) -> None:
        super().__init__(system, equations)
        self.rule = RULES[collisions]
        self.frozen = frozenset(i for i in self.rows if equations.fast[i, 0] > 0.0)
        self.deep = max(DEEP, rtol)
        self.strongest = 0.0
        self._located: set[int] = set()
        self._collisions = 0
        self._collided_at = -np.inf

    def _active_mode(self, i: int) -> Mode:
        return Mode.CONTACT

    def _touches(self, i: int, h: float, q: Floats) -> bool:
        """A touch that was located is one, whatever rounding left of it."""
        if i not in self.frozen:
            return super()._touches(i, h, q)
        return h <= self._touch(q) or i in self._located

    def _approaches(self, i: int, rate: float) -> bool:
        return rate < -self.slow * (LOCATED if i in self._located else 1.0)

    def look(self, t: float, q: Floats, v: Floats) -> View:
        """Evaluate the present mode set; what collisions left of gaps and rates is noise of the multipliers."""
        view = super().look(t, q, v)
        active = self.equations.active
        left = np.array([self._left_over(i, 0.0, q) for i in active])
        if left.any():
            H, X = self.equations.mobility(t, q, v, active)
            inverse = np.linalg.inv(H @ X)  # whatever the signs: Cauchy and Schwarz
            view.noise[active] += np.sqrt(left @ inverse @ left * np.diag(inverse))
        self.strongest = max(self.strongest, self.equations.strongest(t, q, v, sorted(self.frozen)))
        return view

    def _presses(self, i: int, h: float, t: float, q: Floats, v: Floats) -> bool:
        """At rest the law has nothing to add: a row presses if its gap would close without it."""
        if i not in self.frozen or h < -self.deep:
            return super()._presses(i, h, t, q, v)
        band = SLOW * self.strongest + self._left_over(i, h, q)
        return self.equations.row_acceleration(t, q, v, i) < -band

    def _left_over(self, i: int, h: float, q: Floats) -> float:
        """What the law of a row at rest makes of a gap that counts as closed and a rate that counts as none, m/s^2."""
        if i not in self.frozen:
            return 0.0
        a0, a1, _ = self.equations.slow[i]
        return float(a0 * max(abs(h), self._touch(q)) + a1 * self.slow)

    def fire(self, t: float, q: Floats, v: Floats, fired: Iterable[tuple[int, Watch]]) -> bool:
        """A frozen row that meets the other body is noted; `settle` collides it. Other rows as ever."""
        others = []
        for i, watch in fired:
            mode = self.modes[i]
            meets = watch == Watch.SWITCH if mode == Mode.FREE else watch == Watch.OTHER
            if i in self.frozen and mode not in ACTIVE and meets:
                self._located.add(i)
            else:
                others.append((i, watch))
        return super().fire(t, q, v, others) or bool(self._located)

    def settle(self, t: float, q: Floats, v: Floats) -> View:
        """Switch and collide in turn until neither is left; v is changed in place.

        Raises:
            Ended: MODE_CYCLE naming the rows, or what the equations raise.
        """
        if t != self._collided_at:
            self._collided_at = t
            self._collisions = 0
        while True:
            view = self._switch_rows(t, q, v)
            if not self._collide_all(t, q, v, view):
                break
            self._seen.clear()  # v is another: a mode set may stand again
            self._one_by_one = self._alone = False
        self._arm(view, t, q, v)
        self._located.clear()
        return view

    def _collide_all(self, t: float, q: Floats, v: Floats, view: View) -> bool:
        """Collide until no touching gap closes; whether there was a collision."""
        before = self._collisions
        while (now := self._touching(q, view)).approaching:
            self._collide(t, q, v, view, now)
            view = self.look(t, q, v)
        if self._stand_still(t, q, v, view):
            return True
        return self._collisions > before

    def _stand_still(self, t: float, q: Floats, v: Floats, view: View) -> bool:
        """Give touching gaps that stand still the rate 0, which they have but for `slow`; whether any had another.

        Collisions that come ever faster (inelastic collapse) end there: the gaps would drift apart by more than
        rounding, and the next impulse would cross the rows in the order of their gaps.
        """
        active = self.equations.active
        still = [
            i for i in sorted(self.frozen)
            if i not in active and self._touches(i, float(view.gap[i]), q)
            and STILL * self.fastest < abs(view.rate[i]) <= self.slow
        ]  # fmt: skip
        if not still:
            return False
        rows = [*active, *still]
        H, X = self.equations.mobility(t, q, v, rows)
        P = np.linalg.solve(H @ X, np.array([0.0] * len(active) + [-view.rate[i] for i in still]))
        before = v.copy()
        v += X @ P
        self.work[rows] += 0.5 * P * (H @ (before + v))
        return True

    def _touching(self, q: Floats, view: View) -> Touching:
        """Sort the rows; a row in CONTACT without pressure is not held."""
        e, rate = self.equations, view.rate
        pressing = [i for i in e.active if not self.switching[i] or view.lam[i] > view.noise[i]]
        held = [i for i in pressing if self.follows[i] < 0]
        held += [i for i in e.active if self.follows[i] in held]  # their laws keep their rates as well
        touching = [i for i in sorted(self.frozen) if i not in held and self._touches(i, float(view.gap[i]), q)]
        closing = [i for i in touching if self._approaches(i, float(rate[i]))]
        approaching = closing if any(self.modes[i] not in ACTIVE for i in closing) else []
        still = [i for i in touching if i not in closing and rate[i] <= self.slow]
        return Touching(held, approaching, still, rate, self.modes, self.fastest)

    def _parted(self, i: int, view: View) -> Mode:
        """Where a row goes that an impulse has relieved."""
        return Mode.BALLISTIC if view.gap[i] < -self.deep else Mode.FREE

    def _collide(self, t: float, q: Floats, v: Floats, view: View, now: Touching) -> None:
        """One collision: velocities, modes, work. Rows without pressure are let go first."""
        self._collisions += 1
        if self._collisions > FEW + A_PAIR * len(self.rows) ** 2:
            raise Ended(Outcome.MODE_CYCLE, [i for i in sorted(self.frozen) if self._touches(i, float(view.gap[i]), q)])
        for i in (*now.approaching, *now.still):
            if self.modes[i] in ACTIVE:
                self._switch(t, i, self._parted(i, view))
        jump: Jump = self.rule(self.equations, t, q, v, now)
        v[:] = jump.v
        self.work += jump.work
        for i in jump.impulses:
            self._switch(t, i, Mode.COLLISION)
        for i in jump.dropped:
            if self.follows[i] < 0:
                self._switch(t, i, self._parted(i, view))
        for i, impulse in jump.impulses.items():
            self._switch(t, i, Mode.CONTACT if i in jump.captured else self._parted(i, view), impulse)
