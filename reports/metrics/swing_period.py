"""Period of the flange's swing along x behind a push."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._delta import flange, is_delta

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.truth import Truth

UNIT = "s"
CLAIMED = True
CROSSINGS = 3


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Mean time between upward crossings of x = 0 from the push on, s; None for another mechanism."""
    if not is_delta(case) or case.inputs is None:
        return None
    after = run.t > case.inputs.times[-1]
    t, x = run.t[after], flange(run, case)[after, 0]
    i = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    if len(i) < CROSSINGS:
        return None
    crossed = t[i] - x[i] * (t[i + 1] - t[i]) / (x[i + 1] - x[i])
    return float(crossed[-1] - crossed[0]) / (len(i) - 1)
