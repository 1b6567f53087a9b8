"""Energy against the truth's on matched arcs, over the largest kinetic energy or the swing of the potential."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.impulse import away
from crossbody.reports.measuring.scale import energy

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |E(t) - E_truth(t)| / the truth's largest energy.

    Instants of collisions that take no time are left out: several may share one, and a sample does not say behind which
    it stands.
    """
    inside, exact = aligned(truth, run)
    scale = energy(truth.trajectory)
    if scale == 0.0 or not inside.any():
        return None
    smooth = away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)
    return float(np.max(np.abs(run.total_energy[inside] - exact.total_energy)[smooth], initial=0.0)) / scale
