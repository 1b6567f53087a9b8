"""Velocity against the truth's on matched arcs, over the largest of each coordinate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._align import aligned

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max over samples and coordinates of |v - v_truth| / max |v_truth|; None where nothing moves.

    Only touches are matched: a release that is off by dt shows as dt times the acceleration there.
    """
    inside, exact = aligned(truth, run)
    own = np.max(np.abs(truth.trajectory.v), axis=0)
    units = np.array([coordinate.unit for coordinate in case.coordinates])
    scale = np.array([own[units == unit].max() for unit in units])
    if not inside.any() or not scale.all():
        return None
    return float(np.max(np.abs(run.v[inside] - exact.v) / scale))
