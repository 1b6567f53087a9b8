"""Impulse of all collisions that took no time."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "N s"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Sum of the events' impulses, N s; None where no collision was frozen."""
    impulses = [event.impulse for event in run.events if event.impulse]
    return sum(impulses) if impulses else None
