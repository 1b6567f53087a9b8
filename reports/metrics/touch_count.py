"""Contacts of the run less those of the truth: 0 if both touch equally often."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.cases.contacts import contacts

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Number of contacts of the run minus the truth's."""
    return float(len(contacts(run, truth.joined)) - len(contacts(truth.trajectory, truth.joined)))
