"""First recorded state against the case's start, over the largest of each coordinate.

A known property of an engine never explains where it starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Coordinate
from crossbody.cases.rotations import differences
from crossbody.reports.measuring.scale import least, of_like

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max of |q(0) - q0| / max |q_truth| and |v(0) - v0| / max |v_truth|, each over all that share its unit.

    None for a run that begins later than its case, as one restarted inside of a log does.
    """
    if not len(run.t) or run.t[0] != 0.0 or run.q.shape[1] != len(case.q0):
        return None
    off = differences(run.q[:1], case.q0[None], case.quaternions)[0]
    pairs = [(off, truth.trajectory.q, case.coordinates, False)]
    if not any(event.impulse and event.t == 0.0 for event in run.events):  # else the first row may be behind it
        pairs.append((np.abs(run.v[0] - case.v0), truth.trajectory.v, case.velocities, True))
    return max(_apart(*pair) for pair in pairs if pair[1].shape[1] == len(pair[2]))


def _apart(off: Floats, motion: Floats, named: Sequence[Coordinate], rates: bool) -> float:
    largest = of_like(np.max(np.abs(motion), axis=0, initial=0.0), named)
    return float(np.max(off / np.maximum(largest, least(named, rates)), initial=0.0))
