"""Drift of the quantity that the tactile loop keeps, whatever touches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._soft import invariant, is_soft

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "m"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Largest change of x_ref + k (mb v_b + bt (b - b0)) + k (y_R - y_L)/ks since the start, m."""
    if not is_soft(case):
        return None
    kept = invariant(run, case)
    return float(np.max(np.abs(kept - kept[0])))
