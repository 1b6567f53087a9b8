"""A run laid beside the truth: events are matched first, the arcs between them compared.

A shift of an impact by 2 ms costs 2 v0 in a raw difference of velocities although nothing else is wrong. So the run's
clock is stretched, linearly between matched touches, until they stand at the truth's instants; how far they were off
is a number of its own (metric event_times).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.cases.contacts import Contact, contacts
from crossbody.cases.trajectory import Trajectory

if TYPE_CHECKING:
    from crossbody.reports.measuring.truth import Truth

_Pairs = list[tuple[Contact, Contact]]


def matched(truth: Truth, run: Trajectory) -> _Pairs:
    """Contacts of truth and run, paired in order up to the first that belongs to another row or is not trusted."""
    pairs: _Pairs = []
    for a, b in zip(*(contacts(each, truth.joined) for each in (truth.trajectory, run)), strict=False):
        if a.row != b.row or a.touch > truth.trusted:
            break
        pairs.append((a, b))
    return pairs


def clock(truth: Truth, run: Trajectory, releases: bool = False) -> Floats:
    """The truth's time of every sample of the run (n,), s; `releases` are laid on those of the truth too."""
    start, pairs = float(truth.trajectory.t[0]), matched(truth, run)
    knots = [(b.touch, a.touch) for a, b in pairs]
    if releases:
        knots += [(b.release, a.release) for a, b in pairs if np.isfinite(a.release) and np.isfinite(b.release)]
    kept = [(start, start)]
    for knot in sorted(knots) if releases else knots:
        if knot[0] > kept[-1][0] and knot[1] > kept[-1][1]:
            kept.append(knot)
    here, there = np.array(kept).T
    late = np.maximum(run.t - here[-1], 0.0)
    mapped: Floats = np.interp(run.t, here, there) + late
    return mapped


def aligned(truth: Truth, run: Trajectory, releases: bool = False) -> tuple[NDArray[np.bool_], Trajectory]:
    """Which samples of the run (n,) have a counterpart that can be trusted, and the truth at them."""
    t = clock(truth, run, releases)
    inside = t <= min(truth.trajectory.t[-1], truth.trusted)
    return inside, truth.at(t[inside])
