"""The rows of pairs: gap, rate and second derivative from the sweeps of the tree, and the gradient.

h' = n.(v2 - v1) of the material points where the shapes would meet, so that H = n.(J2 - J1) there; h'' at v' = 0 is
the second derivative of the gap in closed form along the motion with which the nodes now move and accelerate.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from crossbody.cases.scene_contacts import STEEPEST
from crossbody.reference import kernels
from crossbody.reference.kinds import Array
from crossbody.reference.pairs import layout, planes, solids
from crossbody.reference.pairs.jets import apart, dot, moved, shifted, value
from crossbody.reference.tree import layout as tree
from crossbody.reference.tree.points import direction, point, pull

LEAST_COSINE = math.sqrt(1.0 - STEEPEST**2)


@kernels.helper
def origin(p: Array, w: Array, o: int) -> Any:
    """Return the origin of the shape at p[o:] and its motion."""
    k = o + layout.POSE + 9
    return point(p, w, int(p[o + layout.NODE].real), p[k], p[k + 1], p[k + 2])


@kernels.helper
def axis(p: Array, w: Array, o: int, column: int) -> Any:
    """Return an axis of the shape at p[o:] and its motion."""
    k = o + layout.POSE + column
    return direction(w, int(p[o + layout.NODE].real), p[k], p[k + 3], p[k + 6])


@kernels.helper
def sign(place: int, bit: int) -> float:
    """Return -1 or 1 by a bit of a place: which end, cap or corner."""
    return 1.0 if (place >> bit) & 1 else -1.0


@kernels.helper
def _over_plane(p: Array, w: Array, o: int, row: int, P: Any, N: Any) -> Any:
    """Return gap, normal and lowest point of the shape at p[o:] over a plane, in the place of the row at p[row:]."""
    if int(p[o].real) == layout.ELLIPSOID:
        C, s, X, Y, Z = origin(p, w, o), o + layout.SIZE, axis(p, w, o, 0), axis(p, w, o, 1), axis(p, w, o, 2)
        return planes.ellipsoid(P, N, C, X, Y, Z, (p[s], p[s + 1], p[s + 2]))
    k = row + layout.POINT
    C = point(p, w, int(p[o + layout.NODE].real), p[k], p[k + 1], p[k + 2])
    return planes.sphere(P, N, C, p[row + layout.RADIUS])


@kernels.helper
def _side(p: Array, pair: int, kind: int, which: int) -> int:
    """Return on which side of one of its kinks the pair at p[pair:] is."""
    first = int(p[pair + layout.BENDS].real)
    if first < 0 or (which > 0 and kind == layout.CAPSULE) or (which > 1 and kind == layout.CYLINDER):
        return tree.OPEN
    return int(p[int(p[tree.AT_BEND].real) + first + which].real)


@kernels.helper
def bend(p: Array, w: Array, pair: int, which: int) -> tuple[float, float]:
    """Return a coordinate of the sphere of the pair at p[pair:] in its solid, and the size at which its gap bends."""
    o = pair + layout.SECOND
    D, kind = apart(origin(p, w, pair + layout.FIRST), origin(p, w, o)), int(p[o].real)
    if kind == layout.BOX:
        return dot(axis(p, w, o, which), D)[0], p[o + layout.SIZE + which]
    s = dot(axis(p, w, o, 2), D)[0]
    if which == 0:
        return s, p[o + layout.SIZE + 1]
    return dot(D, D)[0] - s * s, p[o + layout.SIZE] ** 2  # about the axis: squares


@kernels.helper
def from_solid(p: Array, w: Array, pair: int, C: Any) -> Any:
    """Return the distance of a point from the second shape's surface, a vector towards the point, and its length."""
    o = pair + layout.SECOND
    kind, M, s = int(p[o].real), origin(p, w, o), o + layout.SIZE
    if kind == layout.SPHERE:
        d, D, length = solids.point(C, M)
        return shifted(d, -p[s]), D, length
    sides = (_side(p, pair, kind, 0), _side(p, pair, kind, 1), _side(p, pair, kind, 2))
    if kind == layout.BOX:
        X, Y, Z = axis(p, w, o, 0), axis(p, w, o, 1), axis(p, w, o, 2)
        return solids.box(C, M, X, Y, Z, (p[s], p[s + 1], p[s + 2]), sides)
    A = axis(p, w, o, 2)
    if kind == layout.CYLINDER:
        return solids.cylinder(C, M, A, p[s], p[s + 1], sides)
    d, D, length = solids.segment(C, M, A, p[s + 1], sides)
    return shifted(d, -p[s]), D, length


