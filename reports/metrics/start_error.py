"""First recorded state against the case's start, over the largest of each coordinate.

A known property of an engine never explains where it starts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.reports.metrics._scale import least, of_like

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max of |q(0) - q0| / max |q_truth| and |v(0) - v0| / max |v_truth|, each over all that share its unit.

    None for a run that begins later than its case, as one restarted inside of a log does.
    """
    if not len(run.t) or run.t[0] != 0.0 or run.q.shape[1] != len(case.q0):
        return None
    pairs = [(run.q[0], case.q0, truth.trajectory.q, least(case))]
    if not any(event.impulse and event.t == 0.0 for event in run.events):  # else the first row may be behind it
        pairs.append((run.v[0], case.v0, truth.trajectory.v, least(case, rates=True)))
    n = len(case.coordinates)
    return max(_apart(case, *pair) for pair in pairs if pair[2].shape[1] == n)


def _apart(case: Case, mine: Floats, given: Floats, motion: Floats, smallest: Floats) -> float:
    scale = np.maximum(of_like(np.max(np.abs(motion), axis=0, initial=0.0), case), smallest)
    return float(np.max(np.abs(mine - given) / scale, initial=0.0))
