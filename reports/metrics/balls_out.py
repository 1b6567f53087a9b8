"""How many balls of a cradle leave with more than half the speed that came in."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.reports.metrics._cradle import is_cradle, outgoing, row

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Number of balls; None for another mechanism, or where the collisions are not over."""
    speeds = outgoing(run, case)[1] if is_cradle(case) else None
    return None if speeds is None else float((speeds > 0.5 * row(case).speed).sum())
