"""Instants of touch, hand-over, release and freedom against the truth's, contacts matched in order."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._align import matched

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "s"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |t - t_truth| over all that matched contacts have in both, s; None where nothing touches.

    Beside touch and release these are the hand-over from COLLISION to CONTACT, and where a row that was let go below
    the surface comes up to it. A contact that the run or the truth does not have is not here: it is a difference in the
    metric contacts. NaN where an event of the run has no instant.
    """
    if np.isnan([event.t for event in run.events]).any():
        return math.nan
    pairs = [each for a, b in matched(truth, run) for each in zip(a.instants(), b.instants(), strict=True)]
    return max((abs(b - a) for a, b in pairs if np.isfinite(a) and np.isfinite(b)), default=None)
