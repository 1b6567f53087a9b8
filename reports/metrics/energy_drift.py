"""Energy against the truth's on matched arcs, over the largest kinetic energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._align import aligned

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |E(t) - E_truth(t)| / max T_truth."""
    inside, exact = aligned(truth, run)
    scale = float(truth.trajectory.energy[:, 0].max())
    if scale == 0.0 or not inside.any():
        return None
    return float(np.max(np.abs(run.total_energy[inside] - exact.total_energy))) / scale
