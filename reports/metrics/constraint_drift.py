"""Largest gap of the rows that are always on: zero where a closure holds.

Where a case starts off the manifold this is its start; its decay is what the law prescribes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "m"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |h| over all bilateral rows and samples, m; None without such a row."""
    rows = ~case.law.unilateral
    return float(np.max(np.abs(run.gap[:, rows]))) if rows.any() else None
