"""Largest difference of the contact forces on the two sides of a block."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._lam import multipliers
from crossbody.reports.metrics._soft import imbalance

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "N"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |lam_L - lam_R| over the run, between its samples too, N; NaN where lam is not known."""
    lam = multipliers(run)
    difference = imbalance(run.lam if lam is None else lam, case)
    return None if difference is None else float(np.max(np.abs(difference)))
