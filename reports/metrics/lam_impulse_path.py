"""Cumulative impulse of the multipliers against the truth's, over the total impulse."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._align import aligned
from crossbody.reports.metrics._impulse import cumulative

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max over t and rows of |INT_0^t lam - INT_0^t lam_truth| / total impulse; None where lam is not known."""
    inside, exact = aligned(truth, run)
    if np.isnan(run.lam).any() or not inside.any():
        return None
    theirs = cumulative(exact)
    scale = float(np.max(np.abs(theirs), initial=0.0))
    return float(np.max(np.abs(cumulative(run)[inside] - theirs))) / scale if scale else None
