"""Balls on a line; q_i is the displacement of ball i from its place."""

from __future__ import annotations

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reports.scenes import Parameters, Stage, circle, path, pushes


def _places(p: Parameters) -> Floats:
    return np.arange(int(p["n"])).astype(np.float64) * (2.0 * float(p["radius"]) + float(p["gap"]))


def stage(p: Parameters) -> Stage:
    """A rail and the balls."""
    r, places = float(p["radius"]), _places(p)
    rail = path([(places[0] - 4 * r, -r), (places[-1] + 4 * r, -r)])
    return Stage(still=(rail,), bodies=tuple((circle(0.0, 0.0, r),) for _ in places))


def poses(q: Floats, p: Parameters) -> Floats:
    """Centres of the balls."""
    x = _places(p) + q
    return np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=2)


def arrows(q: Floats, lam: Floats, p: Parameters) -> Floats:
    """Both forces of every pair."""
    return pushes(poses(q, p)[:, :, :2], lam, float(p["radius"]))
