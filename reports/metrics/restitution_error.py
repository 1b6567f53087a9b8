"""Restitution against the truth's, largest difference over matched contacts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.cases.contacts import rates

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |e - e_truth| over the contacts that ended in both; None where there is none."""
    pairs = zip(rates(truth.trajectory), rates(run), strict=False)
    return max((abs(out / into - b_out / b_into) for (_, b_into, b_out), (_, into, out) in pairs), default=None)
