"""What is read between samples of runs, and of their events: signals, contacts and periods, of made-up ones.

Truths and runs are both read so, and by every metric: what is wrong of it would be the same on both sides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody.cases import Event, Mode, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.between import between, multipliers, period, pieces
from crossbody.cases.contacts import Contact, contacts, rates
from crossbody.reports.judging.asked import Asked, Found, unlike_by

EXACT = 1e-10
SEED = 37
PEAK = 1.0 + 9.0 / 16.0
"""Where a parabola is highest, between samples: at one of sixteen instants that are looked at there."""
FREE, CONTACT, COLLISION, BALLISTIC = Mode.FREE, Mode.CONTACT, Mode.COLLISION, Mode.BALLISTIC
Way = tuple[tuple[float, Mode], ...]
"""Instants, s, and the modes from then on; free before."""
WAYS: tuple[Way, ...] = (
    ((1.0, COLLISION), (1.2, CONTACT), (1.5, BALLISTIC), (1.7, FREE), (8.5, CONTACT)),
    ((2.0, CONTACT), (4.0, FREE), (4.5, CONTACT), (6.0, FREE), (8.0, CONTACT), (9.0, FREE)),
    ((3.0, CONTACT), (3.5, FREE)),
    ((3.0, CONTACT), (4.0, FREE)),
    ((5.0, COLLISION), (5.0, FREE), (7.0, COLLISION), (7.0, FREE)),
    ((6.0, CONTACT), (7.0, FREE)),
)
AT_SURFACE = ((8.5, 10.0), (2.0, 6.0), (0.0, 10.0), (3.0, 4.0), (5.0, 5.0), (6.0, 10.0))
"""When a row that is pressed, one that lets go without leaving, two that bear nothing, one that is struck once, and one
that rests in the end, are at their surface, s. The first one is below it while it is closed, before."""
JUMP, LOADED, NEVER = 5.0, (0, 1, 4, 5), np.inf
"""When velocities jump, s, and which rows bear something where they are closed."""
TOLD = (
    (0, 1.0, 1.5, 1.2, 1.7), (0, 8.5, NEVER, NEVER, NEVER), (1, 2.0, 4.0, NEVER, 4.0), (1, 4.5, 6.0, NEVER, 6.0),
    (1, 8.0, 9.0, NEVER, 9.0), (2, 3.0, 3.5, NEVER, 3.5), (3, 3.0, 4.0, NEVER, 4.0), (4, 5.0, 5.0, NEVER, 5.0),
    (4, 7.0, 7.0, NEVER, 7.0), (5, 6.0, 7.0, NEVER, 7.0),
)  # fmt: skip
"""Row, touch, release, hand-over and when it is free, s, of every contact."""
JOINED = (
    *TOLD[:2], (1, 2.0, 6.0, NEVER, 6.0), TOLD[4], (2, 0.0, NEVER, NEVER, NEVER), TOLD[7],
    (5, 6.0, NEVER, NEVER, NEVER),
)  # fmt: skip
"""The same where those are one between which no gap opens."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return what is another number than it must be, least and most, and of what."""
    kinds = (_signals, _lines, _pieces, _contacts, _signs, _rebounds, _periods)
    return unlike_by(kinds, "reading", "what is read of samples:", EXACT, 1.0)


def _run(t: Floats, columns: Floats, mode: Floats, lam: Floats, events: tuple[Event, ...] = ()) -> Trajectory:
    """Return a run whose positions and gaps are the same columns (n, k), and whose velocities are 2 more."""
    return Trajectory(
        t=t, q=columns, v=columns + 2.0, gap=columns, lam=lam, energy=np.column_stack([columns[:, 0], 3.0 - t]),
        mode=mode.astype(np.int8), events=events,
    )  # fmt: skip


def _apart(found: Floats, wanted: Floats) -> float:
    """Return the largest difference; infinite where sizes, or what is no number, are others."""
    if found.shape != wanted.shape or (np.isnan(found) != np.isnan(wanted)).any():
        return np.inf
    return float(np.nanmax(np.abs(found - wanted)))


