"""Speeds behind the collisions of a cradle against the memoryless law, over the speed that came in."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.reports.metrics._cradle import distance

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |v_i - v_i of the memoryless law| / v_in, at the row's own gap, a0 and zeta; None where it has no answer."""
    return distance("memoryless", run, case)