@kernels.helper
def _tilt(p: Array, w: Array, o: int) -> Any:
    """Return a plane's normal in the axes of the cylinder over it."""
    N, two = axis(p, w, o + layout.FIRST, 2), o + layout.SECOND
    x, y, z = dot(N, axis(p, w, two, 0)), dot(N, axis(p, w, two, 1)), dot(N, axis(p, w, two, 2))
    return x[0].real, y[0].real, z[0].real


@kernels.helper
def upside_down(p: Array, w: Array, o: int) -> bool:
    """Return whether the second cap of a cylinder over a plane is the lower one."""
    return bool(_tilt(p, w, o)[2] < 0.0)


@kernels.helper
def _crossed(p: Array, w: Array, o: int) -> float:
    """Return by how much shapes are at an angle, or not beside each other, parts of what separates the two ways."""
    one, two = o + layout.FIRST, o + layout.SECOND
    if int(p[one].real) == layout.PLANE:
        x, y, _ = _tilt(p, w, o)
        return float(np.sqrt(x * x + y * y) / p[o + layout.SINE].real - 1.0)
    M, A, a = origin(p, w, one), axis(p, w, one, 2), p[one + layout.SIZE + 1].real
    N, B, b = origin(p, w, two), axis(p, w, two, 2), p[two + layout.SIZE + 1].real
    sine, beside = solids.crossing(A, B, apart(N, M)), solids.overlap(M, A, a, N, B, b)
    steep = LEAST_COSINE - abs(dot(A, B)[0].real)
    return float(max(sine / p[o + layout.SINE].real - 1.0, -beside / a, steep))


@kernels.helper
def lowest(p: Array, w: Array, o: int) -> float:
    """Return the angle about a cylinder's axis at which its caps are lowest over a plane; 0 if they are level."""
    x, y, _ = _tilt(p, w, o)
    return float(np.arctan2(-y, -x)) if x != 0.0 or y != 0.0 else 0.0


@kernels.helper
def chosen(p: Array, w: Array, o: int) -> int:
    """Return how the shapes of the pair at p[o:] lie to each other as they are."""
    if _crossed(p, w, o) > 0.0:
        return int(layout.CROSSED)
    stands = int(p[o + layout.FIRST].real) == layout.PLANE
    return int(layout.UPSIDE_DOWN if stands and upside_down(p, w, o) else layout.ALONG)


@kernels.helper
def lies(p: Array, w: Array, o: int) -> int:
    """Return how the shapes of the pair at p[o:] lie to each other: as the run has it, or else as they are."""
    now = int(p[int(p[tree.AT_SIDE].real) + int(p[o + layout.LIES].real)].real)
    if now != layout.UNDECIDED:
        return now
    return int(chosen(p, w, o))


@kernels.helper
def turn(p: Array, w: Array, o: int, now: int) -> float:
    """Return how far shapes are from lying to each other otherwise than now, below 0 if they do.

    It is 1 of ones that are crossed out of reach; those that lie along each other leave that anywhere.
    """
    if now != layout.CROSSED:
        return float(layout.BAND - _crossed(p, w, o))
    one, two = o + layout.FIRST, o + layout.SECOND
    D, plane = apart(origin(p, w, two), origin(p, w, one)), int(p[one].real) == layout.PLANE
    reach = 2.0 * (p[two + layout.SIZE] + p[o + layout.MARGIN]).real + p[two + layout.SIZE + 1].real
    if plane and dot(D, axis(p, w, one, 2))[0].real > reach:
        return 1.0
    reach += 2.0 * p[one + layout.SIZE].real + p[one + layout.SIZE + 1].real
    if not plane and dot(D, D)[0].real > reach * reach:
        return 1.0
    return float(_crossed(p, w, o))


@kernels.helper
def cap(p: Array, w: Array, o: int, top: bool) -> Any:
    """Return the middle of a cap of the cylinder at p[o:]."""
    half = p[o + layout.SIZE + 1]
    return moved(origin(p, w, o), half if top else -half, axis(p, w, o, 2))


