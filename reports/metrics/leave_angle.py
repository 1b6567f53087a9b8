"""Cosine of the angle from the top at which the ball leaves an outer face."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from crossbody.reports.metrics._maze import is_maze, leaving

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """cos(delta) at the first release from the face below; None if it is never released."""
    left = leaving(run) if is_maze(case) else None
    return None if left is None else math.cos(left[0])
