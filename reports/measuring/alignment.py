"""A run laid beside the truth: events are matched first, the arcs between them compared.

A shift of an impact by 2 ms costs 2 v0 in a raw difference of velocities although nothing else is
wrong. So the run's clock is stretched, linearly between matched touches, until they stand at the
truth's instants, wherever that brings the motions nearer (`measuring.laid`); how far they were off is a
number of its own (metric event_times).
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.contacts import Contact
from crossbody.cases.defaults import shortest
from crossbody.cases.remembered import remembered
from crossbody.cases.trajectory import Mode, Trajectory
from crossbody.reports.measuring.laid import Laid, nearest, straight

if TYPE_CHECKING:
    from crossbody.reports.measuring.truth import Truth

_Pairs = list[tuple[Contact, Contact]]


def matched(truth: Truth, run: Trajectory) -> _Pairs:
    """Contacts of truth and run, each row's in order, as far as the truth is trusted; by the truth's touches.

    Where a row has more of them in one, those are left out without which the others are shifted least. In which order
    rows touch does not matter: of those that touch together rounding decides which is first.
    """
    theirs, mine = (_by_row(truth.contacts(motion)) for motion in (truth.trajectory, run))
    pairs = [
        pair for row, known in theirs.items()
        for pair in _in_order([a for a in known if not a.touch > truth.trusted], mine.get(row, []))
    ]  # fmt: skip
    return sorted(pairs, key=lambda pair: pair[0].touch)


def _by_row(contacts: Iterable[Contact]) -> dict[int, list[Contact]]:
    found: dict[int, list[Contact]] = {}
    for contact in contacts:
        found.setdefault(contact.row, []).append(contact)
    return found


def _in_order(some: Sequence[Contact], others: Sequence[Contact]) -> _Pairs:
    """Pair contacts of one row in order: as many as there can be, with the least sum of shifts of touches."""
    if len(some) > len(others):
        return [(a, b) for b, a in _in_order(others, some)]
    spare = len(others) - len(some)
    if not spare:
        return list(zip(some, others, strict=True))
    costs, chosen = np.zeros(spare + 1), np.empty((len(some), spare + 1), np.intp)
    for i, one in enumerate(some):  # costs[k]: of the pairs so far if at most k of the others are left out
        costs = costs + np.abs(one.touch - np.array([other.touch for other in others[i : i + spare + 1]]))
        chosen[i] = np.maximum.accumulate(np.where(costs <= np.minimum.accumulate(costs), np.arange(spare + 1), 0))
        costs = costs[chosen[i]]
    left = spare
    pairs = []
    for i in reversed(range(len(some))):
        left = chosen[i][left]
        pairs.append((some[i], others[i + left]))
    return pairs[::-1]


def turns(run: Trajectory) -> list[tuple[float, int, Mode]]:
    """When rows begin to stick or to slip, or another way, where lam jumps: instant, row, mode behind."""
    between = {Mode.STICK, Mode.SLIP}
    return sorted((e.t, e.contact, e.after) for e in run.events if {e.before, e.after} <= between)


def kinks(run: Trajectory) -> list[tuple[float, int, int]]:
    """When a gap is that of another face, edge or corner, whose curvature lam follows: instant, variable, its value."""
    return sorted((s.t, s.variable, s.after) for s in run.switches if s.smooth)


def clock(truth: Truth, run: Trajectory, case: Case | None, releases: bool = False, laid: Laid | None = None) -> Floats:
    """Return the truth's time of every sample of a run (n,), s.

    Args:
        truth: what the run is laid beside.
        run: with samples.
        case: by which errors are measured, so that only touches are laid on the truth's which bring the motions
            nearer (`measuring.laid`); without one all are.
        releases: whether all touches are laid, and where lam jumps besides: at releases, between stick and slip, and
            at `kinks`. What jumps is told by the side on which a sample stands, however short the time between.
        laid: which touches are, if another run of the same engine tells it.
    """
    start, pairs = float(truth.trajectory.t[0]), matched(truth, run)
    knots = [(b.touch, a.touch) for a, b in pairs]
    if releases:
        knots += [(b.release, a.release) for a, b in pairs if np.isfinite(a.release) and np.isfinite(b.release)]
        for told in (turns, kinks):
            mine, theirs = told(run), told(truth.trajectory)
            if [one[1:] for one in mine] == [one[1:] for one in theirs]:
                knots += [(b[0], a[0]) for a, b in zip(theirs, mine, strict=True)]
    here, there = _rising(start, knots)
    if not releases and case is not None:
        on = (which_laid(truth, run, case) if laid is None else laid).of(there)
        there = np.where(on, there, here)
        rises = np.append(True, np.diff(there) > 0.0)
        here, there = here[rises], there[rises]
    return straight(run.t, here, there)


@remembered(16)
def which_laid(truth: Truth, run: Trajectory, case: Case) -> Laid:
    """Return which touches of a run are laid on the truth's where motions are compared: those that bring it nearer."""
    here, there = _rising(float(truth.trajectory.t[0]), [(b.touch, a.touch) for a, b in matched(truth, run)])
    return nearest(truth, run, case, here, there)


