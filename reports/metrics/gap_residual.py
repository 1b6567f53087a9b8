"""Recorded gaps against those of the recorded positions, over the largest: an identity at every sample."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.equations import equations, finite, spread

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
ROUNDING = 1e-6
"""Closures rest at zero: on gaps below this part of the largest coordinate two programs agree to rounding alone, which
is 1e-10 of it."""


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |gap - gap(q)| / max |gap(q)|, at most 400 samples.

    None without rows, where gaps depend on discrete variables, and where the case has no equations.
    """
    system = equations(case)
    if system is None or not run.gap.shape[1] or system.jumps:
        return None
    if not finite(run):
        return math.nan
    some = spread(run)
    wanted = np.array([system.gap(q)[0] for q in run.q[some]])
    scale = max(float(np.max(np.abs(wanted))), ROUNDING * float(np.max(np.abs(run.q[some]))))
    off = float(np.max(np.abs(run.gap[some] - wanted)))
    return off / scale if scale else off
