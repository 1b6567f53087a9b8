"""What a run of the red body tells: the order of its modes, and what single rows bear."""

from __future__ import annotations

import numpy as np

from crossbody.cases.between import multipliers
from crossbody.cases.case import Case
from crossbody.cases.mechanisms.red_body.order import LEFT, stages_in_order
from crossbody.cases.metric import CaseMetric
from crossbody.cases.trajectory import Trajectory

FEET, WALL = slice(0, 2), 4


def _mode_order(run: Trajectory, case: Case) -> float | None:
    return None if (run.mode < 0).all() else float(stages_in_order(run.events))


def _foot_lam(run: Trajectory, case: Case) -> float | None:
    """Min of lam1 and lam2 over the run, N, from when both stand; None where they never do or lam is not known."""
    feet = run.lam[:, FEET]
    standing = np.flatnonzero((feet > 0.0).all(axis=1))
    return None if np.isnan(run.lam).any() or not len(standing) else float(feet[standing[0] :].min())


def _wall_lam(run: Trajectory, case: Case) -> float | None:
    return None if np.isnan(run.lam).any() else float(np.max(np.abs(run.lam[:, WALL])))


def _corner_lam(run: Trajectory, case: Case) -> float | None:
    """Max lam3 over the run, between its samples too, N; None where lam is not known."""
    lam = multipliers(run)
    return None if lam is None else float(lam[:, LEFT].max())


METRICS = {
    "mode_order": CaseMetric(
        doc="mode changes in the order of the presentation, before anything else: 5 if all", number=_mode_order
    ),
    "foot_lam": CaseMetric(doc="smallest multiplier of the feet that the slab stands on", unit="N", number=_foot_lam),
    "peak_lam3": CaseMetric(doc="largest multiplier of the left corner", unit="N", number=_corner_lam),
    "wall_lam": CaseMetric(
        doc="largest multiplier of the wall beside the body, which is never reached", unit="N", number=_wall_lam
    ),
}
