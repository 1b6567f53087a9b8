"""Speeds behind the collisions of a cradle against one collision after another, over the speed that came in."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.reports.metrics._cradle import distance

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |v_i - v_i of the sequential truth| / v_in; None for another mechanism, or where it has no answer."""
    return distance("sequential", run, case)
