"""Where shapes are nearest: gaps, normals and points of any number of pairs, at any number of instants at once.

Arrays have leading dimensions (...) that broadcast against each other: pairs, instants, or none.
Nearest points are sought in each shape's own axes, and nothing here knows a derivative.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.cases.scene_contacts import STEEPEST

Pose = tuple[Floats, Floats]  # rotations (..., 3, 3) and positions (..., 3) in the world
Places = tuple[Floats, Floats, Floats]
"""Gaps (..., places), m; unit normals towards the second shape, and its points (..., places, 3)."""
Pair = tuple[Floats, Floats]  # points of the first of two shapes, and those of the second (..., 3)
Truths = NDArray[np.bool_]
SIGNS = np.array([[1.0 if k >> bit & 1 else -1.0 for bit in range(3)] for k in range(8)])
"""Of the corners of a box, in the order of their rows."""
ROUND = ("box", "capsule", "hull")
"""Shapes whose places over a plane are points of theirs: corners, or the ends of an axis."""
NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # of each axis in a vector product
UP = np.array([0.0, 0.0, 1.0])
TURNED = np.array([[0.8, -0.6, 0.0], [0.48, 0.64, -0.6], [0.36, 0.48, 0.8]])
"""Axes, by rows, in those of a shape, against whose last a frame of normals has its pole."""
ENDS = np.array([-1.0, 1.0])[:, None] * UP
RIM = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Points of a rim on which a cylinder stands, in the order of their rows."""


def meet(kinds: tuple[str, str], sizes: tuple[Floats, Floats], at: Pose, by: Pose, along: Truths) -> Places:
    """Return where pairs of shapes of two types would meet, for every place of theirs.

    Args:
        kinds: types of the first and of the second shapes, as in `scene_contacts.PLACES`.
        sizes: of both, `Shape.extents`: (..., 3), or of hulls (..., places, 3).
        at: poses of the first shapes.
        by: poses of the second shapes.
        along: whether capsules lie along each other, or cylinders stand (...), as `lying` says;
            else not looked at.
    """
    if kinds[0] == "plane":
        return _over_plane(kinds[1], sizes[1], at, by, along)
    if kinds[0] == "capsule":
        return _capsules(sizes, at, by, along)
    return _spheres(kinds[1], sizes, at, by)


def lying(kinds: tuple[str, str], sizes: tuple[Floats, Floats], at: Pose, by: Pose, sine: Floats) -> Truths:
    """Return whether capsules lie along each other, or cylinders stand on their plane (...).

    They do up to an angle of that sine; 0 of other shapes, which never do.
    """
    if kinds == ("plane", "cylinder"):
        return np.asarray(tilt(at, by) <= sine)
    if kinds != ("capsule", "capsule"):
        return np.zeros(np.shape(sine), dtype=bool)
    low, high = overlap(at, sizes[0][..., 1], by, sizes[1][..., 1])
    return np.asarray((low <= high) & (crossing(at, by) <= sine) & (aslant(at, by) <= STEEPEST))


def across(kind: str, one: Floats, two: Floats, normal: Floats) -> Floats:
    """Return the two directions (..., 2, 3) across normals along which tangential rows are counted.

    Over a plane they are its x and y; else Frisvad's frame of the normal in axes of the second
    shape that are turned so that no symmetry meets its pole (`crossbody.reference.tree.pair_slip`).

    Args:
        kind: type of the first shape.
        one: its rotation (..., 3, 3).
        two: that of the second shape.
        normal: from the first shape to the second (..., 3).
    """
    if kind == "plane":
        return np.asarray(np.swapaxes(one, -1, -2)[..., :2, :])
    turned = TURNED @ np.swapaxes(two, -1, -2)
    X, Y, Z = (turned[..., k, :] for k in range(3))
    a, b, c = _dot(normal, X)[..., None], _dot(normal, Y)[..., None], 1.0 + _dot(normal, Z)[..., None]
    one_way = (1.0 - a * a / c) * X - a * b / c * Y - a * Z
    return np.stack([one_way, -a * b / c * X + (1.0 - b * b / c) * Y - b * Z], axis=-2)


def tilt(floor: Pose, at: Pose) -> Floats:
    """Return the sine of the angle between a plane's normal and the axis of a cylinder over it (...)."""
    own = _inside(at[0], floor[0][..., 2])
    return np.hypot(own[..., 0], own[..., 1])


def aslant(at: Pose, by: Pose) -> Floats:
    """Return the sine of the angle between axes of two capsules (...)."""
    across = cross(at[0][..., 2], by[0][..., 2])
    return np.sqrt(_dot(across, across))


def crossing(at: Pose, by: Pose) -> Floats:
    """Return the sine of the angle at which axes of two capsules cross, seen along their nearest line."""
    A, B, way = _axes(at, by)
    apart = way - _dot(A, way)[..., None] * A
    across, length = cross(A, B), np.sqrt(_dot(apart, apart))
    seen = np.abs(_dot(across, apart)) / np.where(length > 0.0, length, 1.0)
    return np.where(length > 0.0, seen, np.sqrt(_dot(across, across)))


