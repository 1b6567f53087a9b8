"""The level machine in plain Python: the check on the compiled one.

    FREE -> active        h <= 0 and (h' < 0 or h < 0)
    active -> BALLISTIC   lam < 0, h <= 0         active -> FREE        lam < 0, h > 0
    BALLISTIC -> FREE     h > 0                   BALLISTIC -> active   h <= 0, h' < 0, lam would be > 0
    COLLISION -> CONTACT  max(b1, sqrt(b0)) |h'| + b0 |h| <= eps lam_i / (G_A^-1)_ii and lam_i > 0

h' counts as zero below 1e-9 of the largest rate seen, and both h' and lam below what rounding makes of them. A gap
below -1e-9 m that does not close was started in penetration: it is active if it would press, else BALLISTIC.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from crossbody.cases import Event, Mode, Outcome
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.compiled.guards import LIFTED
from crossbody.reference.sundials.compiled.workspace import Kind
from crossbody.reference.sundials.equations import ACTIVE, ULP, Ended, Equations
from crossbody.reference.sundials.sharing import CONSISTENT, Sharing, parted, rank, share

SLOW, DEEP = 1e-9, 1e-9
TOUCH = 64.0 * ULP  # of the largest position, at least 1: a gap this small is closed
SAME_INSTANT = 8.0 * ULP
CLOSE = 1e-12  # part of the time within which rows of one body let go together
SIDES = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))  # |x| + |y| <= z: so for each choice of signs
SAME_CHANGE = 1e-9  # part by which changes of v' may differ and count as equal


class Watch(IntEnum):
    """What a guard of a row is for."""

    SWITCH = 0
    """FREE: touch. Active: release. BALLISTIC: leave."""
    OTHER = 1
    """BALLISTIC: catch. COLLISION: hand-over."""


@dataclass(frozen=True, slots=True)
class Term:
    """One smooth function of the state: `kind` of a row (or the number of a `watch` function), plus `shift`.

    `noise` is what rounding makes of it; `sides` are the signs of h' and h in a hand-over.
    """

    kind: Kind
    row: int
    shift: float = 0.0
    noise: float = 0.0
    sides: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Guard:
    """It fires where all of its terms are at or below zero; `watch` is None for one of the mechanism's own."""

    row: int
    watch: Watch | None
    terms: list[Term]


@dataclass(slots=True)
class View:
    """Everything the machine asks for at one instant; all (nc,) but vd (n,).

    Attributes:
        alone: multipliers that the rows which hold all others would have without them.
    """

    gap: Floats
    rate: Floats
    vd: Floats
    lam: Floats
    noise: Floats
    size: Floats
    alone: Floats


