"""Total impulse of the multipliers against the truth's, over the truth's."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.impulse import cumulative
from crossbody.reports.measuring.scale import idle

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
NEEDS = "lam"


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max over rows of |INT lam dt - INT lam_truth dt| / max over rows of |INT lam_truth dt|; NaN where lam is unknown.

    Rows that carry nothing are measured by what is `idle`.

    Both integrals take the same samples by the same rule, so that the error of the rule cancels. Collisions that take
    no time have no lam and do not count: beside them a compliant truth has samples too few for its own integral.
    """
    inside, exact = aligned(truth, run)
    if not inside.any():
        return None
    if np.isnan(run.lam).any():
        return math.nan
    mine, theirs = cumulative(run)[inside][-1], cumulative(exact)[-1]
    scale = float(np.max(np.abs(theirs), initial=0.0))
    least = idle(truth.trajectory) * case.t_end
    return float(np.max(np.abs(mine - theirs))) / max(scale, least) if scale else None
