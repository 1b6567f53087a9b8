"""Instants of touch, hand-over, release and freedom against the truth's, contacts matched in order."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._align import matched
from crossbody.reports.metrics._contacts import Contact

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
    pairs = matched(truth, run)
    known = [each for a, b in pairs for each in zip(a.instants(), b.instants(), strict=True)]
    shifts = [abs(b - a) for a, b in known if np.isfinite(a) and np.isfinite(b)]
    shifts += [_opened(truth.trajectory, a, b) for a, b in pairs if np.isfinite(a.free) and np.isfinite(b.free)]
    return max(shifts, default=None)


def _opened(truth: Trajectory, a: Contact, b: Contact) -> float:
    """How far the gap of the truth opens from one freedom to the other, over its fastest rate, s.

    A row that is let go where its multiplier vanishes rises as the cube of the time: its instant is known to the cube
    root of its depth alone, and nothing in the motion depends on it.
    """
    gap, (here, there) = truth.gap[:, a.row], np.interp([a.free, b.free], truth.t, truth.gap[:, a.row])
    dt = np.diff(truth.t)
    fastest = float(np.max(np.abs(np.diff(gap)[dt > 0.0] / dt[dt > 0.0]), initial=0.0))
    return abs(there - here) / fastest if fastest else 0.0
