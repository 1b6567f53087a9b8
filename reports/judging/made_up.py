"""Motions that nobody computed, of which every number is known: a truth at random, and a run that is off by draws.

The run is the truth later and later: its clock stretches between touches by drawn parts, so that every sample has its
own of the truth. Instants are spread unevenly, coordinates are of sizes from a tenth to ten and of either sign, and
nothing begins at an origin: what takes a mean for a largest, or one end of a step for both, comes out otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from crossbody.cases import Case, Coordinate, Event, Ledger, Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.case import Law
from crossbody.reports.measuring.truth import Truth

SAMPLES, CONTACTS = 30, 4
HAIR, NEAR, NEARER = 1e-4, 1e-5, 1e-2
"""Part of their instants that samples are before events; of its errors that a run begins with that stays near; and of
those of positions and velocities where touches are laid on the truth's."""
SLOW = 1e-2
"""Part of the size of positions that velocities have: they are not their rates, and lead nowhere between samples."""
NAMES = ("q", "v", "gap", "lam", "energy")


def case_of(units: Sequence[str], opens: Sequence[bool], seed: int, rubs: int = 0) -> Case:
    """Return a case without equations, of coordinates with these units and rows of which some open.

    Args:
        units: of each coordinate.
        opens: whether each row with a gap can open.
        seed: of the draw of its start.
        rubs: number of rows of friction behind them, which have no gap.
    """
    draw, rows = np.random.default_rng(seed), len(opens) + rubs
    return Case(
        name="made_up", variant=str(seed), title="", mechanism="", parameters={}, contacts=("",) * rows,
        coordinates=tuple(Coordinate(name=f"{k}", unit=unit) for k, unit in enumerate(units)),
        q0=draw.normal(size=len(units)), v0=draw.normal(size=len(units)), t_end=float(draw.uniform(0.5, 3.0)),
        law=Law(
            a0=np.full(rows, 1e4), a1=np.ones(rows), a2=np.zeros(rows), unilateral=np.array([*opens, *[True] * rubs]),
            touches=np.array([*opens, *[False] * rubs]),
        ),
    )  # fmt: skip