def overlap(at: Pose, half: Floats, by: Pose, other: Floats) -> tuple[Floats, Floats]:
    """Return from where to where along the first of two capsules the second lies beside it (...)."""
    A, B, way = _axes(at, by)
    middle, reach = _dot(A, way), np.abs(_dot(A, B)) * other
    return np.maximum(-half, middle - reach), np.minimum(half, middle + reach)


def _over_plane(kind: str, size: Floats, floor: Pose, by: Pose, stands: Truths) -> Places:
    n = floor[0][..., 2]
    own = _inside(by[0], n)
    local = _lowest(kind, size, own)
    if kind == "cylinder":
        local = np.where(np.asarray(stands)[..., None, None], _rim(size, own), local)
    points = by[1][..., None, :] + local @ np.swapaxes(by[0], -1, -2)
    gaps = _dot(points - floor[1][..., None, :], n[..., None, :])
    return gaps, np.broadcast_to(n[..., None, :], points.shape), points


def corners(kind: str, size: Floats) -> Floats:
    """Return the points (..., places, 3) that shapes of a type in `ROUND` are round, in their axes."""
    if kind == "hull":
        return size
    return SIGNS * size[..., None, :] if kind == "box" else size[..., None, 1:2] * ENDS


def _lowest(kind: str, size: Floats, n: Floats) -> Floats:
    """Return the lowest points (..., places, 3) along n (..., 3), all in the shapes' axes."""
    radius, half = size[..., None, :1], size[..., None, 1:2]
    if kind == "sphere":
        return -radius * n[..., None, :]
    if kind == "ellipsoid":
        scaled = size * n
        lowest: Floats = -size * scaled / np.sqrt(_dot(scaled, scaled))[..., None]
        return lowest[..., None, :]
    if kind in ROUND:
        points = corners(kind, size)
        return points - radius * n[..., None, :] if kind == "capsule" else points
    with np.errstate(invalid="ignore"):  # caps that are level have no lowest point
        side = radius * (n * (1.0 - UP) / np.hypot(n[..., 0], n[..., 1])[..., None])[..., None, :]
    low, high = -half * UP, half * UP
    return np.concatenate([low - side, low + side, high - side, high + side], axis=-2)


def _rim(size: Floats, n: Floats) -> Floats:
    """Return four points (..., 4, 3) of the rims on which cylinders stand along n (..., 3), in their axes."""
    radius, half = size[..., None, :1], size[..., None, 1:2]
    points: Floats = radius * RIM - np.copysign(half, n[..., None, 2:]) * UP
    return points


def _spheres(kind: str, sizes: tuple[Floats, Floats], at: Pose, by: Pose) -> Places:
    """Return the one place of spheres beside shapes of one type."""
    radius, size = sizes[0][..., 0], sizes[1]
    x = _inside(by[0], at[1] - by[1])
    nearest, within = np.zeros_like(x), np.zeros(x.shape[:-1], dtype=bool)
    if kind == "capsule":
        nearest[..., 2] = np.clip(x[..., 2], -size[..., 1], size[..., 1])
    elif kind != "sphere":
        nearest, within = _on_box(size, x) if kind == "box" else _on_cylinder(size, x)
    core = size[..., 0] if kind in ("sphere", "capsule") else np.zeros(size.shape[:-1])
    way = np.where(within[..., None], x - nearest, nearest - x)
    distance = np.sqrt(_dot(way, way))
    with np.errstate(invalid="ignore"):  # a centre on a surface or an axis has no normal
        n = way / distance[..., None]
    gaps = np.where(within, -distance, distance) - radius - core
    points = by[1] + _outside(by[0], nearest - core[..., None] * n)
    return gaps[..., None], _outside(by[0], n)[..., None, :], points[..., None, :]


def _on_box(half: Floats, x: Floats) -> tuple[Floats, Truths]:
    """Return the nearest points (..., 3) of boxes' surfaces in their axes, and whether x is inside."""
    held = np.clip(x, -half, half)
    within = np.all(held == x, axis=-1)
    face = np.arange(3) == np.argmin(half - np.abs(x), axis=-1)[..., None]
    return np.where(within[..., None] & face, np.copysign(half, x), held), within


def _on_cylinder(size: Floats, x: Floats) -> tuple[Floats, Truths]:
    """Return the nearest points (..., 3) of cylinders' surfaces in their axes, and whether x is inside."""
    radius, half, rho = size[..., 0], size[..., 1], np.hypot(x[..., 0], x[..., 1])
    level = np.abs(x[..., 2])
    within = (rho <= radius) & (level <= half)
    side = ~within | (radius - rho < half - level)  # what is inside is nearest to the side, or to a cap
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.where(within & side, radius / rho, np.minimum(1.0, radius / rho))
    axis = np.where(within & side, radius, 0.0)[..., None] * UP[[2, 0]]  # as good as any other way out of the middle
    with np.errstate(invalid="ignore"):
        across = np.where((rho > 0.0)[..., None], x[..., :2] * out[..., None], axis)
    cap = np.where(within & ~side, np.copysign(half, x[..., 2]), np.clip(x[..., 2], -half, half))
    return np.concatenate([across, cap[..., None]], axis=-1), within


