"""What a run is measured against: a motion that is taken to be right."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Chaos, Tier, Trajectory
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.between import between
from crossbody.cases.contacts import Contact, contacts
from crossbody.cases.remembered import remembered
from crossbody.cases.trajectory import Ledger

TRUTH = "truth"  # name of the truth where engines have theirs, and of the row that judges it
LAST = 0.9
"""Part of the time for which a truth is trusted behind which it may end, between two events."""
MOST, FEWEST = 4000, 21
"""Samples inside all short intervals between events together, unless each has but the fewest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """A motion that is taken to be right.

    Attributes:
        tier: how it is known.
        source: in words, with the agreement of tier C.
        trajectory: the motion, dense enough to plot, both sides of every event.
        at: the motion at nondecreasing times inside the horizon; an event's instant asked for
            twice gives both sides.
        expect: told at which instants it will be asked for, so that it may find them together.
        used: told up to which instant of both clocks a run is compared, s; what is told last counts.
        agreement: metric -> how far the two sources of tier C are apart; empty for the others.
        trusted: until when the two sources of tier C agree, s: nothing is compared behind it (chaos).
        parted: when the two sources part, s; infinite if they never do.
        allowed: largest disagreement of the two sources, relative; NaN where there is one source alone.
        growth: rate at which the two part, 1/s; NaN unless they do.
        grows: how many times more than in free flight an error of the start grows; 1 where it was
            not measured.
        tight: tolerance of the compiled run; NaN of another source.
        witness: engine and profile that it is held against; empty where that is no engine's own.
        spent: engine and profile that would be the witness, but took all its time; empty where there is none.
        firm: until when slips are fast enough to tell the direction of their friction, s.
        part: of the horizon that was asked for, up to which the motion is followed.
        short: why no further; empty if to the horizon.
        horizon: up to when a scene's motion can be known, and why no further, as measured; None
            if to the end.
        touches (nc,): rows that begin and end contacts (`Law.touches`); None for all.
        joined: whether contacts of a row between which no gap opens are one: those of a scene,
            whose rows may depend on each other and rest unloaded.
    """

    tier: Tier
    source: str
    trajectory: Trajectory
    at: Callable[[Floats], Trajectory]
    expect: Callable[[Iterable[Floats]], None] = lambda asked: None
    used: Callable[[float], None] = lambda until: None
    agreement: dict[str, float]
    trusted: float = math.inf
    parted: float = math.inf
    allowed: float = math.nan
    growth: float = math.nan
    tight: float = math.nan
    witness: tuple[str, str] = ("", "")
    spent: tuple[str, str] = ("", "")
    grows: float = 1.0
    firm: float = math.inf
    part: float = 1.0
    short: str = ""
    horizon: Chaos | None = None
    touches: NDArray[np.bool_] | None = None
    joined: bool = False

    def contacts(self, run: Trajectory) -> tuple[Contact, ...]:
        """Return the contacts of a run, or of this motion, as they are compared."""
        return contacts(run, self.touches, self.joined)

    def compared(self, run: Trajectory) -> Trajectory:
        """Return what of a run is compared: up to where this motion is trusted, by the run's own clock."""
        return before(run, self.trusted) if len(run.t) and self.trusted < run.t[-1] else run


def sample_times(run: Trajectory, t_end: float, grid: int = 2001, inside: int = 201) -> Floats:
    """Times that show a motion: a grid, more of them from each event to the next if that is short, events twice.

    And so is what else the run shows twice: where contacts that share a load begin to bear none, forces have kinks.

    Args:
        run: whose events.
        t_end: horizon, s.
        grid: points on the horizon.
        inside: most points on each interval between events that is shorter than a tenth of the horizon.
    """
    told = [e.t for e in run.events if e.t <= t_end]
    twice, known = run.t[1:][np.diff(run.t) == 0.0].tolist(), set(told)
    events = np.array([*told, *(t for t in twice if t <= t_end and t not in known)])
    parts = [np.linspace(0.0, t_end, grid)]
    edges = distinct(0.0, events, t_end)
    short = [(a, b) for a, b in pairwise(edges) if b - a < 0.1 * t_end]
    each = min(inside, max(FEWEST, MOST // max(len(short), 1)))
    parts += [np.linspace(a, b, each)[1:-1] for a, b in short]
    times: Floats = np.sort(np.concatenate([distinct(*parts, events), events]))
    return times[np.concatenate([[True, True], times[2:] > times[:-2]])] if len(times) > 2 else times


def shortened(truth: Truth) -> Truth:
    """Return a truth up to where it is trusted, between two events, so that numbers of them can agree."""
    end = truth.trusted
    if not end < truth.trajectory.t[-1]:
        return truth
    if near := [e.t for e in truth.trajectory.events if LAST * end < e.t < end / LAST]:
        edges = [LAST * end, *(t for t in near if t < end), end]
        end = max((b - a, 0.5 * (a + b)) for a, b in pairwise(edges))[1]
    return replace(truth, trajectory=before(truth.trajectory, end), trusted=end)


def before(run: Trajectory, t: float) -> Trajectory:
    """Return a motion up to an instant t, s, with its events, switches and account until then."""
    return replace(
        taken(run, run.t <= t), events=tuple(e for e in run.events if not e.t > t),
        switches=tuple(s for s in run.switches if not s.t > t),
    )  # fmt: skip


def taken(run: Trajectory, some: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Trajectory:
    """Return some samples of a motion, with its account there."""
    names = ("t", "q", "v", "gap", "lam", "energy", "mode")
    booked = run.ledger and Ledger(
        contact=run.ledger.contact[some], input=run.ledger.input[some], dissipated=run.ledger.dissipated[some]
    )
    return replace(run, **{name: getattr(run, name)[some] for name in names}, ledger=booked)


@remembered(4)
def dense(run: Trajectory) -> Callable[[Floats], Trajectory]:
    """Return a motion between its samples, which asks nobody to integrate it anew."""
    return between(run)


def from_run(run: Trajectory, tier: Tier, source: str, touches: NDArray[np.bool_] | None = None) -> Truth:
    """A run as the truth for others: an engine refined against itself, or a measurement."""
    return Truth(tier=tier, source=source, trajectory=run, at=between(run), agreement={}, touches=touches)
