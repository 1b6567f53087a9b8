"""The flange of a delta robot, of a run and of its truth at the same instants."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.cases.arrays import Floats
from crossbody.reports.metrics._align import aligned

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth


def is_delta(case: Case) -> bool:
    """Whether the case is one of the delta robot."""
    return case.mechanism == "delta"


def flange(run: Trajectory, case: Case) -> Floats:
    """Position of the flange (n, 3), m."""
    from crossbody.reference.delta import flanges, scene

    return flanges(scene.robot_of(case.parameters), run.q)


def beside(truth: Truth, run: Trajectory, case: Case) -> tuple[Floats, Floats]:
    """Flange of the run and of the truth (m, 3), m, as far as the truth can be trusted."""
    inside, exact = aligned(truth, run)
    return flange(run, case)[inside], flange(exact, case)