class LevelMachine:
    """Modes of all rows and the transitions made so far.

    Attributes:
        modes: of every row.
        events: transitions in order.
        frozen: rows whose collisions take no time; none in this machine.
        guards: of all rows, as the last `settle` left them.
        deep: depth beyond which a gap that does not close was started in penetration, m.
        work (nc,): done by the impulses of every row so far, J.
        error: of the integrator's state along a step; times a0 it moves the multiplier of a row that has just let go.
        rtol: of positions; rows that close touch together where it cannot tell which comes first.
    """

    def __init__(self, system: System, equations: Equations) -> None:
        self.equations, self.error, self.rtol = equations, 0.0, 0.0
        self.follows = np.asarray(system.follows).tolist()
        self.switching = np.asarray(system.unilateral, dtype=bool).tolist()
        self.rows = [i for i in range(system.nc) if self.switching[i] and self.follows[i] < 0]
        self.modes: list[Mode] = [Mode.BILATERAL if held else Mode.FREE for held in system.held]
        self.events: list[Event] = []
        self.frozen: frozenset[int] = frozenset()
        self.work = np.zeros(system.nc)
        self.deep = DEEP
        self.fastest = self._rounding = 0.0
        self._instant = -np.inf
        self._seen: set[tuple[int, ...]] = set()
        self._one_by_one = self._alone = False
        self.guards: list[Guard] = []
        self.sharing: Sharing | None = None
        self._kept: Sharing | None = None
        self.spent: set[int] = set()
        self._all_spent, self._shared = set[int](), -np.inf
        self.tied: dict[int, float] = {}
        self._lifted: dict[int, float] = {}
        self.redundant, self.told, self.unique_until, self.searched_until = 0, Counter[str](), np.inf, np.inf
        self._bilateral = [i for i in range(system.nc) if not self.switching[i] and self.modes[i] in ACTIVE]
        self._may_share = len(self.rows) > 1 and max(self.follows, default=-1) < 0

    @property
    def slow(self) -> float:
        """The rate below which a gap stands still: a part of the fastest one seen, and no less than rounding."""
        return max(SLOW * self.fastest, self._rounding)

    def _active_mode(self, i: int) -> Mode:
        return Mode.COLLISION if self.equations.fast[i, 0] > 0.0 else Mode.CONTACT

    @staticmethod
    def _touch(q: Floats) -> float:
        """How large a gap rounding alone can make of a touch, m."""
        return TOUCH * max(1.0, float(np.abs(q).max()))

    def _touches(self, i: int, h: float, q: Floats) -> bool:
        """Whether gap i is closed."""
        return h <= 0.0

    def _known(self, q: Floats) -> float:
        """To what a gap is known, as far as the tolerance of the positions tells."""
        return self.rtol * float(np.abs(q).max())

    def _approaches(self, i: int, rate: float) -> bool:
        """Whether gap i closes."""
        return rate < -self.slow

    def _activate(self, modes: list[Mode], joins: Sequence[int] = ()) -> None:
        """Put a mode set in force, less the rows that others hold; `joins` are on trial."""
        for i, leader in enumerate(self.follows):
            if leader >= 0:
                modes[i] = modes[leader]
        if self.sharing is None:
            self.equations.activate(modes)
        else:
            self.equations.activate(modes, {*range(len(modes))}.difference(self.sharing.basis, joins))
            if not joins:
                self.equations.beside = self.sharing.beside

    def _share(self, t: float, q: Floats, v: Floats) -> list[int]:
        """Find how the rows in contact hold each other where some depend on others; those that have to let go."""
        self.sharing = None
        if abs(t - self._shared) > CLOSE * abs(t):  # rows that are spent one right behind another are so together
            self._all_spent.clear()
        self._all_spent |= self.spent
        self._shared, self.spent, spent = t, set(), self._all_spent
        contact = [i for i in self.rows if self.modes[i] in ACTIVE] if self._may_share else []
        if not contact or self.frozen:
            return []
        self._activate(self.modes)
        found = share(self.equations, t, q, v, contact, self._bilateral, spent)
        if found is None:
            return [i for i in contact if i in spent]
        if not found.lifted:
            self.sharing = found
            self.redundant = max(self.redundant, len(contact) + len(self._bilateral) - len(found.basis))
        return found.lifted

    def look(self, t: float, q: Floats, v: Floats) -> View:
        """Evaluate the present mode set."""
        e = self.equations
        self._activate(self.modes)
        gap, rate = (a.copy() for a in e.gaps(t, q, v))
        if not (np.isfinite(gap).all() and np.isfinite(rate).all()):
            raise Ended(Outcome.NOT_FINITE)
        self.fastest = max([self.fastest, *(abs(float(rate[i])) for i in self.rows)])
        if self.rows:  # where bodies slide along each other, their gaps hardly move at all
            self._rounding = 8.0 * ULP * float((np.abs(e.held(t, q, v, self.rows)[1]) @ np.abs(v)).max())
        noise, size = e.noise(t, q, v, self.fastest, self._disagreement(q))
        vd, lam = e.accelerate(t, q, v)
        if e.beside is None:
            return View(gap, rate, vd, lam, noise, size, lam)
        shared = e.share(t, q, v, lam)
        return View(gap, rate, vd, shared, np.full(len(lam), noise.max()), np.full(len(lam), size.max()), lam)

    def _disagreement(self, q: Floats) -> float:
        """By how much gaps of rows that share a load disagree by rounding: chance has which of them hold the rest."""
        return 0.0 if self.sharing is None else self._touch(q)

    def pressure(self, i: int, t: float, q: Floats, v: Floats, error: float = 0.0) -> tuple[float, float]:
        """Multiplier of row i if it were active now, and its noise; -inf if ill posed. `error` is that of `noise`."""
        if i in self.tied:
            return self._beyond_law(i, t, q, v), 0.0
        trial = list(self.modes)
        trial[i] = self._active_mode(i)
        self._activate(trial, [i])
        try:
            noise, _ = self.equations.noise(t, q, v, error=error + self._disagreement(q))
            _, lam = self.equations.accelerate(t, q, v)
            return float(lam[i]), float(noise[i])
        except Ended:
            return -np.inf, 0.0
        finally:
            self._activate(self.modes)

    def _beyond_law(self, i: int, t: float, q: Floats, v: Floats) -> float:
        """By how much row i is below its law, m/s^2, where the active rows determine it; one that is at it counts.

        But not just after it was lifted off, or rounding would choose where a load is about to leave a row.
        """
        e = self.equations
        vd, _ = e.accelerate(t, q, v)
        with e._selected([i]):
            H, h, Hdv = e.rows(t, q, v)
            a0, a1, a2 = e.law[i]
            terms = np.array([H[0] @ vd, Hdv[0], a1 * (H[0] @ v), (a0 + a2 * h[0] ** 2) * h[0]])
        open_for = (t - self.tied[i]) * max(a0**0.5, a1)
        band = CONSISTENT * np.abs(terms).sum()
        return float((band if open_for > LIFTED else -band) - terms.sum())

    def contradicts(self, t: float, q: Floats, v: Floats) -> bool:
        """Whether rows that share the load of others cannot follow their laws with these any more."""
        if self.sharing is None or not self.sharing.beside or self.sharing == self._kept:
            return False
        vd, _ = self.equations.accelerate(t, q, v)
        if not parted(self.equations, t, q, v, self.sharing.beside, vd.copy()):
            return False
        self._kept = self.sharing  # if that is what is decided again, nothing else is to come of it
        return True

    def _presses(self, i: int, h: float, t: float, q: Floats, v: Floats) -> bool:
        """Whether row i would push if it were active now."""
        lam, noise = self.pressure(i, t, q, v)
        return lam > noise

    def _wanted(self, i: int, view: View, t: float, q: Floats, v: Floats) -> Mode:
        """Where row i belongs at this instant."""
        mode, h, rate = self.modes[i], float(view.gap[i]), float(view.rate[i])
        closing = self._approaches(i, rate)

        def presses() -> bool:
            return self._presses(i, h, t, q, v)

        if mode in ACTIVE:  # of rows that share a load `share` tells which let go
            pulls = self.sharing is None and view.lam[i] < -view.noise[i]
            return self._released(i, h) if pulls else mode
        if not self._touches(i, h, q) or (h > 0.0 and mode != Mode.FREE):
            return Mode.FREE
        if closing and i in self.frozen:
            return mode  # it collides
        if mode != Mode.FREE and not (i in self.frozen and h >= -self.deep):
            return self._active_mode(i) if closing and presses() else mode
        if closing:
            return self._active_mode(i)
        if h < -max(self.deep, self._known(q)):
            return self._active_mode(i) if presses() else Mode.BALLISTIC
        return self._active_mode(i) if rate <= self.slow and presses() else mode

    def _released(self, i: int, h: float) -> Mode:
        if h > 0.0:
            return Mode.FREE
        return Mode.COLLISION_SEPARATION if self.modes[i] == Mode.COLLISION else Mode.BALLISTIC

    def _switch(self, t: float, i: int, after: Mode, impulse: float = 0.0) -> None:
        self.events.append(Event(t=t, contact=i, before=self.modes[i], after=after, impulse=impulse))
        self.modes[i] = after

    def _repeats(self, t: float) -> bool:
        """Note the mode set; whether it stood here at this instant before."""
        if abs(t - self._instant) > SAME_INSTANT * abs(t):
            self._instant, self._one_by_one, self._alone = t, False, False
            self._seen.clear()
        now = tuple(self.modes)
        known = now in self._seen
        self._seen.add(now)
        return known

    def settle(self, t: float, q: Floats, v: Floats) -> View:
        """Switch until nothing changes; only frozen collisions change v, in place.

        Raises:
            Ended: MODE_CYCLE naming the rows, or what the equations raise.
        """
        view = self._switch_rows(t, q, v)
        self._arm(view, t, q, v)
        return view

    def _switch_rows(self, t: float, q: Floats, v: Floats) -> View:
        """All rows together, judged by one mode set; only the strongest once a mode set has repeated.

        Where rows that join together depend on each other all go back, and join one after another: what is left closes
        by itself.
        """
        changed: set[int] = set()
        settled: list[Mode] = []
        events = len(self.events)
        self._repeats(t)
        while True:
            try:
                lifted = self._share(t, q, v)
                for i in lifted:
                    self._lifted[i] = t
                    self._switch(t, i, self._released(i, float(self.equations.gaps(t, q, v)[0][i])))
                changed.update(lifted)
                if lifted:
                    continue
                self._tie(t, q, v)
                view = self.look(t, q, v)
            except Ended as error:
                if error.outcome is not Outcome.ILL_POSED or not settled or self._alone:
                    raise
                self.modes[:], settled, self._one_by_one, self._alone = settled, [], True, True
                del self.events[events:]
                continue
            settled, events = list(self.modes), len(self.events)
            wanted = {i: after for i in self.rows if (after := self._wanted(i, view, t, q, v)) != self.modes[i]}
            if self._one_by_one and len(wanted) > 1:
                wanted = {i: wanted[i] for i in self._strongest(wanted, t, q, v)}
            for i, after in wanted.items():
                self._switch(t, i, after)
            changed.update(wanted)
            if not wanted:
                return view
            if self._repeats(t):
                if self._one_by_one:
                    if self._alone:
                        self.look(t, q, v)  # raises where the set that stands again is that of the dependent rows
                    raise Ended(Outcome.MODE_CYCLE, sorted(changed))
                self._one_by_one = True
                self._seen.clear()
                changed.clear()

    def _tie(self, t: float, q: Floats, v: Floats) -> None:
        """Find the open rows below the surface that depend on the active ones."""
        self.tied = {}
        open_ = [i for i in self.rows if self.modes[i] in (Mode.BALLISTIC, Mode.COLLISION_SEPARATION)]
        if not self._may_share or not open_ or self.frozen:
            return
        self._activate(self.modes)
        active = list(self.equations.active)
        M, H = self.equations.held(t, q, v, [*active, *open_])
        A = np.linalg.solve(np.linalg.cholesky(M), H.T).T
        A /= np.maximum(np.linalg.norm(A, axis=1), np.finfo(float).tiny)[:, None]  # one that moves nothing is 0
        held = A[: len(active)]
        self.tied = {
            i: self._lifted.get(i, -np.inf)
            for i, row in zip(open_, A[len(active) :], strict=True)
            if rank(np.vstack([held, row])) <= len(held)
        }

    def _strongest(self, wanted: dict[int, Mode], t: float, q: Floats, v: Floats) -> list[int]:
        """The rows that change v' most, first all that only change their name: their order does not choose."""
        sizes = {
            i: self._change_of_acceleration(i, t, q, v) if self.modes[i] in ACTIVE or after in ACTIVE else np.inf
            for i, after in wanted.items()
        }
        found = [i for i, size in sizes.items() if size >= max(sizes.values()) * (1.0 - SAME_CHANGE)]
        return found[:1] if self._alone else found

    def _change_of_acceleration(self, i: int, t: float, q: Floats, v: Floats) -> float:
        """Square of the difference that row i makes to v', in the norm of the mass matrix."""
        found = []
        for mode in (Mode.FREE, self.modes[i] if self.modes[i] in ACTIVE else self._active_mode(i)):
            trial = list(self.modes)
            trial[i] = mode
            self._activate(trial, [i])
            try:
                found.append(self.equations.accelerate(t, q, v)[0].copy())
            except Ended:
                return 0.0
            finally:
                self._activate(self.modes)
        difference = found[1] - found[0]
        return float(difference @ self.equations.terms(t, q, v)[0] @ difference)

    def fire(self, t: float, q: Floats, v: Floats, fired: Iterable[tuple[int, Watch]]) -> bool:
        """Apply what was located, never deciding it again from a value at round-off; whether anything switched."""
        gap, rate = (a.copy() for a in self.equations.gaps(t, q, v))
        self._repeats(t)
        before = len(self.events)
        for i, watch in dict(fired).items():
            mode = self.modes[i]
            if watch == Watch.OTHER:
                self._switch(t, i, Mode.CONTACT if mode == Mode.COLLISION else self._active_mode(i))
            elif mode in ACTIVE and self.sharing is not None:
                self.spent.add(i)  # others may carry on for it
            elif mode in ACTIVE:
                self._switch(t, i, self._released(i, float(gap[i])))
            else:
                self._switch(t, i, self._active_mode(i) if mode == Mode.FREE else Mode.FREE)
        if any(event.before == Mode.FREE for event in self.events[before:]):  # others may touch at the same instant
            known = self._known(q)
            for i in self.rows:
                closes = self.modes[i] == Mode.FREE and i not in self.frozen and rate[i] < -self.slow
                if closes and abs(gap[i]) <= known:
                    self._switch(t, i, self._active_mode(i))
        return len(self.events) > before or bool(self.spent)

    def move(self, t: float, modes: list[Mode]) -> None:
        """Take over the modes that the mechanism's `switch` wants."""
        for i, after in enumerate(modes):
            if after != self.modes[i] and i in self.rows:
                self._switch(t, i, after)

    def _arm(self, view: View, t: float, q: Floats, v: Floats) -> None:
        """Set up the guards that hold until the next event."""
        self.guards = [guard for i in self.rows for guard in self._guards(i, view, t, q, v)]

    def _guards(self, i: int, view: View, t: float, q: Floats, v: Floats) -> list[Guard]:
        mode, touch = self.modes[i], self._touch(q)
        closed, frozen = view.gap[i] <= touch, i in self.frozen
        # The rate's own zero is the place; one that stands still there already must close first. So must a gap that has
        # just opened, whose next values round to either side; a gap that was open cannot close without a rate below 0.
        still = view.rate[i] <= self.slow or (frozen and mode != Mode.FREE)
        closing = Term(Kind.RATE, i, self.slow if still and (closed or mode != Mode.FREE) else 0.0)
        if mode in ACTIVE and self.sharing is not None and i not in (*self.sharing.basis, *self.sharing.beside):
            return []  # others hold it
        if mode in ACTIVE:
            lam, noise = float(view.lam[i]), float(view.noise[i])
            band = max(noise, noise - lam) if lam <= noise else 0.0  # one that starts as zero fires on rounding
            released = Guard(i, Watch.SWITCH, [Term(Kind.FORCE, i, band, noise)])
            if mode != Mode.COLLISION:
                return [released]
            return [released, Guard(i, Watch.OTHER, [Term(Kind.SPENT, i, sides=sides) for sides in SIDES])]
        if mode == Mode.FREE:
            # A collision may leave so little speed that the gap never opens by more than rounding: it is at rest again
            # where it turns back, not at a zero that rounding has put anywhere. Opened by `touch`, it is open.
            opened = 2.0 * touch if frozen and closed else 0.0
            return [Guard(i, Watch.SWITCH, [Term(Kind.GAP, i, -opened), closing])]
        catch = [closing]
        if not frozen:
            lam, band = self.pressure(i, t, q, v, self.error)  # likewise: one that has just let go is at zero
            catch.append(Term(Kind.PRESS, i, band if abs(lam) <= band else 0.0))
        # One that was let go at its touch while it closes is at zero: what rounds to above it does not open.
        sinks = -touch <= view.gap[i] and view.rate[i] < -self.slow
        return [Guard(i, Watch.SWITCH, [Term(Kind.BELOW, i, touch if sinks else 0.0)]), Guard(i, Watch.OTHER, catch)]
