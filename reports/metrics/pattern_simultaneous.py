"""Speeds behind the collisions of a cradle against all collisions at once, over the speed that came in."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.reports.metrics._cradle import distance

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |v_i - v_i of the simultaneous rule| / v_in; None for another mechanism.

    Its answer for one of n equal, elastic balls is (2 - n)/n, 2/n, 2/n, ...
    """
    return distance("simultaneous", run, case)
