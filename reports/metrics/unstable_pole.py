"""Rate at which a ball that was released near the top of an outer face runs away."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from crossbody.reports.metrics._maze import is_maze, leaving

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1/s"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """From delta'^2 = 2 pole^2 (cos(delta0) - cos(delta)), exact at any angle, where the ball leaves the face."""
    left = leaving(run) if is_maze(case) else None
    if left is None:
        return None
    angle, rate = left
    start = math.atan2(run.q[0, 1], run.q[0, 2])
    return abs(rate) / math.sqrt(2.0 * (math.cos(start) - math.cos(angle)))
