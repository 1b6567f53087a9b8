"""Modes of contacts with friction, written apart from the compiled machine's rules (docs/explanation/contacts.md).

    touching -> STICK or SLIP   h <= 0 and closing, or pressing
    STICK -> SLIP               |lam_t| > mu lam_n, without what pulls the row back; or |v_t| no longer small: several
                                contacts of a body that rocks cannot all keep their places
    SLIP -> STICK               v_t . s = 0, s the direction at the step's start, and |v_t| small
    off                         lam_n < 0: FREE above the surface, BALLISTIC below it

Where several contacts may change at once all are decided together (`mode_problem`).
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from crossbody.cases import Mode, Outcome
from crossbody.reference._system import System, initial_modes
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.balance import Balance
from crossbody.reference.sundials.dying import dies_into_jam
from crossbody.reference.sundials.equations import Ended, Equations
from crossbody.reference.sundials.friction_alarms import Alarm, alarms
from crossbody.reference.sundials.level_machine import LevelMachine, View
from crossbody.reference.sundials.mode_problem import ModeProblem, Tried
from crossbody.reference.sundials.sliding import Seen, Sliding

ON = frozenset({Mode.STICK, Mode.SLIP, Mode.CONTACT})
SMALL, SMALL_STEPS = 1e-9, 10.0  # of the largest speed, and in units of rtol: a slip below has no direction of its own
STILL = 10.0  # times that: a slip that stops there, stops
GRAZE = 0.1  # of that: a slip may pass zero by so much and go on
ROUNDS = 40
WAITS = 10.0  # times as long as friction needs for a slip without a direction, after which one that goes on stands
JAMMING = 1e-2  # eigenvalue, of rows of size 1, where no step is short enough for forces that grow without bound


class FrictionMachine(LevelMachine):
    """The level machine with STICK and SLIP; see `LevelMachine`."""

    def __init__(
        self, system: System, equations: Equations, rtol: float, tolerance: float, start: tuple[Floats, Floats]
    ) -> None:  # fmt: skip
        super().__init__(system, equations)
        self.rtol, self.tolerance, self.watch = rtol, tolerance, system.watch
        self.guards_watched = system.guards if system.watch is not None else 0
        self.sliding = Sliding(system, equations, rtol)
        self.ways: dict[int, Floats] = {}
        self.begun: set[int] = set()
        self.courses: dict[int, Floats] = {}  # directions of slips where these were last clear of zero
        self.alarms: list[Alarm] = []
        self.flush: set[int] = set()  # open contacts at their surface by rounding: they touch once they have risen
        self.modes = [Mode(mode) for mode in initial_modes(system, *start).tolist()]
        self.rows = sorted({*self.rows, *self.sliding.dry})
        self._joining, self._stops, self._begins = set(self.sliding.dry), set[int](), dict[int, Floats]()
        self._stopped, self._waiting = set[int](), dict[int, float]()
        self._jams, self._jump, self._rounds, self._at, self._limit = False, True, 0, -np.inf, 0.0

    @property
    def small(self) -> float:
        """The slip velocity below which that has no direction of its own, m/s."""
        return float(max(SMALL, SMALL_STEPS * self.rtol) * self.fastest + self.tolerance)

    @property
    def still(self) -> float:
        """The slip velocity below which one that stops does so, and that a contact which sticks may have, m/s."""
        return STILL * self.small

    def contacts(self) -> list[int]:
        """The contacts that press."""
        return [i for i in self.rows if self.modes[i] in ON]

    def see(self, t: float, q: Floats, v: Floats, contacts: list[int] | None = None) -> Seen:
        """Evaluate contacts, those that press if none are named."""
        return self.sliding.see(t, q, v, self.contacts() if contacts is None else contacts)

    def direction(self, i: int, slip: Floats) -> Floats:
        """Direction of a slip velocity; near zero it turns steadily to that of reference, behind which none is."""
        own = self.ways[i]
        if slip.shape[-1] == 1:
            return np.broadcast_to(own, slip.shape)
        size = np.linalg.norm(slip, axis=-1, keepdims=True)
        ahead = slip + np.maximum(-(slip @ own)[..., None], 0.0) * own
        longer = ahead + np.maximum(self.small - np.linalg.norm(ahead, axis=-1, keepdims=True), 0.0) * own
        far = size >= self.still
        way: Floats = np.where(far, slip, longer) / np.where(far, size, np.linalg.norm(longer, axis=-1, keepdims=True))
        return way

    def weigh(self, t: float, q: Floats, v: Floats) -> tuple[Seen, Balance]:
        """Evaluate the contacts that press, and their forces."""
        seen = self.see(t, q, v)
        return seen, self.balance(seen)

    def balance(self, seen: Seen) -> Balance:
        """Forces of the contacts that press, of all that were seen."""
        on = self.contacts()
        return self.sliding.balance(
            seen.part(self.sliding.rows(on)), {i: self.modes[i] for i in on}, self._ways_of(seen)
        )

    def accelerate(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """V' (n,) and multipliers of all rows (nc,) of the present modes."""
        seen, balance = self.weigh(t, q, v)
        lam, every = balance.forces(), np.zeros(len(self.modes))
        every[seen.rows], every[self.sliding.loops] = lam, seen.own + seen.borne @ lam
        return seen.vd + seen.X @ lam, every

    def _ways_of(self, seen: Seen) -> dict[int, Floats]:
        sliding = [i for i in seen.rows if i in self.sliding.ways and self.modes[i] == Mode.SLIP]
        return {i: self.direction(i, self.sliding.slip(seen, i)) for i in sliding}

    def turning(self, t: float, q: Floats, v: Floats) -> dict[int, tuple[float, float]]:
        """Slip velocity of contacts that slide in space, and the rate at which friction turns it, m/s and 1/s."""
        seen, balance = self.weigh(t, q, v)
        lam, at, found = balance.forces(), balance.seen.at, dict[int, tuple[float, float]]()
        for i in balance.ways:
            if len(ways := self.sliding.ways[i]) > 1:
                size = max(float(np.linalg.norm(self.sliding.slip(seen, i))), self.small)
                light = max(balance.seen.G[at[t], at[t]] for t in ways)
                found[i] = size, self.sliding.mu[i] * lam[at[i]] * light / size
        return found

    def slips(self, t: float, q: Floats, v: Floats) -> dict[int, float]:
        """Slip velocities of contacts with friction, m/s."""
        rate = self.equations.gaps(t, q, v)[1] - self.sliding.drift
        return {i: float(np.linalg.norm(rate[ways])) for i, ways in self.sliding.ways.items()}

    def jamming(self, t: float, q: Floats, v: Floats) -> list[int]:
        """The contacts that slide and are about to jam, where their forces grow without bound."""
        balance = self.weigh(t, q, v)[1]
        found = {i: balance.jam(i) for i in balance.ways.keys() - self.sliding.dry}
        return sorted(i for i, values in found.items() if (np.abs(values) < JAMMING).any())

    def renew(self, q: Floats, v: Floats, t: float) -> None:
        """Take the slip velocities' directions at the end of a step for those of reference."""
        _, rate = self.equations.gaps(t, q, v)
        rate = rate - self.sliding.drift
        for i, ways in self.sliding.ways.items():
            slip = rate[ways]
            size = float(np.linalg.norm(slip))
            self.fastest = max(self.fastest, size, abs(float(rate[i])))
            if self.modes[i] == Mode.SLIP and size > self.small:
                if len(ways) > 1:
                    self.ways[i] = slip / size
                if size > self.still:
                    self.begun.discard(i)
                if size > self.still or i not in self.courses:
                    self.courses[i] = slip / size
            waits = self.modes[i] == Mode.SLIP and size <= self.small and i not in self.begun
            self._waiting = {**self._waiting, i: self._waiting.get(i, t)} if waits else {
                k: since for k, since in self._waiting.items() if k != i
            }  # fmt: skip

    def stopped(self, t: float, q: Floats, v: Floats) -> list[Alarm]:
        """The contacts whose slip has died out without passing zero, as those do whose body others hold."""
        if not self._waiting:
            return []
        turning = self.turning(t, q, v)
        fast = {i: turning.get(i, (0.0, np.inf))[1] for i in self._waiting}
        return [Alarm(i, "STOP", slice(0)) for i, since in self._waiting.items() if (t - since) * fast[i] > WAITS]

    def settle(self, t: float, q: Floats, v: Floats) -> View:
        """Decide the modes of all contacts that press or have just met, and set up what is watched.

        Raises:
            Ended: MODE_CYCLE, NO_CONSISTENT_MODES or PAINLEVE, naming the rows.
        """
        self._rounds = self._rounds + 1 if t == self._at else 0
        self._at = t
        if self._rounds > ROUNDS:
            raise Ended(Outcome.MODE_CYCLE, self.contacts())
        gap, rate = (a.copy() for a in self.equations.gaps(t, q, v))
        if not (np.isfinite(gap).all() and np.isfinite(rate).all()):
            raise Ended(Outcome.NOT_FINITE)
        self.renew(q, v, t)
        joins = self._joining | {i for i in self.rows if self._meets(i, gap, rate, self._touch(q) if t == 0.0 else 0.0)}
        if self.contacts() or joins:
            self._decide(t, q, v, joins, gap, rate)
        while joins := {i for i in self.rows if self._catches(i, t, q, v, gap, rate)}:  # what changed lets others in
            self._rounds += 1
            if self._rounds > ROUNDS:
                raise Ended(Outcome.MODE_CYCLE, sorted({*self.contacts(), *joins}))
            self._decide(t, q, v, joins, gap, rate)
        self._joining, self._stops, self._stopped, self._begins, self._jump = set(), set(), set(), {}, True
        self._jams = False
        self.redundant = self.sliding.redundant
        vd, lam = self.accelerate(t, q, v)
        self.flush = {i for i in self.rows if self.modes[i] == Mode.FREE and gap[i] <= 0.0}
        self.alarms = alarms(self, self.guards_watched)
        none = np.zeros(len(lam))
        return View(gap, rate, vd, lam, none, none, lam)

    def _decide(self, t: float, q: Floats, v: Floats, joins: set[int], gap: Floats, rate: Floats) -> None:
        """Put the contacts that press, and those that join, in modes that agree with their forces."""
        trying = sorted({*self.contacts(), *joins})
        found = self._decided(t, self.see(t, q, v, trying), joins)
        for i in trying:
            mode = found.modes[i]
            off = self.modes[i] if self.modes[i] not in ON else Mode.FREE if gap[i] > 0.0 else Mode.BALLISTIC
            if off == Mode.FREE and gap[i] <= 0.0 and (rate[i] < -self.slow or gap[i] < -self.deep):
                off = Mode.BALLISTIC
            self._become(t, i, off if mode == Mode.FREE else mode)
        for i, way in found.ways.items():
            if found.modes[i] == Mode.SLIP and (i not in self.ways or i in self._stands):
                self.ways[i] = way
                self.begun |= {i} & self._stands

    def _catches(self, i: int, t: float, q: Floats, v: Floats, gap: Floats, rate: Floats) -> bool:
        """Whether an open contact below the surface closes and would move below its law."""
        if not (self.modes[i] == Mode.BALLISTIC and gap[i] <= 0.0 and rate[i] < -self.slow):
            return False
        seen = self.see(t, q, v, sorted({*self.contacts(), i}))
        balance = self.balance(seen)
        return bool(self.above_law(seen, balance, balance.forces(), i) < 0.0)

    def _become(self, t: float, i: int, after: Mode) -> None:
        if after != self.modes[i] or i in self._stopped:  # one that turns has stopped too
            self._switch(t, i, after)
            self._stopped.discard(i)
        for way in (*self.sliding.ways.get(i, ()), *self.sliding.tied.get(i, ())):
            self.modes[way] = after
        if after != Mode.SLIP:
            self.begun.discard(i)
            self.courses.pop(i, None)

    def _meets(self, i: int, gap: Floats, rate: Floats, rounding: float) -> bool:
        """Whether an open contact stands where it may press: at its surface, or below it from the start on.

        How far above it rounding of a start may put it, `rounding`, counts as at it.
        """
        if self.modes[i] != Mode.FREE:
            return False
        return bool(gap[i] < -self.deep or (gap[i] <= rounding and rate[i] <= self.slow))

    def _decided(self, t: float, seen: Seen, joins: set[int]) -> Tried:
        """A set of modes that agrees with its forces."""
        contacts, slides = [i for i in seen.rows if i in self.rows], dict[int, Floats]()
        slips = {i: self.sliding.slip(seen, i) for i in contacts if i in self.sliding.ways}
        for i, slip in slips.items():
            size = float(np.linalg.norm(slip))
            slid = self.modes[i] == Mode.SLIP and i not in self._stops and i in self.ways
            if slid and not (self._jump and size <= self.small):
                slides[i] = self.direction(i, slip)
            elif i in joins and size > self.still:
                slides[i] = slip / size
        problem = ModeProblem(self.sliding, seen, contacts, slides, self._begins, self._jams)
        self._stands, self._limit = problem.stands, problem.limit
        found = problem.consistent()
        if found is not None:
            several = problem.others(found)
            self.told += Counter(["not_searched"] * (several is None) + ["not_unique"] * bool(several))
            self.unique_until = min(self.unique_until, t) if several else self.unique_until
            self.searched_until = min(self.searched_until, t) if several is None else self.searched_until
            return found
        ways = self._ways_of(seen) | {
            i: slip / np.linalg.norm(slip)
            for i, slip in slips.items()
            if i in joins and np.linalg.norm(slip) > self.still
        }
        modes = {i: Mode.CONTACT if i not in slips else Mode.SLIP if i in ways else Mode.STICK for i in contacts}
        jammed = (problem.jammed(modes, ways) if ways else []) or problem.pressed_in
        raise Ended(Outcome.PAINLEVE if jammed else Outcome.NO_CONSISTENT_MODES, jammed or contacts)

    def _leave_place(self, t: float, rate: Floats) -> None:
        """Let contacts slide that stick no longer, with those that are about to go as well."""
        for i in (i for i in self.sliding.ways if self.modes[i] == Mode.STICK and i not in self.sliding.dry):
            away = (rate - self.sliding.drift)[self.sliding.ways[i]]
            size = float(np.linalg.norm(away))
            if size > 0.5 * self.still:
                self._become(t, i, Mode.SLIP)
                self.ways[i] = away / size

    def _reach_bound(self, t: float, q: Floats, v: Floats, i: int, gap: Floats) -> None:
        """Let contact i slide off against the force that held it, or let go.

        Where its load and its bound vanish together, rounding tells which of them does first: one that presses by no
        more than sets of modes may be off slides in no direction.
        """
        seen, balance = self.weigh(t, q, v)
        lam, k = balance.forces(pulled=False), seen.at[i]
        force = lam[[seen.at[w] for w in self.sliding.ways[i]]]
        if i not in self.sliding.dry and lam[k] * seen.G[k, k] <= self._limit:
            self._become(t, i, Mode.FREE if gap[i] > 0.0 else Mode.BALLISTIC)
        else:
            self._begins[i] = -force / np.linalg.norm(force)

    def leave(self, i: int) -> float:
        """By how much a slip may pass zero: one that has just begun is known no better."""
        return (1.0 if i in self.begun else GRAZE) * self.small

    def above_law(self, seen: Seen, balance: Balance, lam: Floats, i: int) -> Floats:
        """By how much an open contact that was seen moves faster than its law, m/s^2, the others following theirs.

        It may stay open while it does. What it would press with if it stuck, or slid, says less: where several contacts
        follow from each other, to join alone in a mode that is not the one with all of them leads back at once.
        """
        k, others = seen.at[i], [seen.at[row] for row in balance.seen.rows]
        above: Floats = (seen.G[..., k, others] * lam).sum(axis=-1) - seen.bare[..., k] + 2.0 * self._limit
        return above

    def _watch_jams(self, t: float, q: Floats, v: Floats, fired: list[Alarm]) -> None:
        """End where a contact jams that presses alone, and whose slip dies out: others may go on without one.

        Raises:
            Ended: PAINLEVE, naming the row.
        """
        pressing = [i for i in self.contacts() if i not in self.sliding.dry]
        ending = {alarm.row for alarm in fired if alarm.tells in ("STOP", "JAM", "RELEASE")}
        if len(pressing) != 1 or not ending.issuperset(pressing):
            return
        (i,) = pressing
        if self.modes[i] != Mode.SLIP or len(self.sliding.ways[i]) == 1 or i in self.begun:
            return
        seen, balance = self.weigh(t, q, v)
        modes = {k: self.modes[k] for k in self.contacts()}
        slow = np.linalg.norm(self.sliding.slip(seen, i)) <= self.still
        if slow and dies_into_jam(self.sliding, seen, modes, balance.ways, i, self.courses.get(i, self.ways[i])):
            raise Ended(Outcome.PAINLEVE, [i])

    def apply(self, t: float, q: Floats, v: Floats, fired: list[Alarm]) -> None:
        """Note what fired; `settle` decides what follows from it."""
        gap, rate = (a.copy() for a in self.equations.gaps(t, q, v))
        self._jump = False
        self._watch_jams(t, q, v, fired)
        for alarm in fired:
            i, tells = alarm.row, alarm.tells
            if tells == "JAM":
                self._jump = self._jams = True  # whether other modes go on from here is decided with all of them
            elif tells == "RELEASE":
                self._become(t, i, Mode.FREE if gap[i] > 0.0 else Mode.BALLISTIC)
            elif tells == "LEAVE":
                self._become(t, i, Mode.FREE)
            elif tells in ("TOUCH", "CATCH"):
                self._joining.add(i)
                self._jump = True
            elif tells == "STOP":
                self._stops.add(i)
                self._stopped.add(i)
                self._jump = True
            elif tells == "AWAY" and self.modes[i] == Mode.STICK:
                self._leave_place(t, rate)
            elif tells == "CONE" and self.modes[i] == Mode.STICK:
                self._reach_bound(t, q, v, i, gap)
        self._begins = {i: way for i, way in self._begins.items() if self.modes[i] == Mode.STICK}
        if self._joining:
            self._joining |= {
                i for i in self.rows
                if self.modes[i] == Mode.FREE and rate[i] < -self.slow and abs(gap[i]) <= self._known(q)
            }  # fmt: skip
        if self._stops:
            _, all_rates = self.equations.gaps(t, q, v)
            for i, ways in self.sliding.ways.items():
                slip = np.linalg.norm(all_rates[ways] - self.sliding.drift[ways])
                if self.modes[i] == Mode.SLIP and slip <= self.still:
                    self._stops.add(i)
                    if slip <= self.small and i not in self.begun:  # rounding has one of them stop first
                        self._stopped.add(i)
