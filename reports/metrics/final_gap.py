"""Gap of the closest row at the end: zero where a body rests without penetration."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "m"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Smallest gap of the last sample, m."""
    return float(run.gap[-1].min())
