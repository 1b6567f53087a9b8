"""Gaps against the truth's on matched arcs, over the largest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.impulse import away

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
ROUNDING = 1e-6
"""Gaps that never open beyond this part of the largest coordinate are known to its tolerance alone."""


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |gap - gap_truth| / max |gap_truth| over samples and unilateral rows; None without such a row.

    Where a discrete variable changes a gap may jump: those instants are left out.
    """
    rows = case.law.unilateral
    inside, exact = aligned(truth, run)
    if not rows.any() or not inside.any():
        return None
    smooth = away(exact, [switch.t for switch in truth.trajectory.switches if not switch.smooth], case.t_end)
    off = float(np.max(np.abs(run.gap[inside] - exact.gap)[smooth][:, rows], initial=0.0))
    scale = float(np.max(np.abs(truth.trajectory.gap[:, rows])))
    scale = max(scale, ROUNDING * float(np.max(np.abs(truth.trajectory.q), initial=0.0)))
    return off / scale if scale else off
