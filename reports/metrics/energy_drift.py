"""Energy against the truth's on matched arcs, over the largest kinetic energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._align import aligned
from crossbody.reports.metrics._impulse import away

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |E(t) - E_truth(t)| / max T_truth.

    Instants of collisions that take no time are left out: several may share one, and a sample does not say behind which
    it stands.
    """
    inside, exact = aligned(truth, run)
    scale = float(truth.trajectory.energy[:, 0].max())
    if scale == 0.0 or not inside.any():
        return None
    smooth = away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)
    return float(np.max(np.abs(run.total_energy[inside] - exact.total_energy)[smooth], initial=0.0)) / scale
