"""Position against the truth's on matched arcs, over the largest of each coordinate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._align import aligned

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max over samples and coordinates of |q - q_truth| / max |q_truth|."""
    inside, exact = aligned(truth, run)
    scale = np.max(np.abs(truth.trajectory.q), axis=0)
    if not inside.any() or not scale.all():
        return None
    return float(np.max(np.abs(run.q[inside] - exact.q) / scale))
