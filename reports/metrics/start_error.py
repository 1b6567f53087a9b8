"""First recorded state against the case's start, over the largest of each coordinate.

A known property of an engine never explains where it starts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crossbody.cases._arrays import Floats

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
    units = np.array([coordinate.unit for coordinate in case.coordinates])
    pairs = [(run.q[0], case.q0, truth.trajectory.q)]
    if not any(event.impulse and event.t == 0.0 for event in run.events):  # else the first row may be behind it
        pairs.append((run.v[0], case.v0, truth.trajectory.v))
    return max(_apart(mine, given, motion, units) for mine, given, motion in pairs if motion.shape[1] == len(units))


def _apart(mine: Floats, given: Floats, motion: Floats, units: NDArray[np.str_]) -> float:
    own = np.max(np.abs(motion), axis=0, initial=0.0)
    scale = np.array([own[units == unit].max() for unit in units])
    return float(np.max(np.abs(mine - given) / np.where(scale > 0.0, scale, 1.0), initial=0.0))
