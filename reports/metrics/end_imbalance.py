"""Difference of the contact forces on the two sides of a block at the end: 0 where it is centred."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.reports.metrics._soft import imbalance

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "N"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """|lam_L - lam_R| of the last sample, N."""
    difference = imbalance(run.lam, case)
    return None if difference is None else abs(float(difference[-1]))
