"""How often the ball passes a ring."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.reports.metrics._maze import is_maze, ring_changes

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Number of changes of the channel, inward and outward."""
    return float(len(ring_changes(run, case))) if is_maze(case) else None
