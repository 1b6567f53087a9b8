"""Contacts of a scene's shapes by an engine's own poses of the bodies, in NumPy.

Written from the shapes, not from the reference's kernels, so that an engine that uses it is a witness: nearest points
are sought in each shape's own axes, and nothing here knows a second derivative.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.cases._rotations import matrices
from crossbody.cases.scene import Scene, Shape
from crossbody.cases.scene_contacts import Contact, contacts

NOWHERE = np.zeros(3)
FAR = 1.0
"""m: the gap of a row that is none as its shapes lie."""
TURN = 1e-3
"""Angle or length over which H is differenced: the fourth power and rounding leave 1e-12 of it."""

Pose = tuple[Floats, Floats]
"""Rotation (3, 3) and position (3,) in the world."""
SHARP = 30.0
"""Times the tilt of a cap, or the squared sine at which capsules cross: part of TURN that H is differenced over."""
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
        self.turning = [k for k, contact in enumerate(self.all) if contact.parallel > 0.0]

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.rows)

    def touches(
        self, poses: Poses, rows: Sequence[int] | None = None, along: Mapping[int, bool] | None = None,
        *, clear: float = np.inf,
    ) -> list[Touch]:  # fmt: skip
        """Return those of some rows, or of all.

        Args:
            poses: of the bodies.
            rows: which; all if not given.
            along: of contacts in `turning`, whether the capsules lie along each other; as they do, if not given.
            clear: of shapes whose bounding spheres are further apart, m, that distance stands for every gap, without
                a normal.
        """
        wanted = self.rows if rows is None else [self.rows[i] for i in rows]
        placed: dict[str, Pose] = {}
        found = {
            k: self._touches(self.all[k], self._poses(self.all[k], poses, placed), (along or {}).get(k), clear)
            for k in dict.fromkeys(k for k, _ in wanted)
        }
        return [found[k][place] for k, place in wanted]

    def lying(self, poses: Poses, rows: Sequence[int]) -> tuple[dict[int, bool], float]:
        """Return of the capsules of some rows whether they lie along each other, and over what H may be differenced.

        The nearest points of axes that cross at a small angle a run along them in a turn of the size of a^2, the lowest
        of a cap round it in one of its tilt.
        """
        placed: dict[str, Pose] = {}
        found, least = {}, 1.0
        for k in {self.rows[i][0] for i in rows}.intersection(self.turning):
            at = self._poses(self.all[k], poses, placed)
            found[k] = _along(self.all[k], *at)
            if self.all[k].first.type == "plane":
                least = least if found[k] else min(least, _tilt(*at))
            elif not found[k] and np.less_equal(*_overlap(self.all[k], *at)):  # else ends are nearest
                least = min(least, _crossing(*at) ** 2)
        return found, TURN * min(1.0, SHARP * least)

    def _poses(self, contact: Contact, poses: Poses, placed: dict[str, Pose]) -> tuple[Pose, Pose]:
        for shape in (contact.first, contact.second):
            if shape.name not in placed:
                placed[shape.name] = _placed(shape, self.shapes[shape.name][1], poses(shape.body))
        return placed[contact.first.name], placed[contact.second.name]

    def _touches(self, contact: Contact, at: tuple[Pose, Pose], along: bool | None, clear: float) -> list[Touch]:
        first, second, (one, two) = contact.first, contact.second, at
        if clear < np.inf and first.type != "plane":
            free = math.dist(one[1], two[1]) - _bound(first) - _bound(second) - contact.pair.margin
            if free > clear:
                return [Touch(free, NOWHERE, two[1], first.body, second.body)] * contact.places
        if first.type == "plane":
            side_by_side = _along(contact, one, two) if along is None and contact.parallel > 0.0 else bool(along)
            found = _over(one, second, two, side_by_side)
        elif first.type == "capsule":
            found = _capsules(contact, one, two, along)
        else:
            found = [_between(first, one, second, two)]
        return [Touch(gap - contact.pair.margin, n, point, first.body, second.body) for gap, n, point in found]


def _bound(shape: Shape) -> float:
    """Return the radius of a sphere about a shape's centre that holds it."""
    a, b, c = shape.size
    outer = {"sphere": a, "capsule": a + b, "cylinder": math.hypot(a, b)}
    return outer.get(shape.type, math.sqrt(a * a + b * b + c * c))


def _placed(shape: Shape, turned: Floats, pose: Pose) -> Pose:
    R, p = pose
    return R @ turned, p + R @ shape.position


SIGNS = np.array([[1.0 if k >> bit & 1 else -1.0 for bit in range(3)] for k in range(8)])
"""Of the corners of a box, in the order of their rows."""


def _over(floor: Pose, shape: Shape, at: Pose, stands: bool) -> list[tuple[float, Floats, Floats]]:
    """Gap, normal and lowest point for every place of a shape over a plane."""
    n = floor[0][:, 2]
    own = at[0].T @ n
    points = (_rim(shape, own) if stands else _lowest(shape, own)) @ at[0].T + at[1]
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
    ends = np.array([[0.0, 0.0, -b], [0.0, 0.0, b]])
    if shape.type == "capsule":
        return ends - a * n
    side = a * np.array([n[0], n[1], 0.0]) / np.hypot(n[0], n[1])
    return np.array([ends[0] - side, ends[0] + side, ends[1] - side, ends[1] + side])


