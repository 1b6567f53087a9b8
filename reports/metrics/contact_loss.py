"""Energy that the contacts have taken until the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.truth import Truth

UNIT = "J"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Minus the work of all multipliers; None without a ledger."""
    return None if run.ledger is None else -float(run.ledger.contact[-1].sum())