def _signals() -> Iterator[Asked]:
    """Ask for cubics up to an instant that stands twice, to a mode that changes, and between two samples: a line."""
    draw, ends = np.random.default_rng(SEED), (0.0, 1.0, 2.0, 3.0, 4.0)
    counts = (7, 9, 6, 0)  # samples within each piece; the third begins with a mode that changes
    ways: tuple[Callable[[Floats], Floats], ...] = (
        lambda s: s**3 - s, lambda s: 1.0 + (2.0 - s) * s**2, lambda s: 1.0 + s * (2.0 - s), lambda s: 5.0 - s,
    )  # fmt: skip
    inner = [np.sort(draw.uniform(ends[k], ends[k + 1], n)) for k, n in enumerate(counts)]
    parts = [np.concatenate([[ends[k]] * (k != 2), inner[k], [ends[k + 1]] * (k != 1)]) for k in range(4)]
    parts[2] = np.append(ends[2], parts[2])
    t, piece = np.concatenate(parts), np.repeat(np.arange(4), [len(part) for part in parts])
    values = np.concatenate([way(part) for way, part in zip(ways, parts, strict=True)])
    mode = np.repeat((piece == 2)[:, None], 2, axis=1)
    shown = np.sort(np.concatenate([draw.uniform(0.0, 4.0, 60), [1.0, 1.0, 2.0, 3.0, 3.0]]))
    twice = np.append(False, shown[1:] == shown[:-1])
    of = np.clip(np.where(twice, np.searchsorted(ends, shown, "right"), np.searchsorted(ends, shown, "left")) - 1, 0, 3)
    wanted = np.array([ways[k](s) for k, s in zip(of, shown, strict=True)])
    run = _run(t, np.column_stack([values, 2.0 * values]), mode, np.column_stack([values, 1.0 + 0.0 * t]))
    found = between(run)(shown)
    for name, one in (("positions", found.q), ("velocities", found.v - 2.0), ("gaps", found.gap)):
        yield name, "a run of pieces", _apart(one, np.column_stack([wanted, 2.0 * wanted])), 0.0
    yield "multipliers", "a run of pieces", _apart(found.lam[:, 0], wanted), 0.0
    yield "energies", "a run of pieces", _apart(found.energy, np.column_stack([wanted, 3.0 - shown])), 0.0
    yield "modes", "a run of pieces", _apart(found.mode[:, 0].astype(float), (of == 2).astype(float)), 0.0
    unknown = replace(run, lam=np.full((len(t), 2), np.nan))
    yield "positions", "a run of pieces", _apart(between(unknown)(shown).q[:, 0], wanted), 0.0
    yield "multipliers", "a run that tells none", float(multipliers(unknown) is None), 1.0
    every = multipliers(replace(run, lam=np.column_stack([3.0 - 2.0 * t, t])))
    yield "multipliers", "a line", np.inf if every is None else float(np.ptp(every[:, 0])), float(np.ptp(2.0 * t))
    t = np.arange(4.0)
    bend = 1.0 - (t[:, None] - PEAK) ** 2
    risen = multipliers(_run(t, bend, np.ones((4, 1)), bend))
    yield "multipliers", "a parabola", np.inf if risen is None else float(risen.max()), 1.0


def _lines() -> Iterator[Asked]:
    """Ask for straight lines where nothing is known of events."""
    t, shown = np.array([0.0, 1.0, 1.5, 3.0]), np.array([0.25, 1.2, 2.0, 2.9])
    column = np.array([[1.0], [3.0], [-2.0], [4.0]])
    run = _run(t, column, np.full((4, 1), -1), column)
    wanted = np.array([[1.5], [1.0], [0.0], [3.6]])
    yield "positions", "a run without modes", _apart(between(run)(shown).q, wanted), 0.0


def _pieces() -> Iterator[Asked]:
    found = pieces(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 1.0, 1.0, 1.5, 2.0, 2.5]))
    yield "pieces", "instants", _apart(found.astype(float), np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0])), 0.0


