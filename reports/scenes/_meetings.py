"""Where two shapes of a scene would meet, and along which normal, at every sample at once."""

from __future__ import annotations

import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.cases.scene import Shape
from crossbody.cases.scene_contacts import LEVEL, parallel
from crossbody.reports.scenes._kinematics import Pose

Placed = tuple[Shape, Pose]
"""A shape and its pose in the world."""

UP = np.array([0.0, 0.0, 1.0])


def meeting(first: Placed, second: Placed, place: int) -> tuple[Floats, Floats]:
    """Return the point (n, 3), m, and the unit normal (n, 3) from the first shape to the second.

    Args:
        first: shape of a contact, from which its normal leads.
        second: the other.
        place: which of its places: end of a capsule, point of a cylinder's caps, corner of a box.
    """
    if first[0].type == "plane":
        normal = first[1][1][:, :, 2]
        if second[0].type == "cylinder":
            return _on_rim(second, place, normal), normal
        return _lowest(second, place, normal), normal
    if first[0].type == "sphere":
        centre, radius = first[1][0], first[0].size[0]
        normal = _unit(_nearest(second, centre) - centre)
        return centre + radius * normal, normal
    one, two = _segments(first, second)
    start, end = _ends(first, second, 1.0 if place else -1.0)
    along = (_crossing(first, second) <= parallel(first[0], second[0]))[:, None]
    one, two = np.where(along, start, one), np.where(along, end, two)
    normal = _unit(two - one)
    return two - second[0].size[0] * normal, normal


def _lowest(solid: Placed, place: int, normal: Floats) -> Floats:
    """Return the point of a solid that is lowest along a normal, for one of its places."""
    shape, (centre, rotation) = solid
    size, signs = np.asarray(shape.size), np.array([1.0 if place >> bit & 1 else -1.0 for bit in range(3)])
    n = _inside(rotation, normal)
    if shape.type == "sphere":
        local = -size[0] * n
    elif shape.type == "capsule":
        local = signs[0] * size[1] * UP - size[0] * n
    elif shape.type == "box":
        local = np.tile(signs * size, (len(n), 1))
    else:
        local = -size * _unit(size * n)
    return centre + _outside(rotation, local)


def _on_rim(solid: Placed, place: int, normal: Floats) -> Floats:
    """Return the lowest or highest point of a cylinder's cap, or where it stands one of four points of its rim."""
    shape, (centre, rotation) = solid
    (r, half, _), n = shape.size, _inside(rotation, normal)
    across = n * (1.0 - UP)
    cap, side = (1.0 if place >> 1 & 1 else -1.0), (1.0 if place & 1 else -1.0)
    tilted = cap * half * UP + side * r * _unit(across)
    angle = 0.5 * np.pi * place
    standing = r * np.array([np.cos(angle), np.sin(angle), 0.0]) - half * np.sign(n) * UP
    level = np.linalg.norm(across, axis=1, keepdims=True) <= LEVEL
    return centre + _outside(rotation, np.where(level, standing, tilted))


def _nearest(solid: Placed, point: Floats) -> Floats:
    """Return the point of a solid that is nearest to a point outside of it; of a round one, on its core."""
    shape, (centre, rotation) = solid
    size, local = shape.size, _inside(rotation, point - centre)
    if shape.type == "sphere":
        local = np.zeros_like(local)
    elif shape.type == "box":
        local = np.clip(local, -np.asarray(size), size)
    else:
        round_ = np.linalg.norm(local[:, :2], axis=1, keepdims=True)
        core = 0.0 if shape.type == "capsule" else np.minimum(1.0, size[0] / np.maximum(round_, 1e-300))
        local = np.concatenate([core * local[:, :2], np.clip(local[:, 2:], -size[1], size[1])], axis=1)
    return centre + _outside(rotation, local)


def _segments(first: Placed, second: Placed) -> tuple[Floats, Floats]:
    """Return the nearest points of the axes of two capsules.

    The distance is convex in both parameters: where the free minimum lies outside of a segment, an end is nearest.
    """
    (one, (a, R)), (two, (b, S)) = first, second
    u, w, apart = R[:, :, 2], S[:, :, 2], b - a
    c, d, e = (np.sum(left * right, axis=1) for left, right in ((u, w), (u, apart), (w, apart)))
    along = np.clip((d - c * e) / np.maximum(1.0 - c * c, 1e-12), -one.size[1], one.size[1])
    other = np.clip(c * along - e, -two.size[1], two.size[1])
    along = np.clip(c * other + d, -one.size[1], one.size[1])
    return a + along[:, None] * u, b + other[:, None] * w


def _ends(first: Placed, second: Placed, sign: float) -> tuple[Floats, Floats]:
    """Return where the axes of two capsules that lie along each other end: the nearer of an end and its foot."""
    (one, (a, R)), (two, (b, S)) = first, second
    u, w = R[:, :, 2], S[:, :, 2]
    side = sign * np.where(np.sum(u * w, axis=1, keepdims=True) > 0.0, 1.0, -1.0)
    end, other = a + sign * one.size[1] * u, b + side * two.size[1] * w
    foot = b + np.clip(np.sum(w * (end - b), axis=1, keepdims=True), -two.size[1], two.size[1]) * w
    back = a + np.clip(np.sum(u * (other - a), axis=1, keepdims=True), -one.size[1], one.size[1]) * u
    further = np.linalg.norm(foot - end, axis=1) <= np.linalg.norm(other - back, axis=1)
    return np.where(further[:, None], end, back), np.where(further[:, None], foot, other)


def _crossing(first: Placed, second: Placed) -> Floats:
    """Return the sine (n,) of the angle at which the axes of two capsules cross, seen along what is between them."""
    (_, (a, R)), (_, (b, S)) = first, second
    u, w = R[:, :, 2], S[:, :, 2]
    across = b - a - np.sum(u * (b - a), axis=1, keepdims=True) * u
    found: Floats = np.abs(np.sum(np.cross(u, w) * _unit(across), axis=1))
    return found


def _inside(rotation: Floats, world: Floats) -> Floats:
    """Return vectors (n, 3) of the world in the axes of a body."""
    found: Floats = np.einsum("nji,nj->ni", rotation, world)
    return found


def _outside(rotation: Floats, local: Floats) -> Floats:
    """Return vectors (n, 3) of a body's axes in the world."""
    found: Floats = np.einsum("nij,nj->ni", rotation, local)
    return found


def _unit(vectors: Floats) -> Floats:
    found: Floats = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)
    return found
