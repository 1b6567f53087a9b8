"""Multipliers of rows that are always on against the truth's, point by point, over the largest."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.scale import idle

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
NEEDS = "lam"


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |lam - lam_truth| over max |lam_truth|, or what `idle` rows are measured by.

    None where a row can open, NaN where lam is not known.

    Where an instant stands twice lam jumps: its two sides are compared each with its own.
    """
    if case.law.unilateral.any():
        return None
    if np.isnan(run.lam).any():
        return math.nan
    inside, exact = aligned(truth, run)
    scale = float(np.max(np.abs(exact.lam), initial=0.0))
    off = float(np.max(np.abs(run.lam[inside] - exact.lam), initial=0.0))
    return off / max(scale, idle(truth.trajectory)) if scale else None
