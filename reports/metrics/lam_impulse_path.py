"""Cumulative impulse of the multipliers against the truth's, over the total impulse."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.impulse import away, with_collisions
from crossbody.reports.measuring.scale import idle

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
NEEDS = "lam"


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max over t and rows of |INT_0^t lam - INT_0^t lam_truth| / total impulse, collisions that take no time included.

    Releases are matched too, as lam jumps there: a sample on the wrong side would count for half its step. Instants of
    collisions that take no time are left out, as in `velocity`. NaN where lam is not known; None where nothing presses,
    or where rows depend on each other and multipliers are one choice of many; N s where only the run's does.
    """
    inside, exact = aligned(truth, run, releases=True)
    if not inside.any() or truth.trajectory.counts.get("redundant", 0):
        return None
    if np.isnan(run.lam).any():
        return math.nan
    theirs = with_collisions(exact, truth.trajectory.events)
    scale = float(np.max(np.abs(theirs), initial=0.0))
    smooth = away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)
    smooth &= away(run, [event.t for event in run.events if event.impulse], case.t_end)[inside]
    off = float(np.max(np.abs(with_collisions(run, run.events)[inside] - theirs)[smooth], initial=0.0))
    return off / max(scale, idle(truth.trajectory) * case.t_end) if scale else off or None
