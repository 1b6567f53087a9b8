"""Position of a delta robot's flange against the truth's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._delta import beside, is_delta

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "m"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |z - z_truth| over samples and components, m; None for another mechanism."""
    if not is_delta(case):
        return None
    mine, theirs = beside(truth, run, case)
    return float(np.max(np.abs(mine - theirs), initial=0.0))
