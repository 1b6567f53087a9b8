"""How far the instants at which the ball passes a ring are off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._maze import is_maze, ring_changes

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "s"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |t - t_truth| over the ring changes in order; None without any, or where their numbers differ."""
    if not is_maze(case):
        return None
    exact, found = ring_changes(truth.trajectory, case), ring_changes(run, case)
    if len(exact) == 0 or len(exact) != len(found):
        return None
    return float(np.max(np.abs(found - exact)))