def _rising(start: float, knots: Iterable[tuple[float, float]]) -> tuple[Floats, Floats]:
    """Return instants of the run (k,) and the truth's for them (k,), s: of knots that cross the nearest stay."""
    here, there = [start], [start]
    for mine, theirs in sorted(knots, key=lambda knot: abs(knot[1] - knot[0])):
        at = bisect(here, mine)
        if at and here[at - 1] < mine and there[at - 1] < theirs and (at == len(here) or theirs < there[at]):
            here.insert(at, mine)
            there.insert(at, theirs)
    return np.array(here), np.array(there)


@remembered(4)
def aligned(
    truth: Truth, run: Trajectory, case: Case | None, releases: bool = False
) -> tuple[NDArray[np.bool_], Trajectory]:
    """Which samples of the run (n,) have a counterpart that can be trusted, and the truth at them."""
    t = clock(truth, run, case, releases)
    inside = _known(truth, t)
    truth.used(float(np.minimum(run.t, t)[inside].max(initial=0.0)))
    exact, (sides, by) = truth.at(t[inside]), _sides(truth, run, t[inside])
    if not np.array_equal(sides, exact.t):
        jumps = truth.at(sides)
        exact = replace(exact, lam=jumps.lam[by], mode=jumps.mode[by])
    return inside, exact


def expect(truth: Truth, runs: Sequence[Trajectory], case: Case) -> None:
    """Have a truth found at once for all runs that are laid beside it.

    Which touches are laid is told by the truth where all are: for that it is asked first.
    """
    truth.expect([_inside(truth, clock(truth, run, None)) for run in runs])
    truth.expect(instants(truth, runs, case))


def instants(truth: Truth, runs: Iterable[Trajectory], case: Case) -> Iterator[Floats]:
    """Yield the instants at which the truth is asked for where runs are laid beside it."""
    for run in runs:
        for releases in (False, True):
            known = _inside(truth, clock(truth, run, case, releases))
            yield from (known, _sides(truth, run, known)[0])


def _inside(truth: Truth, t: Floats) -> Floats:
    return t[_known(truth, t)]


def _sides(truth: Truth, run: Trajectory, t: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Return the instants (m,) at which a truth tells what jumps, and which of them tells it beside a sample (n,).

    Where the run tells both sides of events that is the truth's own: the nearest of the same rows and modes, if it is
    as near as instants are judged to. Between the two one side alone would be beside both samples of the run, which
    counts for half a step of it. Samples between the two are beside that side on which the run has them.
    """
    theirs: dict[tuple[int, Mode], list[float]] = {}
    for event in truth.trajectory.events:
        theirs.setdefault((event.contact, event.after), []).append(event.t)
    known, at_events = {event.t for event in truth.trajectory.events}, {event.t for event in run.events}
    sides, by, moved = np.array(t), np.arange(len(t)), list[slice]()
    for instant, events in groupby(run.events, key=lambda event: event.t):
        first, last = (int(np.searchsorted(run.t[: len(t)], instant, side=side)) for side in ("left", "right"))
        if last - first < 2 or (here := float(t[first])) in known:
            continue
        times = np.array([at for event in events for at in theirs.get((event.contact, event.after), [])] or [np.inf])
        near = float(times[np.argmin(np.abs(times - here))])
        if abs(near - here) > shortest(float(truth.trajectory.t[-1])):
            continue
        start, end = min(first, int(np.searchsorted(t, near))), max(last, int(np.searchsorted(t, near, side="right")))
        if at_events.intersection([*run.t[start:first], *run.t[last:end]]):
            start, end = first, last
        sides[start:end] = near
        by[start:first], by[last:end] = first, last - 1
        moved.append(slice(start, end))
    while wrong := [one for one in moved if _crosses(sides, one)]:
        for one in wrong:
            sides[one], by[one] = t[one], np.arange(one.start, one.stop)
            moved.remove(one)
    asked = by == np.arange(len(t))
    return sides[asked], (np.cumsum(asked) - 1)[by]


def _crosses(t: Floats, one: slice) -> bool:
    """Whether instants (n,) that are one are not behind the instant before them, or not before the one behind."""
    before, behind = t[max(one.start - 1, 0) : one.start], t[one.stop : one.stop + 1]
    return bool(np.any(before >= t[one.start]) or np.any(behind <= t[one.start]))


def _known(truth: Truth, t: Floats) -> NDArray[np.bool_]:
    known: NDArray[np.bool_] = t <= min(truth.trajectory.t[-1], truth.trusted)
    return known
