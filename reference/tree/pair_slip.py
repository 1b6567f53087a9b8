"""Tangential rows of pairs: the velocity of one shape over the other where they meet.

With V(x) the velocity of a body's material at the place x where they meet, and t a direction of an orthonormal frame of
the tangent plane,

    v_t = t.(V_2(x) - V_1(x)),    H'v = t'.(V_2 - V_1) + t.(A_2 - A_1),    A = V' at v' = 0 along the way of x

x and t move with the shapes, not with the material: a sphere that rolls on a plane has x' = its centre's velocity. Over
a plane the frame is the plane's own. On other shapes it is that of the normal in the second shape's axes, which has a
pole in a direction that no symmetry chooses. x is on the shape over a plane, and of two solids on the first.
"""

from __future__ import annotations

from typing import Any

from crossbody.reference import kernels
from crossbody.reference.kinds import Array
from crossbody.reference.pairs import layout, solids
from crossbody.reference.pairs.jets import (
    Jet,
    Vector,
    add,
    along,
    dot,
    moved,
    opposite,
    over,
    root,
    scaled,
    shifted,
    times,
    value,
)
from crossbody.reference.tree import layout as tree
from crossbody.reference.tree.pair_rows import axes_meet, axis, cap, from_solid, lies, origin, sign, stands_on
from crossbody.reference.tree.points import direction, field, point, pull

POLE = ((0.8, -0.6, 0.0), (0.48, 0.64, -0.6), (0.36, 0.48, 0.8))
"""Orthonormal axes (by rows) in those of a shape: the frame of the normal has its pole against the last one."""


@kernels.helper
def _spread(r: Vector, k: Jet) -> Vector:
    """Return the vector r / k."""
    return over(r[0], k), over(r[1], k), over(r[2], k)


@kernels.helper
def _times(k: Jet, r: Vector) -> Vector:
    """Return the vector k r."""
    return times(k, r[0]), times(k, r[1]), times(k, r[2])


@kernels.helper
def _on_rim(p: Array, w: Array, o: int, place: int, N: Vector) -> Vector:
    """Return where the cylinder at p[o:] is lowest over a plane with normal N, or highest, on a cap by the place."""
    r, X, Y = -sign(place, 0) * p[o + layout.SIZE], axis(p, w, o, 0), axis(p, w, o, 1)
    x, y = dot(N, X), dot(N, Y)
    s = scaled(-1.0 / r, root(add(times(x, x), times(y, y))))
    return along(along(cap(p, w, o, sign(place, 1) > 0.0), over(x, s), X), over(y, s), Y)


@kernels.helper
def _lowest(p: Array, w: Array, o: int, row: int, N: Vector) -> Vector:
    """Return the lowest point of the shape at p[o:] over a plane with normal N, in the place of the row at p[row:]."""
    if int(p[o].real) == layout.ELLIPSOID:
        X, Y, Z, s = axis(p, w, o, 0), axis(p, w, o, 1), axis(p, w, o, 2), o + layout.SIZE
        x, y, z = dot(N, X), dot(N, Y), dot(N, Z)
        a, b, c = scaled(p[s] ** 2, x), scaled(p[s + 1] ** 2, y), scaled(p[s + 2] ** 2, z)
        far = scaled(-1.0, root(add(add(times(a, x), times(b, y)), times(c, z))))
        out = along(along(_times(over(a, far), X), over(b, far), Y), over(c, far), Z)
        return along(origin(p, w, o), shifted(scaled(0.0, x), 1.0), out)
    k = row + layout.POINT
    C = point(p, w, int(p[o + layout.NODE].real), p[k], p[k + 1], p[k + 2])
    return moved(C, -p[row + layout.RADIUS], N)


@kernels.helper
def _pole_axis(p: Array, w: Array, o: int, k: int) -> Vector:
    """Return axis k of those in which the frame of a normal is taken, of the shape at p[o:]."""
    a, b, c = POLE[k]
    R = o + layout.POSE
    return direction(
        w, int(p[o + layout.NODE].real), p[R] * a + p[R + 1] * b + p[R + 2] * c,
        p[R + 3] * a + p[R + 4] * b + p[R + 5] * c, p[R + 6] * a + p[R + 7] * b + p[R + 8] * c,
    )  # fmt: skip


