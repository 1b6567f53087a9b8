"""Instant at which the right finger first touches the block."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.reports.metrics._soft import touch

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "s"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Of the first transition to a closed mode, s; None where there is no such finger or no touch."""
    return touch(run, case, "right")