class MadeUp:
    """A case with a motion at random for a truth, and one for a run.

    Attributes:
        case, truth, run: as metrics take them.
        exact: the truth's samples, each beside its own of the run, at the instants `t` (n,), s.
        trusted: number of samples that may be compared.
        rubs (nc,): rows of friction, of which the run tells a touch, before all others, and the truth nothing.
    """

    def __init__(self, case: Case, seed: int, samples: int = SAMPLES) -> None:
        self.random, self.case = np.random.default_rng(seed), case
        self.rubs = case.law.unilateral & ~case.law.touches
        events = self._contacts()
        before = [(1.0 - HAIR) * e.t for e in events]  # a sample there tells how fast what brings them about is
        self.t = np.sort([0.0, *self.random.uniform(0.0, case.t_end, samples - 1), *before])
        self.exact = self._motion(self.t, events)
        until = float(self.random.uniform(max(self.knots[-1], 0.7 * case.t_end), 0.99 * case.t_end))
        self.trusted, self.run = int(np.sum(self.t <= until)), self._off()
        self.truth = Truth(
            tier=Tier.A, source="made up", trajectory=self.exact, at=self.lookup, agreement={}, trusted=until,
            touches=case.law.touches, joined=True,
        )  # fmt: skip

    @property
    def scalar(self) -> bool:
        """Whether the one coordinate is the gap of the one row."""
        return not self.case.mechanism and len(self.case.coordinates) == len(self.case.contacts) == 1

    def _off(self) -> Trajectory:
        """Return the run: the exact motion later, and off by draws."""
        random, exact, book, n = self.random, self.exact, self.exact.ledger, len(self.t)
        assert book is not None
        changed = {
            name: right + random.uniform(0.01, 0.2) * random.normal(size=right.shape)
            for name in NAMES for right in (getattr(exact, name),)
        }  # fmt: skip
        for name in ("q", "v") if self.case.law.touches.any() else ():  # by less than another clock makes of it
            right = getattr(exact, name)
            changed[name] = right + NEARER * (SLOW if name == "v" else 1.0) * (changed[name] - right)
        for at in self.case.quaternions:
            changed["q"][:, at : at + 4] /= np.linalg.norm(changed["q"][:, at : at + 4], axis=1, keepdims=True)
            changed["q"][:, at : at + 4] *= random.choice([-1.0, 1.0], (len(self.t), 1))
        if not self.case.law.unilateral.any() and not self.case.quaternions:  # beside the truth for a while
            near = int(random.integers(len(self.t) // 4, len(self.t) // 2))
            changed["q"][:near] = exact.q[:near] + NEAR * (changed["q"][:near] - exact.q[:near])
        if self.scalar:
            changed["gap"] = changed["q"]
        changed["gap"][:, self.rubs] = 0.0
        ledger = Ledger(
            contact=book.contact + 0.1 * random.normal(size=book.contact.shape),
            input=book.input + random.normal(size=n), dissipated=book.dissipated + random.normal(size=n),
        )  # fmt: skip
        events = tuple(replace(e, t=float(self.late(e.t)), impulse=1.3 * e.impulse) for e in exact.events)
        first = [replace(e, t=0.5 * e.t, contact=row) for e in events[:1] for row in np.flatnonzero(self.rubs).tolist()]
        return replace(exact, t=self.late(self.t), events=(*first, *events), ledger=ledger, **changed)

    def _motion(self, t: Floats, events: Sequence[Event]) -> Trajectory:
        """Return waves, with contacts at random and impulses that take no time."""
        random, case = self.random, self.case
        rows = len(case.law.a0)
        shapes = dict(zip(NAMES, (len(case.coordinates), len(case.velocities), rows, rows, 2), strict=True))
        made = {name: self._waves(t, width) for name, width in shapes.items()}
        made["v"] *= SLOW
        for at in case.quaternions:
            made["q"][:, at : at + 4] /= np.linalg.norm(made["q"][:, at : at + 4], axis=1, keepdims=True)
        made["gap"] = made["q"] if self.scalar else self._apart(made["gap"])
        mode = random.choice([Mode.FREE, Mode.CONTACT], (len(t), rows)).astype(np.int8)
        pulls, acts = random.uniform(0.05, 0.5, 2)
        made["lam"] *= 300.0 * np.where(made["lam"] < 0.0, pulls, 1.0) * np.where(mode == Mode.FREE, acts, 1.0)
        made["energy"] = np.abs(made["energy"])
        made["energy"][:, 1] -= 20.0
        self.knots = [0.0, *(e.t for e in events if e.before == Mode.FREE and e.after == Mode.COLLISION)]
        self.lates = np.append(0.0, np.cumsum(np.diff(self.knots) * random.uniform(0.8, 1.2, len(self.knots) - 1)))
        contact, given, lost = self._waves(t, rows), self._waves(t, 1)[:, 0], self._waves(t, 1)[:, 0]
        ledger = Ledger(contact=contact, input=given, dissipated=lost)
        return Trajectory(t=t, mode=mode, events=tuple(events), steps=len(t), ledger=ledger, **made)  # type: ignore[arg-type]

    def _contacts(self) -> list[Event]:
        """Return contacts that end, one row after the other; behind each a blow, or a way below the surface."""
        random, rows, t_end = self.random, np.flatnonzero(self.case.law.touches).tolist(), self.case.t_end
        found: list[Event] = []
        ends = np.sort(random.uniform(0.05, 0.95, 2 * CONTACTS)) * t_end
        for k, (touch, release) in enumerate(ends.reshape(-1, 2).tolist() if rows else ()):
            row, settled = rows[k % len(rows)], touch + random.uniform(0.2, 0.8) * (release - touch)
            below, left = [Mode.BALLISTIC] * (k % 2 == 0), 0.5 * (release + [*ends, t_end][2 * k + 2])
            modes = [Mode.FREE, Mode.COLLISION, Mode.CONTACT, *below, Mode.FREE]
            for t, before, after in zip((touch, settled, release, left), modes[:-1], modes[1:], strict=False):
                found.append(Event(t=t, contact=row, before=before, after=after))
            if k % 2:
                at, impulse = release + 1e-3 * t_end, float(random.uniform(1.0, 50.0))
                found.append(Event(t=at, contact=row, before=Mode.FREE, after=Mode.FREE, impulse=impulse))
        return found

    def _apart(self, gap: Floats) -> Floats:
        """Return gaps (n, nc): those of rows that open are highest, those of others deepest, and friction has none."""
        even = gap / np.abs(gap).max(axis=0, initial=1e-300) * self.random.uniform(0.5, 1.5, gap.shape[1])
        found: Floats = np.where(self.case.law.unilateral, np.where(even > 0.0, 12.0 * even, even), 4.0 * even)
        return np.where(self.rubs, 0.0, found)

    def _waves(self, t: Floats, width: int) -> Floats:
        random = self.random
        sizes, rates, phases = 10.0 ** random.uniform(-1.0, 1.0, width), *random.uniform(1.0, 9.0, (2, width))
        found: Floats = sizes * np.sin(np.multiply.outer(t / t.max(), rates) + phases)
        return found

    def late(self, t: Floats | float) -> Floats:
        """Return the run's time: straight between touches, and as long as the truth's behind the last."""
        late: Floats = np.interp(t, self.knots, self.lates) + np.maximum(np.asarray(t) - self.knots[-1], 0.0)
        return late

    def lookup(self, t: Floats) -> Trajectory:
        """Return the truth at samples of its own."""
        at = np.argmin(np.abs(self.t[:, None] - t), axis=0) if len(t) else np.zeros(0, int)
        book = self.exact.ledger
        assert book is not None
        ledger = Ledger(contact=book.contact[at], input=book.input[at], dissipated=book.dissipated[at])
        signals = {name: getattr(self.exact, name)[at] for name in ("t", *NAMES, "mode")}
        return replace(self.exact, ledger=ledger, **signals)
