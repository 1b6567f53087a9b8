"""How far the multipliers pull, or act where nothing touches, over the largest.

Recomputed from lam and gap, never an engine's own flag.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max of -lam and of |lam| on open rows above the surface, over max |lam|; None where lam is not known."""
    rows = case.law.unilateral
    if np.isnan(run.lam).any() or not rows.any():
        return None
    lam, gap = run.lam[:, rows], run.gap[:, rows]
    scale = float(np.max(np.abs(lam), initial=0.0))
    # A gap that is open further than rounding and than any contact of the truth holds on may not carry a force.
    reach = max(float(np.max(truth.trajectory.gap[truth.trajectory.lam > 0.0], initial=0.0)), 0.0)
    away = gap > reach + 1e-9 * float(np.max(np.abs(gap), initial=0.0))
    worst = max(float(np.max(-lam, initial=0.0)), float(np.max(np.abs(lam[away]), initial=0.0)))
    return worst / scale if scale else 0.0
