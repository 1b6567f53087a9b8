"""Which contacts stick, slide and let go where several may change at once, apart from the compiled rules.

All that stand stick, then all that is violated changes, then what a projected Gauss-Seidel method converges to is
taken, then sets that differ in few contacts. Directions in which contacts begin to slide are those of their
accelerations, by SciPy's root finder.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice, product

import numpy as np

from crossbody.cases import Mode
from crossbody.reference.kinds import Array, Floats
from crossbody.reference.sundials.balance import Balance
from crossbody.reference.sundials.equations import ULP
from crossbody.reference.sundials.sliding import Seen, Sliding

AGREES = 1e-10  # part of the largest acceleration by which a set of modes may be off
NOTHING = 1e-6  # part of what dry friction may accelerate a row by, below which nothing drives it
SWEEPS = 3000
MOST_SETS = 4096
STAYS = 1e-7  # part of the largest acceleration, below which what begins to slide goes nowhere
JAMMED = 1e-9  # eigenvalue, of rows of size 1, below which forces press no row
CLEAR = 1e-5  # likewise, of what goes on where others have come to a jam
OTHERS = 64  # sets of modes, which are all tried to see whether another one agrees as well
AROUND = 16  # directions of one contact from which its slip is looked for, for all that stand together
OTHERWISE = 1e-6  # part of the largest acceleration by which other motions differ
FAR = 1e6  # times what one row alone would ask for: sweeps that lead there diverge
SETTLED = 1e-14  # part of the largest multiplier by which the last sweep changes any
OPEN = 0.5  # part of what rows that depend on each other may be off their laws, where modes are decided
WITHIN = 1e-7  # part of its bound by which a force must stay below it to count as that of a contact that sticks


@dataclass(slots=True)
class Tried:
    """A set of modes with its directions of slip, forces, and by how much faster than their laws rows move."""

    modes: dict[int, Mode]
    ways: dict[int, Floats]
    lam: Floats
    excess: Floats


class ModeProblem:
    """The contacts that press, or may, at one instant.

    Args:
        sliding: what evaluates sets of their modes.
        seen: their rows.
        contacts: those that are asked about.
        slides: directions of those that slide on; all others with friction stand.
        begins: directions of those that have reached their bounds.
        jams: whether some have just come to a jam.

    Attributes:
        pressed_in: contacts that jam in one of the sets that were tried, where none agrees.
    """

    def __init__(
        self, sliding: Sliding, seen: Seen, contacts: list[int], slides: dict[int, Floats], begins: dict[int, Floats],
        jams: bool,
    ) -> None:  # fmt: skip
        self.sliding, self.seen, self.slides, self.begins, self.jams = sliding, seen, slides, begins, jams
        self.stands = {i for i in contacts if i in sliding.ways} - slides.keys()
        self.modes = {i: self._pressed(i, slides) for i in contacts}
        self.pressed_in = list[int]()
        self._strict = False
        held = [sliding.mu[i] * seen.G[seen.at[i], seen.at[i]] for i in sliding.dry.intersection(contacts)]
        self.scale = float(max(np.abs(seen.bare).max(initial=0.0), NOTHING * max(held, default=0.0)))
        self.limit = AGREES * self.scale

    def consistent(self) -> Tried | None:
        """A set of modes that agrees with its forces, None if none is found."""
        modes = {**self.modes, **dict.fromkeys(self.begins, Mode.SLIP)}
        ways = {**self.slides, **self.begins}
        found = self._pivoted(modes, ways) or self._swept(modes, ways) or self._searched(modes)
        if found is not None and self._strays(found) > OTHERWISE * self.scale:
            self._strict = True
            met = self._pivoted(modes, ways) or self._swept(modes, ways)
            found, self._strict = met or found, met is not None
        if found is not None and (still := self._going_nowhere(found)):
            held = {i: Mode.STICK if i in still else mode for i, mode in found.modes.items()}
            tried = self._tried(held, {i: way for i, way in found.ways.items() if i not in still})
            if self._holds(tried):
                found = tried
        return found

    def others(self, found: Tried) -> bool | None:
        """Whether another set agrees with its forces as well and moves otherwise; None if there are too many to try."""
        if not any(i in self.sliding.ways and i not in self.sliding.dry for i in self.modes) or self._one_motion():
            return False  # where no bound of friction grows with a load the motion is that of least constraint
        if math.prod(len(self._choices(i, np.ones(1))) for i in self.modes) > OTHERS:
            return None
        turns = np.exp(2j * np.pi * np.linspace(0.0, 1.0, AROUND // max(len(self.stands), 1), endpoint=False))
        return any(
            np.abs(tried.excess - found.excess).max() > OTHERWISE * self.scale and self._holds(tried)
            for tried in (self._tried(modes, ways) for modes, ways in self._sets(turns))
        )

    def _sets(self, turns: Array) -> Iterator[tuple[dict[int, Mode], dict[int, Floats]]]:
        """All sets of modes, with directions from which slips that begin are looked for: what drives them, turned."""
        for one in product(*(self._choices(i, turns) for i in self.modes)):
            modes = dict(zip(self.modes, (mode for mode, _ in one), strict=True))
            yield modes, {i: way for i, (mode, way) in zip(self.modes, one, strict=True) if mode == Mode.SLIP}

    def _choices(self, i: int, turns: Array) -> list[tuple[Mode, Floats]]:
        """The modes that contact i may have; see `_sets`."""
        nothing = np.zeros(0)
        if i not in self.sliding.ways:
            return [(Mode.CONTACT, nothing), (Mode.FREE, nothing)]
        off = [] if i in self.sliding.dry else [(Mode.FREE, nothing)]
        if i in self.slides:
            return [(Mode.SLIP, self.slides[i]), *off]
        aim, weight = self._aim(i), np.diag(self.seen.G)[self._along(i)]
        ways, moves = [aim, -aim], weight > ULP * weight.max(initial=0.0)
        if len(aim) > 1 and moves.sum() == 1:  # what moves in a plane slips along one line
            ways = [moves.astype(float), -moves.astype(float)]
        elif len(aim) > 1:
            ways = [turn.real * aim + turn.imag * aim[::-1] * [-1.0, 1.0] for turn in turns]
        return [(Mode.STICK, nothing), *((Mode.SLIP, way) for way in ways), *off]

    def _one_motion(self) -> bool:
        """Whether friction is too little, beside by how much rows of size 1 differ, for a second motion of any kind."""
        balance = self._balance({i: self._pressed(i, self.slides) for i in self.modes}, self.slides)
        A, size, count = balance.A, balance.size, balance.unknowns.count
        if not 0 < count < len(A):  # no normal rows, or none that stands: then friction has its direction
            return bool((np.linalg.eigvalsh(0.5 * (A + A.T)) > OTHERWISE).all())
        friction = max((float(self.sliding.mu[i]) for i in self.stands - self.sliding.dry), default=0.0)
        most = friction * size[count:].max() / size[:count].min() * np.linalg.norm(A[count:], 2)
        return bool(np.linalg.eigvalsh(0.5 * (A + A.T))[0] > most + OTHERWISE)

    def jammed(self, modes: Mapping[int, Mode], ways: Mapping[int, Floats]) -> list[int]:
        """The contacts that slide and jam, with others or alone."""
        balance, found = self._balance(modes, ways), list[int]()
        for i in (i for i in ways if modes[i] == Mode.SLIP and i not in self.sliding.dry):
            values = balance.jam(i)
            real = values.real[np.abs(values.imag) <= ULP * np.abs(values)]
            if not (real > (CLEAR if self.jams else JAMMED)).all():
                found.append(i)
        return sorted(found)

    def _balance(self, modes: Mapping[int, Mode], ways: Mapping[int, Floats]) -> Balance:
        part = self.seen.part([row for row in self.seen.rows if modes[self.sliding.owner[row]] != Mode.FREE])
        return self.sliding.balance(part, modes, {i: way for i, way in ways.items() if modes[i] == Mode.SLIP})

    def _pressed(self, i: int, ways: Mapping[int, Floats]) -> Mode:
        """The mode of a contact that presses."""
        return Mode.CONTACT if i not in self.sliding.ways else Mode.SLIP if i in ways else Mode.STICK

    def _holds(self, tried: Tried) -> bool:
        return not self._violated(tried) and not self.jammed(tried.modes, tried.ways)

    def _going_nowhere(self, found: Tried) -> set[int]:
        """The contacts that would begin to slide, though others hold them where they are."""
        begin = {i for i in self.stands if found.modes[i] == Mode.SLIP} - self.begins.keys() - self.sliding.dry
        return {i for i in begin if np.linalg.norm(found.excess[self._along(i)]) <= STAYS * self.scale}

    def _along(self, i: int) -> list[int]:
        """Places of the tangential rows of contact i."""
        return [self.seen.at[t] for t in self.sliding.ways.get(i, ())]

    def _tried(self, modes: dict[int, Mode], ways: dict[int, Floats]) -> Tried:
        """Evaluate a set; contacts that begin to slide do so where their own accelerations go."""
        free = [i for i in ways if i in self.stands and len(ways[i]) > 1 and modes[i] == Mode.SLIP]

        def turned(angles: Floats) -> dict[int, Floats]:
            return {**ways, **{i: np.array([np.cos(a), np.sin(a)]) for i, a in zip(free, angles, strict=True)}}

        def aside(angles: Floats) -> Floats:
            if not np.isfinite(angles).all():  # where no direction agrees the search runs away
                return np.full(len(free), self.scale)
            tried = self._solved(modes, turned(angles))
            return np.array([self._across(tried, i) for i in free])

        found = self._solved(modes, dict(ways))
        if free and max(abs(self._across(found, i)) for i in free) > self.limit:
            from scipy.optimize import root  # which takes longer to import than a short run

            start = np.array([np.arctan2(ways[i][1], ways[i][0]) for i in free])
            angles = root(aside, start, tol=1e-13).x
            found = self._solved(modes, turned(angles)) if np.isfinite(angles).all() else found
        return found

    def _solved(self, modes: dict[int, Mode], ways: dict[int, Floats]) -> Tried:
        """Evaluate a set as it is, some of whose contacts may be off."""
        balance, lam = self._balance(modes, ways), np.zeros(len(self.seen.rows))
        lam[[self.seen.at[row] for row in balance.seen.rows]] = balance.forces(pulled=False)
        return Tried(modes, ways, lam, self.seen.G @ lam - self.seen.bare)

    def _across(self, tried: Tried, i: int) -> float:
        a, b = (tried.excess[k] for k in self._along(i))
        way = tried.ways[i]
        return float(way[0] * b - way[1] * a)

    def _violated(self, tried: Tried) -> dict[int, tuple[float, Mode]]:
        """By how much contacts violate their modes, m/s^2, and the modes that they would rather have."""
        found: dict[int, tuple[float, Mode]] = {}
        apart = self._contradict(tried)
        for i, mode in tried.modes.items():
            k, heavy = self.seen.at[i], self.seen.G[self.seen.at[i], self.seen.at[i]]
            if mode == Mode.FREE:
                off = [
                    (-tried.excess[k], self._pressed(i, {j: w for j, w in tried.ways.items() if j not in self.stands}))
                ]
            else:
                off = [(-tried.lam[k] * heavy, Mode.FREE)] if i not in self.sliding.dry else [(-1.0, mode)]
                if apart and i not in self.sliding.dry:
                    off.append((float(tried.excess[k]), Mode.FREE))
                ways = self._along(i)
                if mode == Mode.STICK:
                    force = float(np.linalg.norm(tried.lam[ways]))
                    bound = max(self.sliding.bound(self.seen, tried.lam, i), 0.0)
                    off.append(((force - bound) * heavy, Mode.SLIP))
                    strict = i in self.sliding.dry or self._strict or not self.seen.G[ways, ways].all()
                    moved = self._off_stick(tried, i) if strict else 0.0
                    off.append((moved if moved > OTHERWISE * self.scale else 0.0, Mode.SLIP))  # by rows it depends on
                elif mode == Mode.SLIP and i in self.stands:
                    off.append((-float(tried.ways[i] @ tried.excess[ways]), Mode.STICK))
                    if len(ways) > 1:
                        off.append((abs(self._across(tried, i)), Mode.STICK))
            worst = max(off, key=lambda one: one[0])
            if worst[0] > self.limit:
                found[i] = worst
        return found

    def _off_stick(self, tried: Tried, i: int) -> float:
        """By how much faster than its law contact i moves, which sticks."""
        return float(np.linalg.norm(tried.excess[self._along(i)]))

    def _strays(self, tried: Tried) -> float:
        """The most by which contacts that stick, and depend on each other, cannot all do so."""
        return max((self._off_stick(tried, i) for i, mode in tried.modes.items() if mode == Mode.STICK), default=0.0)

    def _contradict(self, tried: Tried) -> bool:
        """Whether contacts that press depend on each other, and cannot all follow their laws."""
        places = [self.seen.at[i] for i, mode in tried.modes.items() if mode != Mode.FREE and i not in self.sliding.dry]
        return bool((np.abs(tried.excess) > OPEN * self.seen.allowed)[places].any())

    def _pivoted(self, modes: dict[int, Mode], ways: dict[int, Floats], alone: bool = False) -> Tried | None:
        """Change what is violated, all of it or the worst alone, until nothing is; None where sets come again."""
        known: set[tuple[Mode, ...]] = set()
        modes, ways = dict(modes), dict(ways)
        while tuple(modes.values()) not in known:
            known.add(tuple(modes.values()))
            tried = self._tried(modes, ways)
            wrong = self._violated(tried)
            if not wrong:
                return None if self.jammed(tried.modes, tried.ways) else tried
            ways, modes = dict(tried.ways), dict(modes)
            for i in [max(wrong, key=lambda i: wrong[i][0])] if alone else list(wrong):
                modes[i] = wrong[i][1]
                if modes[i] == Mode.SLIP and i in self.stands:
                    along = self._along(i)
                    drive, other = -tried.lam[along], tried.excess[along]
                    if i in self.sliding.dry:
                        drive, other = other, drive
                    drive = drive if drive.any() else other
                    ways[i] = drive / np.linalg.norm(drive)
        return None

    def _searched(self, modes: dict[int, Mode]) -> Tried | None:
        """Try sets by the number of contacts in which they differ from those given; none of many contacts."""
        jam, sets = list[int](), list(islice(self._sets(np.array([1.0, -1.0])), MOST_SETS))
        for one, ways in sorted(sets, key=lambda other: sum(other[0][i] != modes[i] for i in modes)):
            tried = self._tried(one, ways)
            if self._holds(tried):
                return tried
            jam = jam or self.jammed(tried.modes, tried.ways)
        self.pressed_in = jam
        return None

    def _aim(self, i: int) -> Floats:
        """Direction in which what acts drives contact i along its surface."""
        drive = -self.seen.bare[self._along(i)]
        size = float(np.linalg.norm(drive))
        return drive / size if size > 0.0 else np.eye(len(drive))[0]

    def _swept(self, modes: dict[int, Mode], ways: dict[int, Floats]) -> Tried | None:
        """Begin at what projected Gauss-Seidel converges to."""
        seen, own = self.seen, np.diag(self.seen.G)
        fixed = {i: way for i, way in ways.items() if i not in self.stands}
        lam = self._sweep(modes, fixed)
        if lam is None:
            return None
        excess, found, ways = seen.G @ lam - seen.bare, dict(modes), dict(fixed)
        for i in modes:
            along = self._along(i)
            size, bound = float(np.linalg.norm(lam[along])), self.sliding.bound(seen, lam, i)
            if lam[seen.at[i]] * own[seen.at[i]] <= self.limit and i not in self.sliding.dry:
                found[i] = Mode.FREE
            elif i in self.stands and size < (1.0 - WITHIN) * bound:
                found[i] = Mode.STICK
            elif i in self.stands:
                found[i], moved = Mode.SLIP, float(np.linalg.norm(excess[along]))
                ways[i] = excess[along] / moved if moved > self.limit else -lam[along] / size
        return self._pivoted(found, ways) or self._pivoted(found, ways, alone=True)

    def _sweep(self, modes: Mapping[int, Mode], fixed: Mapping[int, Floats]) -> Floats | None:
        """Forces by projected Gauss-Seidel; None where friction presses further in: it jams."""
        seen, own, lam = self.seen, np.diag(self.seen.G), np.zeros(len(self.seen.rows))
        for _ in range(SWEEPS):
            before = lam.copy()
            for i in modes:
                k = seen.at[i]
                if i not in self.sliding.dry:
                    lam[k] = max(0.0, lam[k] + (seen.bare[k] - seen.G[k] @ lam) / own[k])
                for row in self.sliding.tied.get(i, ()):
                    c = seen.at[row]
                    lam[c] += (seen.bare[c] - seen.G[c] @ lam) / own[c]
                along, bound = self._along(i), self.sliding.bound(seen, lam, i)
                if i in fixed:
                    lam[along] = -bound * fixed[i]
                elif along and own[along].any():
                    step = lam[along] + (seen.bare[along] - seen.G[along] @ lam) / own[along].max()
                    size = float(np.linalg.norm(step))
                    lam[along] = step * (bound / size) if size > bound else step
            if np.abs(lam - before).max() <= SETTLED * np.abs(lam).max():
                break
            if not np.abs(lam).max() < FAR * np.abs(seen.bare).max() / own[own > 0.0].min():
                return None
        return lam
