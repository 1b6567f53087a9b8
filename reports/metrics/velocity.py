"""Velocity against the truth's on matched arcs, over the largest of each coordinate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.impulse import away
from crossbody.reports.measuring.scale import least, of_like

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max over samples and coordinates of |v - v_truth| / max |v_truth|, of its like where one rests.

    Only touches are matched: a release that is off by dt shows as dt times the acceleration there. Instants of
    collisions that take no time are left out: several may share one, and a sample does not say behind which it stands.
    """
    inside, exact = aligned(truth, run)
    if not inside.any():
        return None
    shared = of_like(np.max(np.abs(truth.trajectory.v), axis=0), case.velocities)
    scale = np.maximum(shared, least(case.velocities, rates=True))
    smooth = away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)
    off = np.abs(run.v[inside] - exact.v)[smooth] / scale
    return float(np.max(off, initial=0.0))