def _capsules(sizes: tuple[Floats, Floats], at: Pose, by: Pose, along: Truths) -> Places:
    """Return both places of pairs of capsules: where they end if they lie along each other, else one that is nearest.

    A row that is none is infinitely far.
    """
    radius, width = sizes[0][..., 0], sizes[1][..., 0]
    segments, none = (at, sizes[0][..., 1], by, sizes[1][..., 1]), ~np.asarray(along)
    one, half, two, other = segments
    feet = _joined(_foot(one, half, two, other), _foot(two, other, one, half)[::-1])  # on the first, on the second
    tried = [_nearest(*segments, feet)] * 2
    if not none.all():
        chosen = none[..., None]
        sides = [_end(*segments, sign, feet) for sign in (-1.0, 1.0)]
        tried = [(np.where(chosen, a, c), np.where(chosen, b, d)) for (a, b), (c, d) in zip(tried, sides, strict=True)]
    starts, ends = (np.stack([pair[side] for pair in tried], axis=-2) for side in (0, 1))
    apart = ends - starts
    distance = np.sqrt(_dot(apart, apart))
    with np.errstate(invalid="ignore"):  # axes that meet have no normal
        normals = apart / distance[..., None]
    gaps = distance - (radius + width)[..., None]
    gaps[..., 1] = np.where(none, np.inf, gaps[..., 1])
    normals[..., 1, :] = np.where(none[..., None], 0.0, normals[..., 1, :])
    return gaps, normals, ends - width[..., None, None] * normals


def _axes(one: Pose, two: Pose) -> tuple[Floats, Floats, Floats]:
    """Return the axes of two capsules and the way between their centres, each (..., 3)."""
    return one[0][..., 2], two[0][..., 2], two[1] - one[1]


def _end(one: Pose, half: Floats, two: Pose, other: Floats, sign: float, feet: Pair) -> Pair:
    """Return nearest points (..., 3) where segments side by side end: the nearer of an end and its foot."""
    A, B, _ = _axes(one, two)
    same = sign * _dot(A, B) >= 0.0
    of_second = [np.where(same[..., None], part[..., 3, :], part[..., 2, :])[..., None, :] for part in feet]
    which = 0 if sign < 0.0 else 1
    return _closest(_joined([part[..., which : which + 1, :] for part in feet], of_second))


def _nearest(one: Pose, half: Floats, two: Pose, other: Floats, feet: Pair) -> Pair:
    """Return the nearest points (..., 3) of segments: the best of four ends and the perpendicular."""
    A, B, way = _axes(one, two)
    across = cross(A, B)
    square = _dot(across, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = (_dot(cross(way, axis), across) / square for axis in (B, A))
    inside = (square > 0.0) & (np.abs(s) <= half) & (np.abs(t) <= other)
    s, t = np.where(inside, s, half), np.where(inside, t, other)
    between = (one[1] + s[..., None] * A)[..., None, :], (two[1] + t[..., None] * B)[..., None, :]
    return _closest(_joined(feet, between))


def _foot(one: Pose, half: Floats, two: Pose, other: Floats) -> Pair:
    """Return both ends (..., 2, 3) of segments, and what is nearest to them on others."""
    along = np.stack([-half, half], axis=-1)[..., None]
    E, B = one[1][..., None, :] + along * one[0][..., None, :, 2], two[0][..., None, :, 2]
    middle, reach = two[1][..., None, :], np.asarray(other)[..., None]
    return E, middle + np.clip(_dot(B, E - middle), -reach, reach)[..., None] * B


def _joined(one: Sequence[Floats], two: Sequence[Floats]) -> Pair:
    """Return the pairs of points (..., k + m, 3) of two sets (..., k, 3) and (..., m, 3)."""
    starts, ends = (np.concatenate(parts, axis=-2) for parts in zip(one, two, strict=True))
    return starts, ends


def _closest(tried: Pair) -> Pair:
    """Return of pairs of points (..., k, 3) for each place the first pair that is nearest (..., 3)."""
    apart = tried[1] - tried[0]
    best = np.argmin(_dot(apart, apart), axis=-1)[..., None, None]
    starts, ends = (np.take_along_axis(part, best, axis=-2)[..., 0, :] for part in tried)
    return starts, ends


def _dot(a: Floats, b: Floats) -> Floats:
    total: Floats = np.einsum("...i,...i->...", a, b)
    return total


def cross(a: Floats, b: Floats) -> Floats:
    """Return vector products (..., 3); NumPy's own costs more than all else here for few vectors."""
    return a.take(NEXT, -1) * b.take(LAST, -1) - a.take(LAST, -1) * b.take(NEXT, -1)


def _inside(rotation: Floats, world: Floats) -> Floats:
    """Return vectors (..., 3) of the world in the axes of shapes."""
    found: Floats = np.einsum("...ji,...j->...i", rotation, world)
    return found


def _outside(rotation: Floats, local: Floats) -> Floats:
    """Return vectors (..., 3) of shapes' axes in the world."""
    found: Floats = np.einsum("...ij,...j->...i", rotation, local)
    return found
