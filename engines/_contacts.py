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
        self.capsules = {k for k in self.turning if self.all[k].first.type == "capsule"}

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
            clear: of shapes that are further apart, m, no normal is sought; of other shapes than capsules the distance
                of their bounding spheres stands for every gap then.
        """
        wanted = self.rows if rows is None else [self.rows[i] for i in rows]
        placed: dict[str, Pose] = {}
        at = {k: self._poses(self.all[k], poses, placed) for k in dict.fromkeys(k for k, _ in wanted)}
        lie = along or {}
        together = [k for k in at if k in self.capsules]
        found = dict(zip(together, self._all_capsules(together, at, lie, clear), strict=True))
        found |= {k: self._touches(self.all[k], at[k], lie.get(k), clear) for k in at if k not in self.capsules}
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
            elif not found[k] and self._beside(self.all[k], *at):  # else ends are nearest
                least = min(least, float(_crossing(*at)) ** 2)
        return found, TURN * min(1.0, SHARP * least)

    def _beside(self, contact: Contact, at: Pose, by: Pose) -> bool:
        return bool(np.less_equal(*_overlap(at, contact.first.size[1], by, contact.second.size[1])))

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
        else:
            found = [_between(first, one, second, two)]
        return [Touch(gap - contact.pair.margin, n, point, first.body, second.body) for gap, n, point in found]

    def _all_capsules(
        self, which: Sequence[int], at: Mapping[int, tuple[Pose, Pose]], along: Mapping[int, bool], clear: float
    ) -> list[list[Touch]]:
        """Return the two touches of every pair of capsules, of all pairs at once: most of a robot's shapes are some."""
        if not which:
            return []
        pairs = [self.all[k] for k in which]
        one, two = (
            (np.array([at[k][side][0] for k in which]), np.array([at[k][side][1] for k in which])) for side in (0, 1)
        )
        gaps, normals, points = _capsules(pairs, one, two, [along.get(k) for k in which])
        normals[gaps > clear] = 0.0
        return [
            [
                Touch(float(gap) - pair.pair.margin, n, point, pair.first.body, pair.second.body)
                for gap, n, point in zip(*places, strict=True)
            ]
            for pair, *places in zip(pairs, gaps, normals, points, strict=True)
        ]


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


def _capsules(
    pairs: Sequence[Contact], at: Pose, by: Pose, along: Sequence[bool | None]
) -> tuple[Floats, Floats, Floats]:
    """Return gaps (n, 2), normals and points of the second (n, 2, 3) of pairs of capsules.

    They are where the two end if they lie along each other; else where they are nearest, and a row that is none is far.

    Args:
        pairs: n pairs.
        at: poses of the first capsules, (n, 3, 3) and (n, 3).
        by: those of the second.
        along: whether each pair lies along; as it does, if None.
    """
    radius, half = np.array([pair.first.size[:2] for pair in pairs]).T
    width, other = np.array([pair.second.size[:2] for pair in pairs]).T
    low, high = _overlap(at, half, by, other)
    lie = (low <= high) & (_crossing(at, by) <= [pair.parallel for pair in pairs])
    lie = np.array([seen if given is None else given for seen, given in zip(lie.tolist(), along, strict=True)])
    segments, none = (at, half, by, other), ~lie
    starts, ends = (np.repeat(pose[1][:, None], 2, axis=1) for pose in (at, by))
    if none.any():
        starts[none, 0], ends[none, 0] = (points[none] for points in _nearest(*segments))
    for place, sign in enumerate((-1.0, 1.0) if lie.any() else ()):
        starts[lie, place], ends[lie, place] = (points[lie] for points in _end(*segments, sign))
    apart = ends - starts
    distance = np.sqrt(_dot(apart, apart))
    with np.errstate(invalid="ignore"):  # axes that meet have no normal
        normals = apart / distance[..., None]
    gaps = distance - (radius + width)[:, None]
    margins = np.array([pair.pair.margin for pair in pairs])
    gaps[none, 1], normals[none, 1] = FAR + margins[none], 0.0
    return gaps, normals, ends - width[:, None, None] * normals


