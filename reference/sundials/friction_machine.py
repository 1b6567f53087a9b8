"""Modes of contacts with friction, written apart from the compiled machine's rules (spec 7.2, 7.3).

    touching -> STICK or SLIP   h <= 0 and closing, or pressing
    STICK -> SLIP               |lam_t| > mu lam_n, without what pulls the row back; or |v_t| no longer small: several
                                contacts of a body that rocks cannot all keep their places
    SLIP -> STICK               v_t . s = 0, s the direction at the step's start, and |v_t| small
    off                         lam_n < 0: FREE above the surface, BALLISTIC below it

Where several contacts may change at once all are decided together: all that stand stick, then all that is violated
changes, then what a projected Gauss-Seidel method converges to is taken. Directions in which contacts begin to slide
are those of their accelerations, by SciPy's root finder.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice, product

import numpy as np
from scipy.optimize import root

from crossbody.cases import Mode, Outcome
from crossbody.reference._system import System, initial_modes
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.equations import ULP, Ended, Equations
from crossbody.reference.sundials.level_machine import LevelMachine, View
from crossbody.reference.sundials.sliding import Seen, Sliding

ON = frozenset({Mode.STICK, Mode.SLIP, Mode.CONTACT})
SMALL, SMALL_STEPS = 1e-9, 10.0  # of the largest speed, and in units of rtol: a slip below has no direction of its own
STILL = 10.0  # times that: a slip that stops there, stops
GRAZE = 0.1  # of that: a slip may pass zero by so much and go on
AGREES = 1e-10  # part of the largest acceleration by which a set of modes may be off
ROUNDS, SWEEPS = 40, 3000
MOST_SETS = 4096
STAYS = 1e-7  # part of the largest acceleration, below which what begins to slide goes nowhere
WAITS = 10.0  # times as long as friction needs for a slip without a direction, after which one that goes on stands
JAMMING = 1e-2  # likewise, where no step is short enough for forces that grow without bound
JAMMED = 1e-9  # eigenvalue, of rows of size 1, below which forces press no row
CLEAR = 1e-5  # likewise, of what goes on where others have come to a jam
FAR = 1e6  # times what one row alone would ask for: sweeps that lead there diverge
SETTLED = 1e-14  # part of the largest multiplier by which the last sweep changes any
WITHIN = 1e-7  # part of its bound by which a force must stay below it to count as that of a contact that sticks


@dataclass(frozen=True, slots=True)
class Alarm:
    """A guard: a contact, what it tells (`RELEASE`, ...), and where its terms stand."""

    row: int
    tells: str
    terms: slice
    armed: bool = True


@dataclass(slots=True)
class Tried:
    """A set of modes with its directions of slip, forces, and by how much faster than their laws rows move."""

    modes: dict[int, Mode]
    ways: dict[int, Floats]
    lam: Floats
    excess: Floats


class FrictionMachine(LevelMachine):
    """The level machine with STICK and SLIP; see `LevelMachine`."""

    def __init__(
        self, system: System, equations: Equations, rtol: float, tolerance: float, start: tuple[Floats, Floats]
    ) -> None:  # fmt: skip
        super().__init__(system, equations)
        self.rtol, self.tolerance, self.watch, self.system = rtol, tolerance, system.watch, system
        self.sliding = Sliding(system, equations)
        self.ways: dict[int, Floats] = {}
        self.begun: set[int] = set()
        self.alarms: list[Alarm] = []
        self.modes = [Mode(mode) for mode in initial_modes(system, *start).tolist()]
        self.rows = sorted({*self.rows, *self.sliding.dry})
        self._joining, self._stops, self._begins = set(self.sliding.dry), set[int](), dict[int, Floats]()
        self._stopped, self._waiting = set[int](), dict[int, float]()
        self._jams, self._jump, self._rounds, self._at, self._limit = False, True, 0, -np.inf, 0.0

    @property
    def small(self) -> float:
        """The slip velocity below which that has no direction of its own, m/s."""
        return float(max(SMALL, SMALL_STEPS * self.rtol) * self.fastest + self.tolerance)

    def contacts(self) -> list[int]:
        """The contacts that press."""
        return [i for i in self.rows if self.modes[i] in ON]

    def see(self, t: float, q: Floats, v: Floats, contacts: list[int] | None = None) -> Seen:
        """Evaluate contacts, those that press if none are named."""
        return self.sliding.see(t, q, v, self.contacts() if contacts is None else contacts)

    def direction(self, i: int, slip: Floats) -> Floats:
        """Direction of a slip velocity; near zero it turns steadily to that of reference, behind which none is."""
        own, size = self.ways[i], float(np.linalg.norm(slip))
        if len(slip) == 1:
            return own
        if size >= STILL * self.small:
            return slip / size
        slip = slip + max(-float(slip @ own), 0.0) * own
        longer = slip + max(self.small - float(np.linalg.norm(slip)), 0.0) * own
        way: Floats = longer / np.linalg.norm(longer)
        return way

    def accelerate(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """V' (n,) and multipliers of all rows (nc,) of the present modes."""
        seen = self.see(t, q, v)
        lam = self.sliding.forces(seen, self._modes_of(seen), self._ways_of(seen))
        every = np.zeros(len(self.modes))
        every[seen.rows] = lam
        return seen.vd + seen.X @ lam, every

    def _modes_of(self, seen: Seen) -> dict[int, Mode]:
        return {i: self.modes[i] for i in seen.rows if i in self.rows}

    def _ways_of(self, seen: Seen) -> dict[int, Floats]:
        sliding = [i for i in seen.rows if i in self.sliding.ways and self.modes[i] == Mode.SLIP]
        return {i: self.direction(i, self.sliding.slip(seen, i)) for i in sliding}

    def turning(self, t: float, q: Floats, v: Floats) -> dict[int, tuple[float, float]]:
        """Slip velocity of contacts that slide in space, and the rate at which friction turns it, m/s and 1/s."""
        seen, found = self.see(t, q, v), dict[int, tuple[float, float]]()
        lam = self.sliding.forces(seen, self._modes_of(seen), self._ways_of(seen))
        for i in seen.rows:
            if len(ways := self.sliding.ways.get(i, [])) > 1 and self.modes[i] == Mode.SLIP:
                size = max(float(np.linalg.norm(self.sliding.slip(seen, i))), self.small)
                light = max(seen.G[seen.at[t], seen.at[t]] for t in ways)
                found[i] = size, self.sliding.mu[i] * lam[seen.at[i]] * light / size
        return found

    def jamming(self, t: float, q: Floats, v: Floats) -> list[int]:
        """The contacts that slide and are about to jam, where their forces grow without bound."""
        seen = self.see(t, q, v)
        modes, ways = self._modes_of(seen), self._ways_of(seen)
        found = {i: self.sliding.jam(seen, modes, ways, i) for i in ways.keys() - self.sliding.dry}
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
                if size > STILL * self.small:
                    self.begun.discard(i)
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

    # --- the mode problem ------------------------------------------------------------------------------------------

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
        joins = self._joining | {i for i in self.rows if self._meets(i, gap, rate, q)}
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
        self._set_alarms(t, q, v)
        none = np.zeros(len(lam))
        return View(gap, rate, vd, lam, none, none, lam)

    def _decide(self, t: float, q: Floats, v: Floats, joins: set[int], gap: Floats, rate: Floats) -> None:
        """Put the contacts that press, and those that join, in modes that agree with their forces."""
        trying = sorted({*self.contacts(), *joins})
        found = self._decided(self.see(t, q, v, trying), joins)
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
        closing = self.modes[i] == Mode.BALLISTIC and gap[i] <= 0.0 and rate[i] < -self.slow
        return closing and self._above_law(i, t, q, v) < 0.0

    def _become(self, t: float, i: int, after: Mode) -> None:
        if after != self.modes[i] or i in self._stopped:  # one that turns has stopped too
            self._switch(t, i, after)
            self._stopped.discard(i)
        for way in (*self.sliding.ways.get(i, ()), *self.sliding.tied.get(i, ())):
            self.modes[way] = after
        if after != Mode.SLIP:
            self.begun.discard(i)

    def _meets(self, i: int, gap: Floats, rate: Floats, q: Floats) -> bool:
        """Whether an open contact stands where it may press: at its surface, or below it from the start on."""
        if self.modes[i] != Mode.FREE:
            return False
        return bool(gap[i] < -self.deep or (gap[i] <= 0.0 and rate[i] <= self.slow))

    def _decided(self, seen: Seen, joins: set[int]) -> Tried:
        """A set of modes that agrees with its forces."""
        found = self._consistent(seen, joins)
        if found is not None:
            return found
        slips = {i: self.sliding.slip(seen, i) for i in self.sliding.ways if i in seen.at}
        fast = STILL * self.small
        ways = self._ways_of(seen) | {
            i: slip / np.linalg.norm(slip) for i, slip in slips.items() if i in joins and np.linalg.norm(slip) > fast
        }
        modes = {i: self._pressed(i, ways) for i in seen.rows if i in self.rows}
        jammed = self._jammed(seen, modes, ways) if ways else []
        raise Ended(Outcome.PAINLEVE if jammed else Outcome.NO_CONSISTENT_MODES, jammed or list(modes))

    def _consistent(self, seen: Seen, joins: set[int]) -> Tried | None:
        """A set of modes that agrees with its forces, None if none is found."""
        contacts, ways = [i for i in seen.rows if i in self.rows], dict[int, Floats]()
        self._stands: set[int] = set()
        for i in contacts:
            if i not in self.sliding.ways:
                continue
            slip = self.sliding.slip(seen, i)
            size = float(np.linalg.norm(slip))
            slides = self.modes[i] == Mode.SLIP and i not in self._stops and i in self.ways
            slides = slides and not (self._jump and size <= self.small)
            if slides or (i in joins and size > STILL * self.small):
                ways[i] = self.direction(i, slip) if slides else slip / size
            else:
                self._stands.add(i)
        modes = {i: self._pressed(i, ways) for i in contacts}
        for i, way in self._begins.items():
            modes[i], ways[i] = Mode.SLIP, way
        scale = float(np.abs(seen.bare).max(initial=0.0))
        self._limit = limit = AGREES * scale
        found = self._pivoted(seen, modes, ways, limit) or self._swept(seen, modes, ways, limit)
        found = found or self._searched(seen, modes, ways, limit)
        if found is not None and (still := self._going_nowhere(seen, found, STAYS * scale)):
            held = {i: Mode.STICK if i in still else mode for i, mode in found.modes.items()}
            tried = self._tried(seen, held, {i: way for i, way in found.ways.items() if i not in still}, limit)
            if not self._violated(seen, tried, limit) and not self._jammed(seen, tried.modes, tried.ways):
                found = tried
        return found

    def _going_nowhere(self, seen: Seen, found: Tried, limit: float) -> set[int]:
        """The contacts that would begin to slide, though others hold them where they are."""
        begin = {i for i in self._stands if found.modes[i] == Mode.SLIP} - self._begins.keys() - self.sliding.dry
        moved = {i: np.linalg.norm(found.excess[[seen.at[t] for t in self.sliding.ways[i]]]) for i in begin}
        return {i for i, size in moved.items() if size <= limit}

    def _pressed(self, i: int, ways: Mapping[int, Floats]) -> Mode:
        """The mode of a contact that presses."""
        return Mode.CONTACT if i not in self.sliding.ways else Mode.SLIP if i in ways else Mode.STICK

    def _tried(self, seen: Seen, modes: dict[int, Mode], ways: dict[int, Floats], limit: float) -> Tried:
        """Evaluate a set; contacts that begin to slide do so where their own accelerations go."""
        free = [i for i in ways if i in self._stands and len(ways[i]) > 1 and modes[i] == Mode.SLIP]

        def solved(ways: dict[int, Floats]) -> Tried:
            lam = self._forces(seen, modes, ways)
            return Tried(modes, ways, lam, seen.G @ lam - seen.bare)

        def aside(angles: Floats) -> Floats:
            turned = {**ways, **{i: np.array([np.cos(a), np.sin(a)]) for i, a in zip(free, angles, strict=True)}}
            tried = solved(turned)
            return np.array([self._across(seen, tried, i) for i in free])

        found = solved(dict(ways))
        if free and max(abs(self._across(seen, found, i)) for i in free) > limit:
            start = np.array([np.arctan2(ways[i][1], ways[i][0]) for i in free])
            angles = root(aside, start, tol=1e-13).x
            found = solved(ways | {i: np.array([np.cos(a), np.sin(a)]) for i, a in zip(free, angles, strict=True)})
        return found

    def _forces(self, seen: Seen, modes: Mapping[int, Mode], ways: Mapping[int, Floats]) -> Floats:
        """Multipliers of a set, some of whose contacts may be off."""
        part, lam = self._part(seen, modes), np.zeros(len(seen.rows))
        sliding = {i: way for i, way in ways.items() if modes[i] == Mode.SLIP}
        lam[[seen.at[row] for row in part.rows]] = self.sliding.forces(part, modes, sliding, pulled=False)
        return lam

    def _part(self, seen: Seen, modes: Mapping[int, Mode]) -> Seen:
        """Only the rows of contacts that press in a set of modes."""
        keep = [k for k, row in enumerate(seen.rows) if modes[self._contact_of(row)] != Mode.FREE]
        return Seen(
            [seen.rows[k] for k in keep], {seen.rows[k]: j for j, k in enumerate(keep)}, seen.G[np.ix_(keep, keep)],
            seen.bare[keep], seen.pull[keep], seen.rate[keep], seen.X[:, keep], seen.vd,
        )  # fmt: skip

    def _contact_of(self, row: int) -> int:
        leader = self.follows[row]
        return row if leader < 0 else leader

    def _across(self, seen: Seen, tried: Tried, i: int) -> float:
        a, b = (tried.excess[seen.at[t]] for t in self.sliding.ways[i])
        way = tried.ways[i]
        return float(way[0] * b - way[1] * a)

    def _violated(self, seen: Seen, tried: Tried, limit: float) -> dict[int, tuple[float, Mode]]:
        """By how much contacts violate their modes, m/s^2, and the modes that they would rather have."""
        found: dict[int, tuple[float, Mode]] = {}
        for i, mode in tried.modes.items():
            k, heavy = seen.at[i], seen.G[seen.at[i], seen.at[i]]
            if mode == Mode.FREE:
                off = [
                    (-tried.excess[k], self._pressed(i, {j: w for j, w in tried.ways.items() if j not in self._stands}))
                ]
            else:
                off = [(-tried.lam[k] * heavy, Mode.FREE)] if i not in self.sliding.dry else [(-1.0, mode)]
                ways = [seen.at[t] for t in self.sliding.ways.get(i, ())]
                if mode == Mode.STICK:
                    force = float(np.linalg.norm(tried.lam[ways]))
                    off.append(((force - max(self.sliding.bound(seen, tried.lam, i), 0.0)) * heavy, Mode.SLIP))
                elif mode == Mode.SLIP and i in self._stands:
                    off.append((-float(tried.ways[i] @ tried.excess[ways]), Mode.STICK))
                    if len(ways) > 1:
                        off.append((abs(self._across(seen, tried, i)), Mode.STICK))
            worst = max(off, key=lambda one: one[0])
            if worst[0] > limit:
                found[i] = worst
        return found

    def _pivoted(
        self, seen: Seen, modes: dict[int, Mode], ways: dict[int, Floats], limit: float, alone: bool = False
    ) -> Tried | None:
        """Change what is violated, all of it or the worst alone, until nothing is; None where sets come again."""
        known: set[tuple[Mode, ...]] = set()
        modes, ways = dict(modes), dict(ways)
        while tuple(modes.values()) not in known:
            known.add(tuple(modes.values()))
            tried = self._tried(seen, modes, ways, limit)
            wrong = self._violated(seen, tried, limit)
            if not wrong:
                return None if self._jammed(seen, tried.modes, tried.ways) else tried
            ways = dict(tried.ways)
            changing = [max(wrong, key=lambda i: wrong[i][0])] if alone else list(wrong)
            modes = dict(modes)
            for i in changing:
                modes[i] = wrong[i][1]
                if modes[i] == Mode.SLIP and i in self._stands:
                    force = tried.lam[[seen.at[t] for t in self.sliding.ways[i]]]
                    ways[i] = -force / np.linalg.norm(force)
        return None

    def _jammed(self, seen: Seen, modes: Mapping[int, Mode], ways: Mapping[int, Floats]) -> list[int]:
        """The contacts that slide and jam, with others or alone."""
        part, sliding = self._part(seen, modes), {i: way for i, way in ways.items() if modes[i] == Mode.SLIP}
        found = list[int]()
        for i in sliding.keys() - self.sliding.dry:
            values = self.sliding.jam(part, modes, sliding, i)
            real = values.real[np.abs(values.imag) <= ULP * np.abs(values)]
            if not (real > (CLEAR if self._jams else JAMMED)).all():
                found.append(i)
        return sorted(found)

    def _searched(self, seen: Seen, modes: dict[int, Mode], ways: dict[int, Floats], limit: float) -> Tried | None:
        """Try sets by the number of contacts in which they differ from those given; none of many contacts."""
        choices = [
            sorted({self._pressed(i, {}) if i in self._stands else modes[i], Mode.SLIP, Mode.FREE} - {modes[i]})
            if i in self.sliding.ways and i not in self.sliding.dry else [] for i in modes
        ]  # fmt: skip
        sets = [dict(zip(modes, one, strict=True)) for one in islice(
            product(*([mode, *other] for mode, other in zip(modes.values(), choices, strict=True))), MOST_SETS
        )]  # fmt: skip
        for one in sorted(sets, key=lambda one: sum(one[i] != modes[i] for i in modes)):
            aims = {i: ways.get(i, self._aim(seen, i)) for i in one if one[i] == Mode.SLIP}
            for sign in (1.0, -1.0):
                turned = {i: way * (sign if i in self._stands else 1.0) for i, way in aims.items()}
                tried = self._tried(seen, dict(one), turned, limit)
                if not self._violated(seen, tried, limit) and not self._jammed(seen, tried.modes, tried.ways):
                    return tried
        return None

    def _aim(self, seen: Seen, i: int) -> Floats:
        """Direction in which what acts drives contact i along its surface."""
        drive = -seen.bare[[seen.at[t] for t in self.sliding.ways[i]]]
        size = float(np.linalg.norm(drive))
        return drive / size if size > 0.0 else np.eye(len(drive))[0]

    def _swept(self, seen: Seen, modes: dict[int, Mode], ways: dict[int, Floats], limit: float) -> Tried | None:
        """Begin at what projected Gauss-Seidel converges to."""
        lam, own = np.zeros(len(seen.rows)), np.diag(seen.G)
        fixed = {i: way for i, way in ways.items() if i not in self._stands}
        for _ in range(SWEEPS):
            before = lam.copy()
            for i in modes:
                k = seen.at[i]
                if i not in self.sliding.dry:
                    lam[k] = max(0.0, lam[k] + (seen.bare[k] - seen.G[k] @ lam) / own[k])
                for row in self.sliding.tied.get(i, ()):
                    c = seen.at[row]
                    lam[c] += (seen.bare[c] - seen.G[c] @ lam) / own[c]
                along = [seen.at[t] for t in self.sliding.ways.get(i, ())]
                bound = self.sliding.bound(seen, lam, i)
                if i in fixed:
                    lam[along] = -bound * fixed[i]
                elif along:
                    step = lam[along] + (seen.bare[along] - seen.G[along] @ lam) / own[along].max()
                    size = float(np.linalg.norm(step))
                    lam[along] = step * (bound / size) if size > bound else step
            if np.abs(lam - before).max() <= SETTLED * np.abs(lam).max():
                break
            if not np.abs(lam).max() < FAR * np.abs(seen.bare).max() / own[own > 0.0].min():
                return None  # friction presses further in: it jams
        excess, found, ways = seen.G @ lam - seen.bare, dict(modes), dict(fixed)
        for i in modes:
            along = [seen.at[t] for t in self.sliding.ways.get(i, ())]
            size, bound = float(np.linalg.norm(lam[along])), self.sliding.bound(seen, lam, i)
            if lam[seen.at[i]] * own[seen.at[i]] <= limit and i not in self.sliding.dry:
                found[i] = Mode.FREE
            elif i in self._stands and size < (1.0 - WITHIN) * bound:
                found[i] = Mode.STICK
            elif i in self._stands:
                found[i], moved = Mode.SLIP, float(np.linalg.norm(excess[along]))
                ways[i] = excess[along] / moved if moved > limit else -lam[along] / size
        return self._pivoted(seen, found, ways, limit) or self._pivoted(seen, found, ways, limit, alone=True)

    # --- what is watched -------------------------------------------------------------------------------------------

    def _set_alarms(self, t: float, q: Floats, v: Floats) -> None:
        """List what may fire until the next event, in the order of `values`."""
        self.alarms, count = [], 0

        def add(i: int, tells: str, terms: int, armed: bool = True) -> None:
            nonlocal count
            self.alarms.append(Alarm(i, tells, slice(count, count + terms), armed))
            count += terms

        for i in self.rows:
            mode = self.modes[i]
            if mode == Mode.FREE:
                add(i, "TOUCH", 2)
            elif mode == Mode.BALLISTIC:
                add(i, "LEAVE", 1)
                add(i, "CATCH", 2)
            else:
                dry = i in self.sliding.dry
                if not dry:
                    add(i, "RELEASE", 1)
                if mode == Mode.STICK:
                    add(i, "CONE", 1)
                    if not dry:
                        add(i, "AWAY", 1)
                elif mode == Mode.SLIP:
                    add(i, "STOP", 2)
                    if not dry:
                        add(i, "JAM", 1)
        for k in range(self.system.guards if self.watch is not None else 0):
            add(k, "WATCH", 1, armed=False)

    def values(self, t: float, q: Floats, v: Floats) -> Floats:
        """All terms of the alarms at a state."""
        gap, rate = (a.copy() for a in self.equations.gaps(t, q, v))
        seen = self.see(t, q, v)
        modes, ways = self._modes_of(seen), self._ways_of(seen)
        lam = self.sliding.forces(seen, modes, ways)
        bare = self.sliding.forces(seen, modes, ways, pulled=False) if Mode.STICK in modes.values() else lam
        watched = np.zeros(self.system.guards)
        if self.watch is not None and len(watched):
            self.watch(t, q, v, self.equations.p, watched)
        found: list[float] = []
        for alarm in self.alarms:
            i, tells = alarm.row, alarm.tells
            if tells == "TOUCH":
                found += [gap[i], rate[i]]
            elif tells == "LEAVE":
                found.append(-gap[i])
            elif tells == "CATCH":
                found += [rate[i], self._above_law(i, t, q, v)]
            elif tells == "RELEASE":
                found.append(lam[seen.at[i]])
            elif tells == "CONE":
                force = np.linalg.norm(bare[[seen.at[w] for w in self.sliding.ways[i]]])
                found.append(self.sliding.bound(seen, bare, i) - float(force))
            elif tells == "AWAY":
                found.append(STILL * self.small - float(np.linalg.norm(self.sliding.slip(seen, i))))
            elif tells == "STOP":
                slip = self.sliding.slip(seen, i)
                near = float(np.linalg.norm(slip)) - STILL * self.small if len(slip) > 1 else -1.0
                found += [float(slip @ self.ways[i]) + self._leave(i), near]
            elif tells == "JAM":
                found.append(float(np.prod(self.sliding.jam(seen, modes, ways, i)).real) - 0.5 * JAMMED)
            else:
                found.append(watched[i])
        return np.array(found)

    def _leave_place(self, t: float, rate: Floats) -> None:
        """Let contacts slide that stick no longer, with those that are about to go as well."""
        for i in (i for i in self.sliding.ways if self.modes[i] == Mode.STICK and i not in self.sliding.dry):
            away = (rate - self.sliding.drift)[self.sliding.ways[i]]
            size = float(np.linalg.norm(away))
            if size > 0.5 * STILL * self.small:
                self._become(t, i, Mode.SLIP)
                self.ways[i] = away / size

    def _leave(self, i: int) -> float:
        """By how much a slip may pass zero: one that has just begun is known no better."""
        return (1.0 if i in self.begun else GRAZE) * self.small

    def _above_law(self, i: int, t: float, q: Floats, v: Floats) -> float:
        """By how much an open contact moves faster than its law, m/s^2, the others following theirs.

        It may stay open while it does. What it would press with if it stuck, or slid, says less: where several contacts
        follow from each other, to join alone in a mode that is not the one with all of them leads back at once.
        """
        seen, modes = self.see(t, q, v, sorted({*self.contacts(), i})), dict[int, Mode]()
        for k in self.rows:
            if k in seen.at:
                modes[k] = self.modes[k] if k != i else Mode.FREE
        part, ways = self._part(seen, modes), self._ways_of(seen)
        lam = self.sliding.forces(part, modes, ways)
        k = seen.at[i]
        others = [seen.at[row] for row in part.rows]
        return float(seen.G[k, others] @ lam - seen.bare[k]) + 2.0 * self._limit

    def apply(self, t: float, q: Floats, v: Floats, fired: list[Alarm]) -> None:
        """Note what fired; `settle` decides what follows from it."""
        gap, rate = (a.copy() for a in self.equations.gaps(t, q, v))
        self._jump = False
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
                seen = self.see(t, q, v)
                lam = self.sliding.forces(seen, self._modes_of(seen), self._ways_of(seen), pulled=False)
                force = lam[[seen.at[w] for w in self.sliding.ways[i]]]
                self._begins[i] = -force / np.linalg.norm(force)
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
                if self.modes[i] == Mode.SLIP and slip <= STILL * self.small:
                    self._stops.add(i)
                    if slip <= self.small and i not in self.begun:  # rounding has one of them stop first
                        self._stopped.add(i)
