"""Smallest multiplier of the two feet that the red body's slab stands on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "N"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Min of lam1 and lam2 over the run, N, from when both stand; None where they never do or lam is not known."""
    if case.mechanism != "red_body" or np.isnan(run.lam).any():
        return None
    feet = run.lam[:, :2]
    standing = np.flatnonzero((feet > 0.0).all(axis=1))
    return float(feet[standing[0] :].min()) if len(standing) else None
