"""How far the multipliers pull, or act where nothing touches, over the largest.

Recomputed from lam, gap and mode, never an engine's own flag.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases.contacts import CLOSED
from crossbody.reports.measuring.equations import equations
from crossbody.reports.measuring.multipliers import told

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
NEEDS = "lam"


def _open(truth: Truth, run: Trajectory) -> NDArray[np.bool_]:
    """Samples and rows (n, nc) where nothing touches: by mode; without modes, above all contacts of the truth."""
    if (run.mode >= 0).all():
        return ~np.isin(run.mode, CLOSED)
    touching = np.isin(truth.trajectory.mode, CLOSED)
    reach = float(np.max(truth.trajectory.gap[touching], initial=0.0))
    return run.gap > 1.01 * reach + 1e-9 * float(np.max(np.abs(run.gap), initial=0.0))


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max of -lam and of |lam| on open unilateral rows, over max |lam|; NaN where lam is not known.

    Rows that follow others, those of friction, push either way.
    """
    system = equations(case)
    rows = case.law.unilateral & (True if system is None else np.asarray(system.follows) < 0)
    if not rows.any():
        return None
    if told(run) is None:
        return math.nan
    lam = run.lam[:, rows]
    scale = float(np.max(np.abs(lam), initial=0.0))
    acting = np.abs(lam[_open(truth, run)[:, rows]])
    worst = max(float(np.max(-lam, initial=0.0)), float(np.max(acting, initial=0.0)))
    return worst / scale if scale else 0.0