def _along(contact: Contact, at: Pose, by: Pose) -> bool:
    """Whether two capsules lie beside each other, and along, or a cylinder stands."""
    if contact.first.type == "plane":
        return _tilt(at, by) <= contact.parallel
    low, high = _overlap(at, contact.first.size[1], by, contact.second.size[1])
    return bool(low <= high and _crossing(at, by) <= contact.parallel)


def _axes(one: Pose, two: Pose) -> tuple[Floats, Floats, Floats]:
    """Return the axes of two capsules and the way between their centres, each (..., 3)."""
    return one[0][..., 2], two[0][..., 2], two[1] - one[1]


def _dot(a: Floats, b: Floats) -> Floats:
    total: Floats = np.sum(a * b, axis=-1)
    return total


def _crossing(at: Pose, by: Pose) -> Floats:
    """Sine of the angle at which the axes of two capsules cross, seen along what is nearest between them."""
    A, B, way = _axes(at, by)
    apart = way - _dot(A, way)[..., None] * A
    across, length = np.cross(A, B), np.sqrt(_dot(apart, apart))
    seen = np.abs(_dot(across, apart)) / np.where(length > 0.0, length, 1.0)
    return np.where(length > 0.0, seen, np.sqrt(_dot(across, across)))


def _overlap(at: Pose, half: Any, by: Pose, other: Any) -> tuple[Floats, Floats]:
    """From where to where along the first of two capsules the second lies beside it."""
    A, B, way = _axes(at, by)
    middle, reach = _dot(A, way), np.abs(_dot(A, B)) * other
    return np.maximum(-half, middle - reach), np.minimum(half, middle + reach)


def end_of(contact: Contact, at: Pose, by: Pose, point: Floats) -> int:
    """Return at which of two capsules' places, or of a cylinder's over a plane, a point is where they meet."""
    if contact.first.type == "plane":
        x, n = by[0].T @ (point - by[1]), by[0].T @ at[0][:, 2]
        if _along(contact, at, by):
            return int(np.round(np.arctan2(x[1], x[0]) / (0.5 * np.pi))) % 4
        return 2 * int(x[2] > 0.0) + int(x[:2] @ n[:2] > 0.0)
    low, high = _overlap(at, contact.first.size[1], by, contact.second.size[1])
    return int(_along(contact, at, by) and at[0][:, 2] @ (point - at[1]) > 0.5 * (low + high))


def _end(one: Pose, half: Floats, two: Pose, other: Floats, sign: float) -> tuple[Floats, Floats]:
    """Return nearest points (n, 3) where segments that lie side by side end: the nearer of an end and its foot."""
    A, B, _ = _axes(one, two)
    toward = np.copysign(other, sign * _dot(A, B))
    return _closest([_foot(one, sign * half, two, other), _foot(two, toward, one, half)[::-1]])


def _nearest(one: Pose, half: Floats, two: Pose, other: Floats) -> tuple[Floats, Floats]:
    """Return the nearest points (n, 3) of segments: the best of the four ends and the common perpendicular."""
    tried = [_foot(one, sign * half, two, other) for sign in (-1.0, 1.0)]
    tried += [_foot(two, sign * other, one, half)[::-1] for sign in (-1.0, 1.0)]
    A, B, way = _axes(one, two)
    across = np.cross(A, B)
    square = _dot(across, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = (_dot(np.cross(way, axis), across) / square for axis in (B, A))
    inside = (square > 0.0) & (np.abs(s) <= half) & (np.abs(t) <= other)
    s, t = np.where(inside, s, half), np.where(inside, t, other)
    return _closest([*tried, (one[1] + s[:, None] * A, two[1] + t[:, None] * B)])


def _foot(one: Pose, along: Floats, two: Pose, half: Floats) -> tuple[Floats, Floats]:
    """Return points (n, 3) of segments, and what is nearest to them on others."""
    E, B = one[1] + along[:, None] * one[0][..., 2], two[0][..., 2]
    return E, two[1] + np.clip(_dot(B, E - two[1]), -half, half)[:, None] * B


def _closest(tried: Sequence[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    """Return of pairs of points (n, 3) for each place the pair that is nearest."""
    best = np.argmin([_dot(b - a, b - a) for a, b in tried], axis=0)
    starts, ends = (np.array([pair[side] for pair in tried])[best, np.arange(len(best))] for side in (0, 1))
    return starts, ends


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