def _closing() -> Trajectory:
    """Return the run of `WAYS`, sampled every twentieth of a second, and where velocities jump on both sides."""
    t = np.sort(np.append(np.linspace(0.0, 10.0, 201), JUMP))
    behind = np.cumsum(np.append(False, t[1:] == t[:-1]))
    mode, gap = np.zeros((len(t), len(WAYS))), np.full((len(t), len(WAYS)), 0.3)
    events = []
    for row, (way, (first, last)) in enumerate(zip(WAYS, AT_SURFACE, strict=True)):
        before: Mode = FREE
        for at, after in way:
            events.append(Event(t=at, contact=row, before=before, after=after))
            mode[t >= at, row], before = int(after), after
        gap[(t >= first - 1e-9) & (t <= last + 1e-9), row] = 0.0
    gap[(t > 1.0) & (t < 1.7), 0] = -0.2
    lam = np.where((mode == CONTACT) | (mode == COLLISION), 2.0, 0.0)
    lam[:, [row for row in range(len(WAYS)) if row not in LOADED]] = 0.0
    return Trajectory(
        t=t, q=t[:, None], v=1.0 + behind[:, None], gap=gap, lam=lam, energy=np.column_stack([t, t]),
        mode=mode.astype(np.int8), events=tuple(sorted(events, key=lambda e: e.t)),
    )  # fmt: skip


def _told(found: tuple[Contact, ...], wanted: tuple[tuple[float, ...], ...]) -> float:
    """Return by how much contacts are off; infinite where they are others."""
    mine = sorted((c.row, c.touch, c.release, c.settled, c.free) for c in found)
    a, b = (np.where(np.isinf(each), np.nan, each) for each in (mine, sorted(wanted)))
    return _apart(a, b)


def _contacts() -> Iterator[Asked]:
    """Ask for the contacts of all rows, and of some."""
    run, some = _closing(), np.array([True, False, False, False, True, False])
    yield "contacts", "rows that close", _told(contacts(run), TOLD), 0.0
    yield "contacts", "rows that close, joined", _told(contacts(run, joined=True), JOINED), 0.0
    few = tuple(one for one in TOLD if some[int(one[0])])
    yield "contacts", "some rows that close", _told(contacts(run, some), few), 0.0


def _signs() -> Iterator[Asked]:
    """Ask for the contacts of a run without modes: by the signs of its gaps, on straight lines."""
    t = np.array([0.0, 1.0, 3.0, 4.0, 6.0, 7.0])
    gap = np.array([[1.0, 3.0], [-3.0, 2.0], [1.0, 1.0], [3.0, -3.0], [-1.0, -1.0], [-2.0, -2.0]])
    run = _run(t, gap, np.full(gap.shape, -1), gap)
    wanted = ((0, 0.25, 2.5, NEVER, NEVER), (0, 5.5, NEVER, NEVER, NEVER), (1, 3.25, NEVER, NEVER, NEVER))
    yield "contacts", "gaps that change their signs", _told(contacts(run), wanted), 0.0


def _rebounds() -> Iterator[Asked]:
    """Ask for the rates of a gap where contacts begin and end: of one coordinate, and of two, which have none."""
    t = np.linspace(0.0, 4.0, 9)
    column = np.abs(t - 2.0)[:, None] - 0.7
    ways = ((1.25, FREE, CONTACT), (2.75, CONTACT, FREE), (3.75, FREE, CONTACT))
    events = tuple(Event(t=s, contact=0, before=a, after=b) for s, a, b in ways)
    found = rates(_run(t, column, 0.0 * column, column, events))
    yield "rates", "a gap", _apart(np.array([one[1:] for one in found]), np.array([[2.05, 2.05]])), 0.0
    both = np.hstack([column, column])
    yield "rates", "two gaps", float(len(rates(_run(t, both, 0.0 * both, both, events)))), 0.0


def _periods() -> Iterator[Asked]:
    """Ask for the period of what is straight between samples: from the first upward crossing to the last."""
    t, x = np.arange(6.0), np.array([-1.0, 3.0, -2.0, 2.0, -3.0, 1.0])
    yield "period", "lines", period(t, x) or 0.0, 2.25
    yield "period", "two crossings", float(period(t[:4], x[:4]) is None), 1.0
