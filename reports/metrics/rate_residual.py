"""Recorded velocities against the change of the recorded positions: the way that is not explained, over the whole.

It asks nothing of the truth or the law, so that it judges engines that follow another one as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.scale import least, of_like

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
STILL = 1e-6
"""A coordinate whose way is below this part of the longest of its like rests."""


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max over coordinates of |sum of (dq - v dt) sign(v)| / sum of |dq|, v dt by the trapezoidal rule between samples.

    Errors of the rule alternate where the motion bends to and fro; a factor on v does not. None where nothing moves,
    and for coordinates whose rates are not v.
    """
    if run.q.shape[1] != run.v.shape[1] or len(run.t) < 2:
        return None
    mean = 0.5 * (run.v[1:] + run.v[:-1])
    moved = np.diff(run.q, axis=0)
    way = np.sum(np.abs(moved), axis=0)
    off = np.abs(np.sum((moved - mean * np.diff(run.t)[:, None]) * np.sign(mean), axis=0))
    longest = of_like(way, case.coordinates)
    moving = (way > STILL * longest) & (longest > least(case.coordinates))
    return float(np.max(off[moving] / way[moving])) if moving.any() else None
