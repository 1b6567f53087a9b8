"""How often a body comes free again after a contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.cases import Mode

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Number of transitions into FREE; contacts that ended where the run has no modes."""
    return float(sum(event.after == Mode.FREE for event in run.events))
