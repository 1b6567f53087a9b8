"""Recorded velocities against the change of the recorded positions: the way that is not explained, over the whole.

It asks nothing of the truth or the law, so that it judges engines that follow another one as well.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases.rotations import ways
from crossbody.reports.measuring.equations import finite
from crossbody.reports.measuring.scale import least, of_like

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
STILL = 1e-6  # a coordinate whose way is below this part of the longest of its like rests
TURN = 0.5
"""Angle between samples, rad, beyond which they tell no turn: the rule is off by TURN^2/12 of an axis that goes round,
and by whole turns soon."""


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max over coordinates of |sum of (dq - v dt) sign(v)| / sum of |dq|, v dt by the trapezoidal rule between samples.

    Errors of the rule alternate where the motion bends to and fro; a factor on v does not. What turns in space moves
    about its own axes, as its velocity counts; between samples that are too far apart nothing is told of it. None where
    nothing moves, NaN where a state is no number.
    """
    if len(run.t) < 2:
        return None
    if not finite(run):
        return math.nan
    mean = 0.5 * (run.v[1:] + run.v[:-1])
    moved, rated = ways(run.q, case.quaternions), mean * np.diff(run.t)[:, None]
    for i, at in enumerate(case.quaternions):  # i of them before it have an entry more than rates
        turn = slice(at - i, at - i + 3)
        far = np.linalg.norm(rated[:, turn], axis=1) > TURN
        moved[far, turn] = rated[far, turn] = 0.0
    way = np.sum(np.abs(moved), axis=0)
    off = np.abs(np.sum((moved - rated) * np.sign(mean), axis=0))
    longest = of_like(way, case.velocities)
    moving = (way > STILL * longest) & (longest > least(case.velocities))
    return float(np.max(off[moving] / way[moving])) if moving.any() else None
