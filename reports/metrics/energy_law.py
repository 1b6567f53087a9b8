"""Net energy that the contact law has given at most, over the largest kinetic energy.

From the run's own account of the work of every multiplier (docs/explanation/model.md): above zero, the law made energy.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
NEEDS = "ledger"


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """max(0, max over t of the work of all rows) / max T of the truth; NaN without an account."""
    scale = float(truth.trajectory.energy[:, 0].max())
    rows = case.law.unilateral
    if scale == 0.0 or not rows.any():
        return None
    if run.ledger is None:
        return math.nan
    return float(np.max(run.ledger.contact[:, rows].sum(axis=1), initial=0.0)) / scale
