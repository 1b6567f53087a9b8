"""Contacts of a scene's shapes by an engine's own poses of the bodies, in NumPy.

Written from the shapes, not from the reference's kernels, so that an engine that uses it is a witness: nearest points
are sought in each shape's own axes, and nothing here knows a second derivative.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases._arrays import Floats
from crossbody.cases._rotations import matrices
from crossbody.cases.scene import Scene, Shape
from crossbody.cases.scene_contacts import Contact, contacts

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
        self.kinds = [(contact.first.type, contact.second.type) for contact in self.all]

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
            clear: of shapes that are further apart, m, no normal is given.
        """
        wanted = self.rows if rows is None else [self.rows[i] for i in rows]
        placed: dict[str, Pose] = {}
        at = {k: self._poses(self.all[k], poses, placed) for k in dict.fromkeys(k for k, _ in wanted)}
        lie = along or {}
        found: dict[int, list[Touch]] = {}
        for kind in dict.fromkeys(self.kinds[k] for k in at):
            together = [k for k in at if self.kinds[k] == kind]
            if kind[0] == "plane":
                found |= {k: self._on_plane(self.all[k], *at[k], lie.get(k)) for k in together}
            else:
                found |= zip(together, self._between(together, at, lie, clear), strict=True)
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

    def _on_plane(self, contact: Contact, floor: Pose, at: Pose, along: bool | None) -> list[Touch]:
        first, second = contact.first, contact.second
        stands = _along(contact, floor, at) if along is None and contact.parallel > 0.0 else bool(along)
        return [
            Touch(gap - contact.pair.margin, n, point, first.body, second.body)
            for gap, n, point in _over(floor, second, at, stands)
        ]

    def _between(
        self, which: Sequence[int], at: Mapping[int, tuple[Pose, Pose]], along: Mapping[int, bool], clear: float
    ) -> Iterator[list[Touch]]:
        """Yield the touches of pairs of one kind, all computed at once: a robot has hundreds."""
        pairs = [self.all[k] for k in which]
        one, two = (
            (np.array([at[k][side][0] for k in which]), np.array([at[k][side][1] for k in which])) for side in (0, 1)
        )
        if pairs[0].first.type == "capsule":
            gaps, normals, points = _capsules(pairs, one, two, [along.get(k) for k in which])
        else:
            gaps, normals, points = _spheres(pairs, one, two)
        normals[gaps > clear] = 0.0
        for pair, *places in zip(pairs, gaps.tolist(), normals, points, strict=True):
            margin, bodies = pair.pair.margin, (pair.first.body, pair.second.body)
            yield [Touch(gap - margin, n, point, *bodies) for gap, n, point in zip(*places, strict=True)]


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


def _spheres(pairs: Sequence[Contact], at: Pose, by: Pose) -> tuple[Floats, Floats, Floats]:
    """Return gaps (n, 1), normals and points of the second (n, 1, 3) of spheres beside n shapes of one type.

    Args:
        pairs: n pairs.
        at: poses of the spheres, (n, 3, 3) and (n, 3).
        by: those of the others.
    """
    radius, kind = np.array([pair.first.size[0] for pair in pairs]), pairs[0].second.type
    size = np.array([pair.second.size for pair in pairs])
    x, inside = np.einsum("nji,nj->ni", by[0], at[1] - by[1]), np.zeros(len(pairs), dtype=bool)
    nearest = np.zeros_like(x)
    if kind == "capsule":
        nearest[:, 2] = np.clip(x[:, 2], -size[:, 1], size[:, 1])
    elif kind != "sphere":
        nearest, inside = _on_box(size, x) if kind == "box" else _on_cylinder(size, x)
    core = size[:, 0] if kind in ("sphere", "capsule") else np.zeros(len(pairs))
    way = np.where(inside[:, None], x - nearest, nearest - x)
    distance = np.sqrt(_dot(way, way))
    with np.errstate(invalid="ignore"):  # a centre on a surface or an axis has no normal
        n = way / distance[:, None]
    gaps = np.where(inside, -distance, distance) - radius - core
    normals, points = (np.einsum("nij,nj->ni", by[0], own) for own in (n, nearest - core[:, None] * n))
    return gaps[:, None], normals[:, None], (points + by[1])[:, None]


def _on_box(half: Floats, x: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the nearest points (n, 3) of boxes' surfaces in their axes, and whether x is inside."""
    held = np.clip(x, -half, half)
    inside = (held == x).all(axis=1)
    rows, side = np.flatnonzero(inside), np.argmin(half - np.abs(x), axis=1)[inside]
    held[rows, side] = np.copysign(half, x)[rows, side]
    return held, inside


def _on_cylinder(size: Floats, x: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the nearest points (n, 3) of cylinders' surfaces in their axes, and whether x is inside."""
    radius, half, rho = size[:, 0], size[:, 1], np.hypot(x[:, 0], x[:, 1])
    with np.errstate(divide="ignore"):
        out = radius / rho
    held = np.column_stack([x[:, :2] * np.minimum(1.0, out)[:, None], np.clip(x[:, 2], -half, half)])
    inside = (held == x).all(axis=1)
    side = inside & (radius - rho < half - np.abs(x[:, 2]))
    held[side, :2] *= out[side, None]
    cap = inside & ~side
    held[cap, 2] = np.copysign(half, x[:, 2])[cap]
    return held, inside


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
