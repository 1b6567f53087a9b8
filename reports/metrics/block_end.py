"""Where the block stands at the end, along the fingers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.reports.metrics._soft import block, is_soft

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "m"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Position of the last sample, m; None for a case without a block."""
    return float(block(run, case)[0][-1]) if is_soft(case) else None
