"""Poses, boxes about shapes, and masses of many parts as one, whatever an engine calls them."""

from __future__ import annotations

from typing import Any

import numpy as np

from .conventions import rotation

VIEWS = [rotation(q) for q in ((1, 0, 0, 0), (0.8, 0.3, -0.5, 0.2), (0.6, -0.4, 0.1, 0.7), (0.5, 0.2, 0.6, -0.3))]


def posed(p: Any, R: Any) -> Any:
    """Return a pose as lists."""
    return [np.asarray(p, dtype=float).tolist(), np.asarray(R, dtype=float).tolist()]


def boxes(kind: str, size: Any, points: Any, p: Any, R: Any, frame: Any) -> list[list[float]]:
    """Return `bounds` of a shape from four sides of a frame (p, R): one would hide how it stands."""
    origin, axes = (np.asarray(part, dtype=float) for part in frame)
    place, turn = axes.T @ (np.asarray(p, dtype=float) - origin), axes.T @ np.asarray(R, dtype=float)
    return [bounds(kind, size, points, view @ place, view @ turn) for view in VIEWS]


def bounds(kind: str, size: Any, points: Any, p: Any, R: Any) -> list[float]:
    """Return lowest and highest x, y and z of a shape: the same for every way of writing it.

    Args:
        kind: sphere, capsule, cylinder, box, ellipsoid or plane; of any other the points count.
        size: radius; radius and half length along z; half sides; semi-axes, m.
        points: of a mesh (n, 3), in its own axes.
        p: where it stands (3,).
        R: how it is turned (3, 3).

    Returns:
        (6,); of a plane, which has no bounds, its normal and the distance along it, twice.
    """
    p, R = np.asarray(p, dtype=float), np.asarray(R, dtype=float)
    if kind == "plane":
        return [*R[:, 2], *[float(R[:, 2] @ p)] * 3]
    if kind in ("sphere", "capsule", "cylinder", "box", "ellipsoid"):
        a, b, c = (np.abs(R[:, k]) for k in range(3))
        x, y, z = (float(one) for one in (*size, 0.0, 0.0, 0.0)[:3])
        reach: dict[str, Any] = {
            "sphere": lambda: np.full(3, x), "capsule": lambda: x + y * c,
            "cylinder": lambda: x * np.hypot(a, b) + y * c,
            "box": lambda: x * a + y * b + z * c, "ellipsoid": lambda: np.linalg.norm(R * [x, y, z], axis=1),
        }  # fmt: skip
        far = reach[kind]()
        return [*(p - far).tolist(), *(p + far).tolist()]
    at = p + np.asarray(points, dtype=float).reshape(-1, 3) @ R.T if len(points) else p[None]
    return [*at.min(axis=0).tolist(), *at.max(axis=0).tolist()]


def composite(parts: Any, p: Any, R: Any) -> list[float]:
    """Return mass, centre and inertia about it of parts in a frame."""
    p, R = np.asarray(p), np.asarray(R)
    if not (mass := sum(part[1] for part in parts)):
        return [0.0, *np.zeros(9)]
    centre = sum(part[1] * np.asarray(part[2]) for part in parts) / mass
    J = np.zeros((3, 3))
    for _, m, c, about in parts:
        d = np.asarray(c) - centre
        J += np.asarray(about) + m * (d @ d * np.eye(3) - np.outer(d, d))
    turned = R.T @ J @ R
    return [float(mass), *(R.T @ (centre - p)).tolist(), *turned[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()]