@kernels.helper
def _frame(p: Array, w: Array, o: int, n: Vector) -> tuple[Vector, Vector]:
    """Return two directions across n, in the axes of the shape at p[o:] (Frisvad, J. Graphics Tools 16 (2012))."""
    X, Y, Z = _pole_axis(p, w, o, 0), _pole_axis(p, w, o, 1), _pole_axis(p, w, o, 2)
    a, b, c = dot(n, X), dot(n, Y), dot(n, Z)
    k = shifted(c, 1.0)
    minus_a, minus_b, both = scaled(-1.0, a), scaled(-1.0, b), over(scaled(-1.0, times(a, b)), k)
    one = shifted(over(scaled(-1.0, times(a, a)), k), 1.0)
    other = shifted(over(scaled(-1.0, times(b, b)), k), 1.0)
    return (
        along(along(_times(one, X), both, Y), minus_a, Z),
        along(along(_times(both, X), other, Y), minus_b, Z),
    )


@kernels.helper
def _over_plane(p: Array, w: Array, o: int, row: int, N: Vector) -> Vector:
    """Return where the pair of a plane with normal N and a shape meets in the place of the row at p[row:]."""
    two, place = o + layout.SECOND, int(p[row + layout.PLACE].real)
    if int(p[two].real) != layout.CYLINDER:
        return _lowest(p, w, two, row, N)
    now = lies(p, w, o)
    return _on_rim(p, w, two, place, N) if now == layout.CROSSED else stands_on(p, w, o, now, place)


@kernels.helper
def _between(p: Array, w: Array, o: int, place: int) -> tuple[Vector, Vector]:
    """Return where two solids meet, on the first one, and the normal from it to the second."""
    one = o + layout.FIRST
    r = p[one + layout.SIZE]
    if int(p[one].real) == layout.SPHERE:
        C = origin(p, w, one)
        _, D, length = from_solid(p, w, o, C)
        n = opposite(_spread(D, length))
        return moved(C, r, n), n
    K, L = axes_meet(p, w, o, lies(p, w, o), place)
    _, D, length = solids.point(L, K)
    n = _spread(D, length)
    return moved(K, r, n), n


@kernels.helper
def meeting(p: Array, w: Array, o: int, row: int) -> tuple[Vector, Vector, Vector]:
    """Return where the pair at p[o:] meets in the place of the row at p[row:], and the frame across its normal."""
    one = o + layout.FIRST
    if int(p[one].real) == layout.PLANE:
        return _over_plane(p, w, o, row, axis(p, w, one, 2)), axis(p, w, one, 0), axis(p, w, one, 1)
    x, n = _between(p, w, o, int(p[row + layout.PLACE].real))
    first, second = _frame(p, w, o + layout.SECOND, n)
    return x, first, second


@kernels.helper
def apart(p: Array, w: Array, o: int, x: Vector) -> tuple[Any, Any]:
    """Return velocity and acceleration (at v' = 0) of the second shape of the pair at p[o:] over the first at x."""
    (a, b, c), (d, e, f) = field(p, w, int(p[o + layout.SECOND + layout.NODE].real), x)
    (g, h, i), (j, k, m) = field(p, w, int(p[o + layout.FIRST + layout.NODE].real), x)
    return (a - g, b - h, c - i), (d - j, e - k, f - m)


@kernels.helper
def velocity(V: Any, A: Any, t: Vector) -> tuple[Any, Any]:
    """Return the part along t of what `apart` tells, and H'v."""
    rate = t[0][0] * V[0] + t[1][0] * V[1] + t[2][0] * V[2]
    turned = t[0][1] * V[0] + t[1][1] * V[1] + t[2][1] * V[2]
    return rate, turned + t[0][0] * A[0] + t[1][0] * A[1] + t[2][0] * A[2]


@kernels.helper
def columns(p: Array, w: Array, o: int, x: Vector, t: Vector, H: Array) -> None:
    """Add H of the velocity of the pair at p[o:] along t."""
    pull(p, w, int(p[o + layout.FIRST + layout.NODE].real), -1.0, value(t), value(x), H)
    pull(p, w, int(p[o + layout.SECOND + layout.NODE].real), 1.0, value(t), value(x), H)


@kernels.helper
def place_of(p: Array, i: int) -> tuple[int, int]:
    """Return where the pair of the tangential row i and the row stand in p."""
    row = int(p[tree.AT_ROW].real) + tree.ROW * i
    return int(p[tree.AT_PAIR].real) + layout.PAIR * int(p[row + layout.WHICH].real), row
