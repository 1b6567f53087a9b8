"""Rate of the gap at release over that at touch, first contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.cases.contacts import rates

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """-h'(release) / h'(touch); None where the first contact does not end."""
    found = rates(run)
    return -found[0][2] / found[0][1] if found and found[0][1] else None
