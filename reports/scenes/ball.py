"""A ball above a floor; q is the height of its lowest point."""

from __future__ import annotations

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reports.scenes import Parameters, Stage, circle, path

SIZE = 0.12  # radius over the height of the fall: the ball of the case is a point


def _radius(p: Parameters) -> float:
    return SIZE * max(float(p["height"]), 1e-6)


def stage(p: Parameters) -> Stage:
    """Floor and ball, with a mark that would show a turn."""
    r = _radius(p)
    return Stage(still=(path([(-4 * r, 0.0), (4 * r, 0.0)]),), bodies=((circle(0.0, 0.0, r),),))


def poses(q: Floats, p: Parameters) -> Floats:
    """Centre of the ball."""
    zero = np.zeros(len(q))
    return np.stack([zero, q[:, 0] + _radius(p), zero], axis=1)[:, None, :]


def arrows(q: Floats, lam: Floats, p: Parameters) -> Floats:
    """The floor's force at the lowest point."""
    zero = np.zeros(len(q))
    return np.stack([zero, q[:, 0], zero, lam[:, 0]], axis=1)[:, None, :]
