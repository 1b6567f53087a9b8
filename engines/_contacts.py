"""Contacts of a scene's shapes by an engine's own poses of the bodies, in NumPy.

Written from the shapes, not from the reference's kernels, so that an engine that uses it is a witness: nearest points
are sought in each shape's own axes, and nothing here knows a second derivative.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.cases.scene import Scene, Shape, Vector
from crossbody.cases.scene_contacts import Contact, contacts

TURN = 1e-3
"""Angle or length over which H is differenced: the fourth power and rounding leave 1e-12 of it."""

Pose = tuple[Floats, Floats]
"""Rotation (3, 3) and position (3,) in the world."""
Poses = Callable[[str], Pose]
"""Body -> its pose."""


@dataclass(frozen=True, slots=True)
class Touch:
    """One place where two shapes may meet.

    Attributes:
        gap: less the pair's margin, m.
        normal (3,): from the first to the second.
        point (3,): of the second, in the world, m.
        first, second: bodies.
    """

    gap: float
    normal: Floats
    point: Floats
    first: str
    second: str


class Contacts:
    """The contacts of a scene, one `Touch` for every row of them, in their order."""

    def __init__(self, scene: Scene) -> None:
        self.all: Sequence[Contact] = contacts(scene)
        self.count = sum(contact.places for contact in self.all)
        shapes = {shape.name: shape for contact in self.all for shape in (contact.first, contact.second)}
        self.shapes = {name: (shape, rotation(shape.orientation)) for name, shape in shapes.items()}

    def touches(self, poses: Poses) -> list[Touch]:
        """Return all of them."""
        placed = {name: _placed(shape, R, poses(shape.body)) for name, (shape, R) in self.shapes.items()}
        return [touch for contact in self.all for touch in _touches(contact, placed)]


def _touches(contact: Contact, placed: Mapping[str, Pose]) -> Iterator[Touch]:
    first, second = contact.first, contact.second
    one, two = placed[first.name], placed[second.name]
    found = _over(one, second, two) if first.type == "plane" else [_between(first, one, second, two)]
    for gap, normal, point in found:
        yield Touch(gap - contact.pair.margin, normal, point, first.body, second.body)


def rotation(quaternion: Vector) -> Floats:
    """Return the rotation matrix of a quaternion, w first, of any length above 0."""
    w, *xyz = np.array(quaternion) / np.linalg.norm(quaternion)
    K = np.cross(np.eye(3), xyz)
    R: Floats = np.eye(3) + 2.0 * w * K + 2.0 * K @ K
    return R


def _placed(shape: Shape, turned: Floats, pose: Pose) -> Pose:
    R, p = pose
    return R @ turned, p + R @ shape.position


def _over(floor: Pose, shape: Shape, at: Pose) -> list[tuple[float, Floats, Floats]]:
    """Gap, normal and lowest point for every place of a shape over a plane."""
    n, points = floor[0][:, 2], np.array(list(_lowest(shape, at[0].T @ floor[0][:, 2])))
    return [(float(n @ (at[0] @ x + at[1] - floor[1])), n, at[0] @ x + at[1]) for x in points]


def _lowest(shape: Shape, n: Floats) -> Iterator[Floats]:
    """Yield lowest points along n, all in the shape's axes."""
    a, b, c = shape.size
    if shape.type == "sphere":
        yield -a * n
    elif shape.type == "ellipsoid":
        yield -(np.square(shape.size) * n) / np.linalg.norm(np.array(shape.size) * n)
    elif shape.type == "box":
        for k in range(8):
            yield np.array([a, b, c]) * [1 if k >> bit & 1 else -1 for bit in range(3)]
    else:
        across = n * [1.0, 1.0, 0.0]
        for end in (-b, b):
            yield np.array([0.0, 0.0, end]) - a * (n if shape.type == "capsule" else across / np.linalg.norm(across))


def _between(one: Shape, at: Pose, two: Shape, by: Pose) -> tuple[float, Floats, Floats]:
    """Gap, normal and point of the second shape: between a sphere or capsule and another shape."""
    start, core = at[1], by[1]
    if one.type == "capsule":
        start, core = _nearest(at, one.size[1], by, two.size[1])
        distance, n = _apart(core - start)
        return distance - one.size[0] - two.size[0], n, core - two.size[0] * n
    if two.type == "capsule":
        core = by[1] + np.clip(by[0][:, 2] @ (start - by[1]), -two.size[1], two.size[1]) * by[0][:, 2]
    if two.type in ("sphere", "capsule"):
        distance, n = _apart(core - start)
        return distance - one.size[0] - two.size[0], n, core - two.size[0] * n
    x = by[0].T @ (start - by[1])
    surface, inside = _nearest_on(two, x)
    depth, out = _apart(x - surface)
    n = -by[0] @ (-out if inside else out)
    return (-depth if inside else depth) - one.size[0], n, by[0] @ surface + by[1]


def _apart(d: Floats) -> tuple[float, Floats]:
    length = float(np.linalg.norm(d))
    return length, d / length


def _nearest_on(shape: Shape, x: Floats) -> tuple[Floats, bool]:
    """Return the nearest point of the surface of a box or cylinder in its axes, and whether x is inside."""
    half = np.array(shape.size)
    if shape.type == "box":
        held = np.clip(x, -half, half)
        if np.any(held != x):
            return held, False
        side = int(np.argmin(half - np.abs(x)))
        held[side] = np.copysign(half[side], x[side])
        return held, True
    radius, rho = half[0], float(np.hypot(x[0], x[1]))
    held = np.array([*(x[:2] * min(1.0, radius / rho if rho > 0.0 else 1.0)), np.clip(x[2], -half[1], half[1])])
    if np.any(held != x):
        return held, False
    if radius - rho < half[1] - abs(x[2]):
        return np.array([*(x[:2] * radius / rho), x[2]]), True
    return np.array([*x[:2], np.copysign(half[1], x[2])]), True


def _nearest(one: Pose, half: float, two: Pose, other: float) -> tuple[Floats, Floats]:
    """Return the nearest points of two segments: the best of the four ends and the common perpendicular."""
    (M, A), (N, B) = ((pose[1], pose[0][:, 2]) for pose in (one, two))
    tried = [(M + s * A, N + np.clip(B @ (M + s * A - N), -other, other) * B) for s in (-half, half)]
    tried += [(M + np.clip(A @ (N + t * B - M), -half, half) * A, N + t * B) for t in (-other, other)]
    s, t = np.linalg.lstsq(np.column_stack([A, -B]), N - M, rcond=None)[0]
    if abs(s) <= half and abs(t) <= other:
        tried.append((M + s * A, N + t * B))
    return min(tried, key=lambda pair: float(np.sum((pair[1] - pair[0]) ** 2)))


def drift(rates: Callable[[float], Floats], v: Floats) -> Floats:
    """Return H' v by a central difference of fourth order along the motion.

    Args:
        rates: time from now along the motion with constant v -> H v there.
        v: velocities (nv,).
    """
    step = TURN / max(float(np.abs(v).max()), 1e-12)
    before, left, right, ahead = (rates(k * step) for k in (-2, -1, 1, 2))
    total: Floats = (before - 8.0 * left + 8.0 * right - ahead) / (12.0 * step)
    return total


def gradient(touch: Touch, velocity: Callable[[str, Floats], Any]) -> Floats:
    """Return dh/dt as a row of the velocities (nv,).

    Args:
        touch: where.
        velocity: body and point in the world -> Jacobian of the point's velocity (3, nv).
    """
    row: Floats = touch.normal @ (velocity(touch.second, touch.point) - velocity(touch.first, touch.point))
    return row
