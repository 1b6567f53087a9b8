"""Largest multiplier of the wall beside the red body, which is never reached."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "N"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |lam5| over the run, N; None where lam is not known."""
    if case.mechanism != "red_body" or np.isnan(run.lam).any():
        return None
    return float(np.max(np.abs(run.lam[:, 4])))
