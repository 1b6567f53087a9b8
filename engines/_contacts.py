"""Contacts of a scene's shapes by an engine's own poses of the bodies, in NumPy.

Written from the shapes, not from the reference's kernels, so that an engine that uses it is a witness: nearest points
are sought in each shape's own axes, and nothing here knows a second derivative.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.cases._rotations import matrices
from crossbody.cases.scene import Scene, Shape
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
    """The contacts of a scene, one `Touch` for every row of them, in their order.

    Attributes:
        all: of the scene.
        rows: of every row its contact's place in `all`, and its own within the contact.
    """

    def __init__(self, scene: Scene) -> None:
        self.all: Sequence[Contact] = contacts(scene)
        self.rows = [(k, place) for k, contact in enumerate(self.all) for place in range(contact.places)]
        shapes = {shape.name: shape for contact in self.all for shape in (contact.first, contact.second)}
        self.shapes = {name: (shape, matrices(np.array(shape.orientation))) for name, shape in shapes.items()}

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.rows)

    def touches(self, poses: Poses, rows: Sequence[int] | None = None) -> list[Touch]:
        """Return those of some rows, or of all."""
        wanted = self.rows if rows is None else [self.rows[i] for i in rows]
        placed: dict[str, Pose] = {}
        found = {k: self._touches(self.all[k], poses, placed) for k in dict.fromkeys(k for k, _ in wanted)}
        return [found[k][place] for k, place in wanted]

    def _touches(self, contact: Contact, poses: Poses, placed: dict[str, Pose]) -> list[Touch]:
        first, second = contact.first, contact.second
        for shape in (first, second):
            if shape.name not in placed:
                placed[shape.name] = _placed(shape, self.shapes[shape.name][1], poses(shape.body))
        one, two = placed[first.name], placed[second.name]
        found = _over(one, second, two) if first.type == "plane" else [_between(first, one, second, two)]
        return [Touch(gap - contact.pair.margin, n, point, first.body, second.body) for gap, n, point in found]


def _placed(shape: Shape, turned: Floats, pose: Pose) -> Pose:
    R, p = pose
    return R @ turned, p + R @ shape.position


SIGNS = np.array([[1.0 if k >> bit & 1 else -1.0 for bit in range(3)] for k in range(8)])
"""Of the corners of a box, in the order of their rows."""


def _over(floor: Pose, shape: Shape, at: Pose) -> list[tuple[float, Floats, Floats]]:
    """Gap, normal and lowest point for every place of a shape over a plane."""
    n = floor[0][:, 2]
    points = _lowest(shape, at[0].T @ n) @ at[0].T + at[1]
    gaps: list[float] = ((points - floor[1]) @ n).tolist()
    return [(gap, n, point) for gap, point in zip(gaps, points, strict=True)]


def _lowest(shape: Shape, n: Floats) -> Floats:
    """Return the lowest points (places, 3) along n, all in the shape's axes."""
    a, b, _ = shape.size
    if shape.type == "sphere":
        return -a * n[None]
    if shape.type == "ellipsoid":
        scaled = np.array(shape.size) * n
        return -(shape.size * scaled / np.sqrt(scaled @ scaled))[None]
    if shape.type == "box":
        return SIGNS * shape.size
    side = n if shape.type == "capsule" else np.array([n[0], n[1], 0.0]) / np.hypot(n[0], n[1])
    return np.array([[0.0, 0.0, -b], [0.0, 0.0, b]]) - a * side


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
