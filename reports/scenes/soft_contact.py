"""A block between two fingers on one axis; q = flange, pads, block, and what controller and sensors keep."""

from __future__ import annotations

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reports.scenes import Parameters, Stage, box, path


def stage(p: Parameters) -> Stage:
    """Table, flange above, a pad on either side, the block."""
    width = float(p["width"])
    thick = 0.12 * width
    pads = tuple((box(side * thick / 2, 0.0, thick, 0.5 * width),) for side in (-1, 1))
    flange = (box(0.0, 0.9 * width, 0.8 * width, 0.25 * width), path([(0.0, 0.775 * width), (0.0, 0.6 * width)]))
    table = path([(-2.2 * width, -0.5 * width), (2.2 * width, -0.5 * width)])
    return Stage(still=(table,), bodies=(flange, *pads, (box(0.0, 0.0, width, width),)))


def poses(q: Floats, p: Parameters) -> Floats:
    """Flange, left pad, right pad, block: they move along x alone."""
    x = q[:, :4]
    return np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=2)


def arrows(q: Floats, lam: Floats, p: Parameters) -> Floats:
    """The block is pushed to the right by the left pad and to the left by the right one."""
    zero = np.zeros(len(q))
    half = 0.5 * float(p["width"])
    left = np.stack([q[:, 3] - half, zero, lam[:, 0], zero], axis=1)
    right = np.stack([q[:, 3] + half, zero, -lam[:, 1], zero], axis=1)
    return np.stack([left, right], axis=1)
