"""Instants of touch and release against the truth's, matched in order."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.alignment import matched

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "s"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |t - t_truth| over matched touches and releases, s; None where nothing touches.

    A contact that the run or the truth does not have is not here: it is a difference in the metric contacts. NaN where
    an event of the run has no instant.
    """
    if np.isnan([event.t for event in run.events]).any():
        return math.nan
    pairs = matched(truth, run)
    shifts = [abs(b.touch - a.touch) for a, b in pairs]
    shifts += [abs(b.release - a.release) for a, b in pairs if np.isfinite(a.release) and np.isfinite(b.release)]
    return max(shifts, default=None)
