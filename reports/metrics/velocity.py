"""Velocity against the truth's on matched arcs, over the largest of each coordinate."""

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
    """Max over samples and coordinates of |v - v_truth| / max |v_truth|, of its like where one rests.

    Only touches are matched: a release that is off by dt shows as dt times the acceleration there. Instants of
    collisions that take no time are left out: several may share one, and a sample does not say behind which it stands.
    """
    inside, exact = aligned(truth, run)
    own = np.max(np.abs(truth.trajectory.v), axis=0)
    units = np.array([coordinate.unit for coordinate in case.coordinates])
    scale = np.array([own[units == unit].max() for unit in units])
    if not inside.any():
        return None
    smooth = away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)
    off = np.abs(run.v[inside] - exact.v)[smooth] / np.where(scale > 0.0, scale, 1.0)
    return float(np.max(off, initial=0.0))
