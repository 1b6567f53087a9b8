"""Period of a swing along x: of a robot's flange behind a push, of a ball inside a ring."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reports.metrics._delta import flange, is_delta
from crossbody.reports.metrics._maze import is_maze

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "s"
CLAIMED = True
CROSSINGS = 3


def _swing(run: Trajectory, case: Case) -> tuple[Floats, Floats] | None:
    """Times (m,), s, and x (m,), m, of what swings; None if nothing does."""
    if is_maze(case):
        return run.t, run.q[:, 1]
    if not is_delta(case) or case.inputs is None:
        return None
    after = run.t > case.inputs.times[-1]
    return run.t[after], flange(run, case)[after, 0]


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Mean time between upward crossings of x = 0, s; None for another mechanism."""
    swing = _swing(run, case)
    if swing is None:
        return None
    t, x = swing
    i = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    if len(i) < CROSSINGS:
        return None
    crossed = t[i] - x[i] * (t[i + 1] - t[i]) / (x[i + 1] - x[i])
    return float(crossed[-1] - crossed[0]) / (len(i) - 1)
