"""Balls on strings side by side; q_i is the angle of string i, counter-clockwise from hanging."""

from __future__ import annotations

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reports.scenes import Parameters, Stage, circle, path, pushes


def _pivots(p: Parameters) -> Floats:
    return np.arange(int(p["n"])).astype(np.float64) * (2.0 * float(p["radius"]) + float(p["gap"]))


def stage(p: Parameters) -> Stage:
    """The beam, strings and balls."""
    r, pivots = float(p["radius"]), _pivots(p)
    return Stage(
        still=(path([(pivots[0] - 2 * r, 0.0), (pivots[-1] + 2 * r, 0.0)]),),
        bodies=tuple((circle(0.0, 0.0, r),) for _ in pivots),
        threads=tuple((float(x), 0.0, i) for i, x in enumerate(pivots)),
    )


def poses(q: Floats, p: Parameters) -> Floats:
    """c_i = (i D + L sin q_i, -L cos q_i), turned by q_i."""
    length = float(p["length"])
    return np.stack([_pivots(p) + length * np.sin(q), -length * np.cos(q), q], axis=2)


def arrows(q: Floats, lam: Floats, p: Parameters) -> Floats:
    """Both forces of every pair."""
    return pushes(poses(q, p)[:, :, :2], lam, float(p["radius"]))
