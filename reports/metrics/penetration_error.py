"""Penetration against the truth's on matched arcs, over the largest penetration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.alignment import aligned

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
ROUNDING = 1e-12
"""Penetration below this part of the largest gap is rounding: collisions that take no time do not penetrate."""


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |min(gap, 0) - min(gap_truth, 0)| / max penetration of the truth; None where nothing penetrates."""
    rows = case.law.unilateral
    deepest = float(np.max(-truth.trajectory.gap[:, rows], initial=0.0))
    if deepest <= ROUNDING * float(np.max(np.abs(truth.trajectory.gap), initial=0.0)):
        return None
    inside, exact = aligned(truth, run)
    if not inside.any():
        return None
    return (
        float(np.max(np.abs(np.minimum(run.gap[inside][:, rows], 0.0) - np.minimum(exact.gap[:, rows], 0.0)))) / deepest
    )
