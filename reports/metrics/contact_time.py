"""Duration of the first contact, touch to release."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.cases.contacts import contacts

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "s"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Release less touch of the first contact that ended, s."""
    return next((c.release - c.touch for c in contacts(run) if c.release < float("inf")), None)
