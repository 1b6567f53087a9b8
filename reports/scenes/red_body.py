"""A box on a slab on two feet, beside a wall; q = centre and angle of the box, then of the slab."""

from __future__ import annotations

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reports.scenes import Parameters, Stage, box, path


def stage(p: Parameters) -> Stage:
    """Floor, wall, box, and slab with its feet."""
    a, b, half, d = (float(p[k]) for k in ("half_width", "half_height", "slab_half_length", "slab_half_height"))
    wall = float(p["wall"])
    foot, size = float(p["foot"]), 0.6 * d
    still = [path([(-1.5 * half, 0.0), (1.5 * half, 0.0)])]
    if wall < 4 * half:
        still.append(path([(wall, 0.0), (wall, 4 * b)]))
    feet = tuple(path([(s * foot - size, 0.0), (s * foot, -d), (s * foot + size, 0.0)], closed=True) for s in (-1, 1))
    slab = (path([(-half, -0.4 * d), (half, -0.4 * d), (half, d), (-half, d)], closed=True), *feet)
    return Stage(still=tuple(still), bodies=((box(0.0, 0.0, 2 * a, 2 * b),), slab))


def poses(q: Floats, p: Parameters) -> Floats:
    """The coordinates themselves."""
    return q.reshape(len(q), 2, 3)


def arrows(q: Floats, lam: Floats, p: Parameters) -> Floats:
    """Feet upwards; lower corners along the slab's normal; the wall leftwards at the upper right."""
    a, b, d, foot = (float(p[k]) for k in ("half_width", "half_height", "slab_half_height", "foot"))
    box_, slab = q[:, :3], q[:, 3:]
    normal = np.stack([-np.sin(slab[:, 2]), np.cos(slab[:, 2])], axis=1)
    up, left = np.broadcast_to([0.0, 1.0], normal.shape), np.broadcast_to([-1.0, 0.0], normal.shape)
    points = [_at(slab, -foot, -d), _at(slab, foot, -d), _at(box_, -a, -b), _at(box_, a, -b), _at(box_, a, b)]
    pushes = [up, up, normal, normal, left]
    pairs = zip(points, pushes, strict=True)
    return np.stack([np.concatenate([x, n * lam[:, [k]]], axis=1) for k, (x, n) in enumerate(pairs)], axis=1)


def _at(pose: Floats, x: float, y: float) -> Floats:
    """A point of a body (n, 2)."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    return np.stack([pose[:, 0] + c * x - s * y, pose[:, 1] + s * x + c * y], axis=1)
