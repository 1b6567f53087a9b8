"""Where the flange stands at the end, along the fingers: who moved, robot or block."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.reports.metrics._soft import flange, is_soft

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "m"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Position of the last sample, m; None for a case without a block."""
    return float(flange(run, case)[-1]) if is_soft(case) else None
