"""How far instants of events are off, where what brings them about may come near zero slowly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from crossbody.cases import Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.defaults import shortest
from crossbody.reports.measuring.truth import Truth, dense, taken

BEFORE = 0.5 ** np.arange(24.0)
"""Instants before an event of the truth, as parts of how far the run's is off: also short slides lie between two."""


def off(truth: Truth, expected: float, found: float, guard: Callable[[Trajectory], Floats], known: float) -> float:
    """Return how far an event is off, s, or what its guard makes of that, where it says no more.

    An event is where its guard, a gap, a slip or a force, reaches zero. If the truth's is within what it is known
    to for as long before its own event as the run is off, that counts as the same part of what instants may be off by.

    Args:
        truth: with how errors grow, as the limits on them do.
        expected: when it happens in the truth, s.
        found: in the run.
        guard: values (n,) at the samples of a motion.
        known: by how much the guard of a run may be off, in its unit.
    """
    late, short = abs(found - expected), shortest(float(truth.trajectory.t[-1]))
    if not late > short:
        return late
    times = truth.trajectory.t
    first = int(np.searchsorted(times, expected - late))
    if first < len(times) and times[first] < expected:  # a sample may tell, without the tenth of a second of splines
        there = guard(taken(truth.trajectory, np.array([first])))
        if not abs(float(there[0])) <= truth.grows * known:
            return late
    near = dense(truth.trajectory)(np.maximum(expected - late * BEFORE, truth.trajectory.t[0]))
    part = float(np.max(np.abs(guard(near)))) / known if known > 0.0 else np.inf
    return min(short * part, late) if part <= truth.grows else late
