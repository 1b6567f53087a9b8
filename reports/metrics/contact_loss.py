"""Energy that the contacts have taken until the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "J"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Minus the work of all multipliers; without a ledger what is missing, the work of the input among it."""
    if run.ledger is None:
        return float(run.total_energy[0] - run.total_energy[-1])
    return -float(run.ledger.contact[-1].sum())
