"""Joint angles against the truth's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.alignment import aligned

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "rad"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |q - q_truth| over samples and coordinates, rad; None unless every coordinate is an angle."""
    if any(c.unit != "rad" for c in case.coordinates):
        return None
    inside, exact = aligned(truth, run)
    return float(np.max(np.abs(run.q[inside] - exact.q), initial=0.0))
