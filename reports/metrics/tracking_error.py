"""Distance of a delta robot's flange from the path that its controller follows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._delta import flange, is_delta

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "m"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |r - z| in the last third of the horizon, m; None without a path."""
    if not is_delta(case):
        return None
    from crossbody.reference.delta import scene

    path = scene.path_of(case.parameters)
    if path is None:
        return None
    late = run.t > case.t_end * 2.0 / 3.0
    apart = path(run.t[late])[0] - flange(run, case)[late]
    return float(np.max(np.linalg.norm(apart, axis=1), initial=0.0))