def _rim(shape: Shape, n: Floats) -> Floats:
    """Return four points (4, 3) of the rim on which a cylinder stands along n, in its axes."""
    r, half, _ = shape.size
    return np.array([[x, y, -np.copysign(half, n[2])] for x, y in ((r, 0.0), (0.0, r), (-r, 0.0), (0.0, -r))])


def _tilt(floor: Pose, at: Pose) -> float:
    """Sine of the angle between a plane's normal and the axis of a cylinder over it."""
    return float(np.linalg.norm((at[0].T @ floor[0][:, 2])[:2]))


def _between(one: Shape, at: Pose, two: Shape, by: Pose) -> tuple[float, Floats, Floats]:
    """Gap, normal and point of the second shape: between a sphere and another shape."""
    start, core = at[1], by[1]
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


def _capsules(contact: Contact, at: Pose, by: Pose, along: bool | None) -> list[tuple[float, Floats, Floats]]:
    """Gap, normal and point of the second of two capsules: where they end if they lie along each other, else nearest.

    The row that is none then is far.
    """
    one, two = contact.first, contact.second
    lengths = at, one.size[1], by, two.size[1]
    side_by_side = _along(contact, at, by) if along is None else along
    pairs = [_end(*lengths, sign) for sign in (-1.0, 1.0)] if side_by_side else [_nearest(*lengths)]
    found: list[tuple[float, Floats, Floats]] = []
    for start, core in pairs:
        distance, n = _apart(core - start)
        found.append((distance - one.size[0] - two.size[0], n, core - two.size[0] * n))
    return found if side_by_side else [*found, (FAR + contact.pair.margin, np.zeros(3), at[1])]


def _along(contact: Contact, at: Pose, by: Pose) -> bool:
    """Whether two capsules lie beside each other, and along, or a cylinder stands."""
    if contact.first.type == "plane":
        return _tilt(at, by) <= contact.parallel
    low, high = _overlap(contact, at, by)
    return low <= high and _crossing(at, by) <= contact.parallel


def _crossing(at: Pose, by: Pose) -> float:
    """Sine of the angle at which the axes of two capsules cross, seen along what is nearest between them."""
    (M, A), (N, B) = ((pose[1], pose[0][:, 2]) for pose in (at, by))
    apart = (N - M) - A @ (N - M) * A
    length = float(np.linalg.norm(apart))
    return abs(float(np.linalg.det([A, B, apart]))) / length if length > 0.0 else float(np.linalg.norm(np.cross(A, B)))


def _overlap(contact: Contact, at: Pose, by: Pose) -> tuple[float, float]:
    """From where to where along the first of two capsules the second lies beside it."""
    half, middle = contact.first.size[1], float(at[0][:, 2] @ (by[1] - at[1]))
    reach = abs(float(at[0][:, 2] @ by[0][:, 2])) * contact.second.size[1]
    return max(-half, middle - reach), min(half, middle + reach)


def end_of(contact: Contact, at: Pose, by: Pose, point: Floats) -> int:
    """Return at which of two capsules' places, or of a cylinder's over a plane, a point is where they meet."""
    if contact.first.type == "plane":
        x, n = by[0].T @ (point - by[1]), by[0].T @ at[0][:, 2]
        if _along(contact, at, by):
            return int(np.round(np.arctan2(x[1], x[0]) / (0.5 * np.pi))) % 4
        return 2 * int(x[2] > 0.0) + int(x[:2] @ n[:2] > 0.0)
    return int(_along(contact, at, by) and at[0][:, 2] @ (point - at[1]) > 0.5 * sum(_overlap(contact, at, by)))


def _end(one: Pose, half: float, two: Pose, other: float, sign: float) -> tuple[Floats, Floats]:
    """Return nearest points where two segments that lie side by side end: the nearer of an end and its foot."""
    (M, A), (N, B) = ((pose[1], pose[0][:, 2]) for pose in (one, two))
    E, F = M + sign * half * A, N + np.copysign(other, sign * (A @ B)) * B
    tried = [(E, N + np.clip(B @ (E - N), -other, other) * B), (M + np.clip(A @ (F - M), -half, half) * A, F)]
    return min(tried, key=lambda pair: float(np.sum((pair[1] - pair[0]) ** 2)))


def _nearest(one: Pose, half: float, two: Pose, other: float) -> tuple[Floats, Floats]:
    """Return the nearest points of two segments: the best of the four ends and the common perpendicular."""
    (M, A), (N, B) = ((pose[1], pose[0][:, 2]) for pose in (one, two))
    tried = [(M + s * A, N + np.clip(B @ (M + s * A - N), -other, other) * B) for s in (-half, half)]
    tried += [(M + np.clip(A @ (N + t * B - M), -half, half) * A, N + t * B) for t in (-other, other)]
    s, t = np.linalg.lstsq(np.column_stack([A, -B]), N - M, rcond=None)[0]
    if abs(s) <= half and abs(t) <= other:
        tried.append((M + s * A, N + t * B))
    return min(tried, key=lambda pair: float(np.sum((pair[1] - pair[0]) ** 2)))


def drift(rates: Callable[[float], Floats], v: Floats, turn: float = TURN) -> Floats:
    """Return H' v by a central difference of fourth order along the motion.

    Args:
        rates: time from now along the motion with constant v -> H v there.
        v: velocities (nv,).
        turn: angle or length over which they are.
    """
    step = turn / max(float(np.abs(v).max()), 1e-12)
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