@kernels.helper
def stands_on(p: Array, w: Array, o: int, now: int, place: int) -> Any:
    """Return one of the four points of its rim on which the cylinder of the pair at p[o:] stands, as it does now."""
    two = o + layout.SECOND
    r, angle = p[two + layout.SIZE], p[int(p[tree.AT_SIDE].real) + int(p[o + layout.PHASE].real)] + 0.5 * np.pi * place
    E = cap(p, w, two, now != layout.ALONG)
    return moved(moved(E, r * np.cos(angle), axis(p, w, two, 0)), r * np.sin(angle), axis(p, w, two, 1))


@kernels.helper
def _cylinder(p: Array, w: Array, o: int, place: int) -> Any:
    """Return the same of a cylinder over a plane: of each cap the lowest and the highest point.

    On a cap it stands on four points of its rim, which the body carries along: which one is lowest there changes with
    the least tilt.
    """
    one, two = o + layout.FIRST, o + layout.SECOND
    P, N, r, now = origin(p, w, one), axis(p, w, one, 2), p[two + layout.SIZE], lies(p, w, o)
    if now == layout.CROSSED:
        E, X, Y = cap(p, w, two, sign(place, 1) > 0.0), axis(p, w, two, 0), axis(p, w, two, 1)
        h, n, at = planes.rim(P, N, E, X, Y, -sign(place, 0) * r)
    else:
        h, n, at = planes.sphere(P, N, stands_on(p, w, o, now, place), 0.0 * r)
    return shifted(h, -p[o + layout.MARGIN]), n, at


@kernels.helper
def axes_meet(p: Array, w: Array, o: int, now: int, place: int) -> Any:
    """Return where the axes of two capsules are nearest: side by side where they end, crossed at one place."""
    one, two = o + layout.FIRST, o + layout.SECOND
    M, A, a = origin(p, w, one), axis(p, w, one, 2), p[one + layout.SIZE + 1]
    N, B, b = origin(p, w, two), axis(p, w, two, 2), p[two + layout.SIZE + 1]
    if now == layout.ALONG:
        return solids.ends(M, A, a, N, B, b, sign(place, 0))
    return solids.segments(M, A, a, N, B, b)


@kernels.helper
def _capsules(p: Array, w: Array, o: int, place: int) -> Any:
    """Return the same of two capsules, which meet where their axes are nearest."""
    one, now = o + layout.FIRST, lies(p, w, o)
    if now != layout.ALONG and place > 0:
        M = origin(p, w, one)
        zero = 0.0 * M[0][0]
        return (layout.FAR + zero, zero, zero), (zero, zero, zero), value(M)
    K, L = axes_meet(p, w, o, now, place)
    (d, D, length), c = solids.point(L, K), value(L)
    n, r, s = solids.unit(D, length), p[one + layout.SIZE], p[o + layout.SECOND + layout.SIZE]
    return shifted(d, -r - s - p[o + layout.MARGIN]), n, (c[0] - s * n[0], c[1] - s * n[1], c[2] - s * n[2])


@kernels.helper
def touch(p: Array, w: Array, o: int, row: int) -> Any:
    """Return gap (value, rate, second derivative at v' = 0), normal from first to second, and where they would meet.

    Args:
        p: parameters of the scene.
        w: filled by the outward sweep.
        o: where the pair begins in p.
        row: where its row does, which says the place.
    """
    one, two, place = o + layout.FIRST, o + layout.SECOND, int(p[row + layout.PLACE].real)
    first, second = int(p[one].real), int(p[two].real)
    if first == layout.PLANE and second == layout.CYLINDER:
        return _cylinder(p, w, o, place)
    if first == layout.PLANE:
        h, n, at = _over_plane(p, w, two, row, origin(p, w, one), axis(p, w, one, 2))
        return shifted(h, -p[o + layout.MARGIN]), n, at
    if first == layout.SPHERE:
        C, r = origin(p, w, one), p[one + layout.SIZE]
        d, D, length = from_solid(p, w, o, C)
        m, c = solids.unit(D, length), value(C)
        return shifted(d, -r - p[o + layout.MARGIN]), (-m[0], -m[1], -m[2]), (
            c[0] - r * m[0], c[1] - r * m[1], c[2] - r * m[2],
        )  # fmt: skip
    return _capsules(p, w, o, place)


@kernels.helper
def gradient(p: Array, w: Array, o: int, n: Any, at: Any, H: Array) -> None:
    """Add H of the pair at p[o:] whose shapes would meet at a point with normal n."""
    pull(p, w, int(p[o + layout.FIRST + layout.NODE].real), -1.0, n, at, H)
    pull(p, w, int(p[o + layout.SECOND + layout.NODE].real), 1.0, n, at, H)
