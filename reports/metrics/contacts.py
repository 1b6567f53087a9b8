"""How often a contact begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.cases.contacts import contacts

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Number of contacts."""
    return float(len(contacts(run)))
