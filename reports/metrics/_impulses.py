"""Impulses and work of forces against the truth's: every function is a metric.

Of a run whose samples follow what forces do, the truth is integrated over the same samples by the same rule, so that
the error of the rule cancels; releases are matched too, and changes between stick and slip, as lam jumps there. Steps
in time (`Trajectory.acts`) tell no more than the impulse of each step: it is held against the truth's own integral,
at instants that are matched as for velocities.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.friction import Rubbing, rubbing, whole
from crossbody.reports.measuring.impulse import (
    Signal,
    away,
    before_stops,
    beside,
    collided,
    counts_itself,
    cumulated,
    impulse_upto,
    integrated,
    multipliers,
    true_impulse,
)
from crossbody.reports.measuring.placed import Placed, largest, of_rows
from crossbody.reports.measuring.scale import idle
from crossbody.reports.measuring.truth import Truth, before

UNITS = {"friction_impulse": "N s", "friction_work": "J"}
NEEDS = dict.fromkeys(("friction_impulse", "friction_work", "lam_impulse", "lam_impulse_path"), "lam")


def lam_impulse(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Total impulse of the multipliers against the truth's, over the truth's.

    Max over rows of |INT lam dt - INT lam_truth dt| / max over rows of |INT lam_truth dt|, collisions that take no
    time included; NaN where lam is unknown. Each up to the same instant of its own clock: the last sample for which the
    truth is known. Rows that carry nothing are measured by what is `idle`.
    """
    last = int(np.searchsorted(run.t, min(truth.trajectory.t[-1], truth.trusted), side="right")) - 1
    if last < 0:
        return None
    if np.isnan(run.lam).any():
        return math.nan
    mine, theirs = _totals(truth, run, case, last)
    truth.used(t := float(run.t[last]))
    scale = float(np.max(whole(theirs[None], case), initial=0.0))
    least = idle(truth.trajectory) * case.t_end
    named = of_rows(case, "N s", "N m s")
    return largest(whole((mine - theirs)[None], case), np.array([t]), named, max(scale, least)) if scale else None


def _totals(truth: Truth, run: Trajectory, case: Case, last: int) -> tuple[Floats, Floats]:
    """Return the impulses (nc,) of a run and of its truth up to the instant of the run's `last` sample, N s.

    Over the same samples by the same rule as far as they are beside each other, and by the truth's own from there on.
    """
    own, end = truth.trajectory, run.t[[last]]
    if counts_itself(run, own):
        return impulse_upto(run, end)[0], collided(end, integrated(own, multipliers, end), own.events)[0]
    inside, exact = aligned(truth, run, case)
    run, exact = before_stops(run, exact)
    upto = min(int(np.count_nonzero(inside)) - 1, last)
    rest = impulse_upto(own, end) - impulse_upto(own, exact.t[[upto]])  # at one instant twice they are two sides
    return impulse_upto(run, end)[0], true_impulse(run, exact, own)[upto] + rest[0]


def lam_impulse_path(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Cumulative impulse of the multipliers against the truth's, over the total impulse.

    Max over t and rows of |INT_0^t lam - INT_0^t lam_truth| / total impulse, collisions that take no time
    included. At the instant at which a slip stops its friction may have any direction: the sample before counts
    there. Instants of collisions that take no time are left out, as in `velocity`. NaN where lam is not
    known; None where nothing presses, or where rows depend on each other and multipliers are one choice of
    many; N s where only the run's does. Nothing is compared behind where slips are too slow to tell their friction.
    """
    run = before(run, truth.firm) if truth.firm < math.inf else run
    found = _beside(truth, run, case, multipliers)
    if found is None or truth.trajectory.counts.get("redundant", 0):
        return None
    if np.isnan(run.lam).any():
        return math.nan
    inside, exact, mine, theirs = found
    theirs = collided(exact.t, theirs, truth.trajectory.events)
    scale = float(np.max(whole(theirs, case), initial=0.0))
    smooth = away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)
    smooth &= away(run, [event.t for event in run.events if event.impulse], case.t_end)[inside]
    off = whole(collided(run.t[inside], mine, run.events) - theirs, case)[smooth]
    scale = max(scale, idle(truth.trajectory) * case.t_end) if scale else 0.0
    most = largest(off, run.t[inside][smooth], of_rows(case, "N s", "N m s"), scale or 1.0)
    return most if scale else most or None


def friction_impulse(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Impulse of friction of every pair of shapes since the start, against the truth's."""
    if (found := rubbing(run, case)) is None:
        return None

    def pushes(motion: Trajectory) -> tuple[Floats, None]:
        return _rubbing(motion, case).force.reshape(len(motion.t), -1), None

    def of_pairs(impulses: Floats) -> Floats:
        lengths: Floats = np.linalg.norm(found.of_pairs(impulses.reshape(len(impulses), len(found.rows), -1)), axis=-1)
        return lengths

    return _apart(truth, run, case, pushes, "N s", of_pairs)


def friction_work(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Work of friction of every pair of shapes since the start, against the truth's."""
    found = rubbing(run, case)
    if found is None:
        return None

    def works(motion: Trajectory) -> tuple[Floats, Floats]:
        places = _rubbing(motion, case)
        return places.force.reshape(len(motion.t), -1), places.slip.reshape(len(motion.t), -1)

    def of_pairs(works: Floats) -> Floats:
        return np.abs(found.of_pairs(works.reshape(len(works), len(found.rows), -1).sum(axis=-1)))

    return _apart(truth, run, case, works, "J", of_pairs)


def _rubbing(motion: Trajectory, case: Case) -> Rubbing:
    found = rubbing(motion, case)
    assert found is not None
    return found


def _apart(
    truth: Truth, run: Trajectory, case: Case, signal: Signal, unit: str, of: Callable[[Floats], Floats]
) -> Placed | None:
    """Return the largest size `of` differences of integrals of a signal."""
    if (found := _beside(truth, run, case, signal)) is None:
        return None
    inside, _, mine, theirs = found
    return largest(of(mine - theirs).max(axis=1, initial=0.0), run.t[inside], [("", unit)])


def _beside(
    truth: Truth, run: Trajectory, case: Case, signal: Signal
) -> tuple[NDArray[np.bool_], Trajectory, Floats, Floats] | None:
    """Return which samples (n,) of a run have a counterpart, the truth at these, and the integrals of both (m, k).

    None where none has one. Where samples follow what forces do the one before counts at which a slip stops.
    """
    own = counts_itself(run, truth.trajectory)
    inside, exact = aligned(truth, run, case, releases=not own)
    if not inside.any():
        return None
    if not own:
        run, exact = before_stops(run, exact)
    return inside, exact, cumulated(run, *signal(run))[inside], beside(run, exact, truth.trajectory, signal)
