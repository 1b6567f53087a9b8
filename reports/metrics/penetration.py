"""Largest penetration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "m"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """max(0, -gap) over all unilateral rows and samples, m."""
    rows = case.law.unilateral
    return float(np.max(-run.gap[:, rows], initial=0.0)) if rows.any() else None
