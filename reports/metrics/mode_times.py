"""Instants of hand-over and of freedom against the truth's, contacts matched in order."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases.contacts import Contact
from crossbody.reports.measuring.alignment import matched

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "s"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |t - t_truth| over all that matched contacts have in both, s; None where there is none.

    A hand-over is from COLLISION to CONTACT; a row is free at its release or, let go below the surface, where it comes
    up to it. NaN where an event of the run has no instant.
    """
    if np.isnan([event.t for event in run.events]).any():
        return math.nan
    pairs = matched(truth, run)
    shifts = [abs(b.settled - a.settled) for a, b in pairs if np.isfinite(a.settled) and np.isfinite(b.settled)]
    shifts += [_opened(truth.trajectory, a, b) for a, b in pairs if np.isfinite(a.free) and np.isfinite(b.free)]
    return max(shifts, default=None)


def _opened(truth: Trajectory, a: Contact, b: Contact) -> float:
    """How far the gap of the truth opens from one freedom to the other, over its fastest rate, s.

    A row that is let go where its multiplier vanishes rises as the cube of the time: its instant is known to the cube
    root of its depth alone, and nothing in the motion depends on it. Where a discrete variable changes in between, the
    row's gap is another one: that instant is judged as a change of the variable.
    """
    first, last = sorted((a.free, b.free))
    if any(first <= switch.t <= last and not switch.smooth for switch in truth.switches):
        return 0.0
    gap, (here, there) = truth.gap[:, a.row], np.interp([a.free, b.free], truth.t, truth.gap[:, a.row])
    dt = np.diff(truth.t)
    fastest = float(np.max(np.abs(np.diff(gap)[dt > 0.0] / dt[dt > 0.0]), initial=0.0))
    return abs(there - here) / fastest if fastest else 0.0
