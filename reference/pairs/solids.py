"""A sphere or capsule against a solid: the gap between their nearest points.

Every function returns the distance of a point from a solid as a jet, below 0 inside, and a vector from the solid to the
side of the point, with its length. The nearest point moves from face to edge to corner: distance and normal are
continuous there, the second derivative is not.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.pairs.jets import (
    Jet,
    Point,
    Vector,
    add,
    along,
    apart,
    cross,
    dot,
    less,
    moved,
    opposite,
    over,
    part,
    root,
    scaled,
    shifted,
    times,
    value,
)

PARALLEL = 1e-24
"""Square of the sine below which the nearest points of two lines are lost in rounding: those of segments that do not
lie side by side are ends, whichever way that rounds."""
OPEN, INSIDE, LOW = range(3)
"""On which side of its bounds a coordinate is held: on none, so that it tells by itself; between; below; else above."""
FREE = (OPEN, OPEN, OPEN)
ABREAST = 1e-5  # part of the length that ends are in which are no more than abreast: the motion chooses, not the gap
INSTANT = 1e-12
"""s, by which ways that are equal now are told apart."""
Distance = Any
"""A jet, a vector, and its length as a jet."""


@kernels.helper
def _held(s: Jet, low: float, high: float) -> Jet:
    """Return s between its bounds, where it is at rest."""
    if s[0].real < low.real:
        return shifted(scaled(0.0, s), low)
    if s[0].real > high.real:
        return shifted(scaled(0.0, s), high)
    return s


@kernels.helper
def _beyond(s: Jet, half: float, side: int) -> Jet:
    """Return how far s is beyond -half .. half, with its sign; 0 between them."""
    if side == OPEN:
        return less(s, _held(s, -half, half))
    if side == INSIDE:
        return scaled(0.0, s)
    return shifted(s, half if side == LOW else -half)


@kernels.helper
def unit(D: Vector, d: Jet) -> Point:
    """Return the direction now of a vector that is d long; not a number where it has none."""
    x, y, z = value(D)
    return part(x, d[0]), part(y, d[0]), part(z, d[0])


@kernels.helper
def point(C: Vector, M: Vector) -> Distance:
    """Return the distance of C from the point M."""
    D = apart(C, M)
    d = root(dot(D, D))
    return d, D, d


@kernels.helper
def segment(C: Vector, M: Vector, A: Vector, half: float, sides: Any = FREE) -> Distance:
    """Return the distance of C from a segment about M along the unit vector A."""
    s = dot(A, apart(C, M))
    return point(C, along(M, less(s, _beyond(s, half, sides[0])), A))


@kernels.helper
def _face(s: Jet, half: float, X: Vector) -> Distance:
    """Return the distance from the nearer of two faces at -half and half along X."""
    one = shifted(scaled(0.0, s), 1.0)
    if s[0].real < 0.0:
        return shifted(scaled(-1.0, s), -half), opposite(X), one
    return shifted(s, -half), X, one


@kernels.helper
def box(C: Vector, M: Vector, X: Vector, Y: Vector, Z: Vector, size: Point, sides: Any = FREE) -> Distance:
    """Return the distance of C from a box about M with half sides along X, Y, Z; inside, from its nearest face."""
    D = apart(C, M)
    x, y, z = dot(X, D), dot(Y, D), dot(Z, D)
    a, b, c = _beyond(x, size[0], sides[0]), _beyond(y, size[1], sides[1]), _beyond(z, size[2], sides[2])
    over_x, over_y, over_z = a[0].real != 0.0, b[0].real != 0.0, c[0].real != 0.0
    if over_x + over_y + over_z == 1:  # over a face the vector keeps its direction where the distance vanishes
        if over_x:
            return _face(x, size[0], X)
        return _face(y, size[1], Y) if over_y else _face(z, size[2], Z)
    square = add(add(times(a, a), times(b, b)), times(c, c))
    if square[0].real > 0.0:
        zero = scaled(0.0, a)
        out = along(along(along((zero, zero, zero), a, X), b, Y), c, Z)
        far = root(square)
        return far, out, far
    p, q, r = abs(x[0].real) - size[0].real, abs(y[0].real) - size[1].real, abs(z[0].real) - size[2].real
    if p >= q and p >= r:
        return _face(x, size[0], X)
    return _face(y, size[1], Y) if q >= r else _face(z, size[2], Z)


@kernels.helper
def _scaled_to(D: Vector, length: Jet, d: Jet) -> Vector:
    """Return the vector D, which is d long, at another length."""
    k = over(length, d)
    return times(k, D[0]), times(k, D[1]), times(k, D[2])


@kernels.helper
def cylinder(C: Vector, M: Vector, A: Vector, radius: float, half: float, sides: Any = FREE) -> Distance:
    """Return the distance of C from a cylinder about M along A; inside, from its side or its nearer end."""
    D = apart(C, M)
    s = dot(A, D)
    out = along(D, scaled(-1.0, s), A)
    square = dot(out, out)
    wide = square[0].real > radius.real**2 if sides[1] == OPEN else sides[1] != INSIDE
    if abs(s[0].real) > half.real if sides[0] == OPEN else sides[0] != INSIDE:
        if not wide:
            return _face(s, half, A)
        rho = root(square)
        a, b = shifted(rho, -radius), _beyond(s, half, sides[0])
        far = root(add(times(a, a), times(b, b)))
        return far, along(_scaled_to(out, a, rho), b, A), far
    if not wide and abs(s[0].real) - half.real > np.sqrt(square[0].real) - radius.real:
        return _face(s, half, A)
    rho = root(square)
    return shifted(rho, -radius), out, rho


@kernels.helper
def segments(M: Vector, A: Vector, one: float, N: Vector, B: Vector, two: float) -> Any:
    """Return the nearest points of segments about M and N along A and B.

    Of parallel ones side by side, which have no nearest points, the middle of their overlap.
    """
    D, b = apart(N, M), dot(A, B)
    f, g = dot(A, D), dot(B, D)
    # A.D - (A.B)(B.D) and 1 - (A.B)^2 by vector products: as differences they have no digits left near parallels.
    across = cross(A, B)
    free = dot(across, across)
    if free[0].real > PARALLEL:
        s = _held(over(dot(across, cross(D, B)), free), -one, one)
    else:
        reach = scaled(two, b) if b[0].real > 0.0 else scaled(-two, b)
        s = scaled(0.5, add(_held(less(f, reach), -one, one), _held(add(f, reach), -one, one)))
    t = less(times(s, b), g)
    if abs(t[0].real) > two.real:
        t = _held(t, -two, two)
        s = _held(add(f, times(t, b)), -one, one)
    return along(M, s, A), along(N, t, B)


@kernels.helper
def overlap(M: Vector, A: Vector, one: float, N: Vector, B: Vector, two: float) -> float:
    """Return over which length of the first of two segments the second lies beside it; below 0 over none."""
    f, reach = dot(A, apart(N, M))[0].real, abs(dot(A, B)[0].real) * two.real
    return float(min(one.real, f + reach) - max(-one.real, f - reach))


@kernels.helper
def _ahead(s: Jet) -> float:
    """Return s an instant later: where two ways are equal now, it says which one the motion takes."""
    return float(s[0].real + INSTANT * s[1].real)


@kernels.helper
def ends(M: Vector, A: Vector, one: float, N: Vector, B: Vector, two: float, sign: float) -> Any:
    """Return nearest points where segments that lie side by side end: an end of the one, and its foot on the other.

    Of two ends abreast of each other the one counts that is further in; where none is, both do.

    The segments are given as to `segments`, and the end by the sign that it has along the first.
    """
    other = sign if dot(A, B)[0].real > 0.0 else -sign
    E, F = moved(M, sign * one, A), moved(N, other * two, B)
    D = apart(F, E)
    by, beyond = other * _ahead(dot(B, D)), -sign * _ahead(dot(A, D))  # how far E, and F, is in
    if max(by, beyond) < 0.0:
        return E, F
    t, r = dot(B, apart(E, N)), dot(A, apart(F, M))
    if other * t[0].real < -two.real:  # in one plane axes may lie so that a foot is beyond the far end
        t = shifted(scaled(0.0, t), -other * two)
    if sign * r[0].real < -one.real:
        r = shifted(scaled(0.0, r), -sign * one)
    ours, theirs = along(N, t, B), along(M, r, A)
    if min(by, beyond) > ABREAST * min(one.real, two.real):
        here, there = apart(ours, E), apart(theirs, F)
        by, beyond = dot(there, there)[0].real, dot(here, here)[0].real
    if by >= beyond:
        return E, ours
    return theirs, F


@kernels.helper
def crossing(A: Vector, B: Vector, D: Vector) -> float:
    """Return the sine of the angle at which axes that are D apart cross, seen along what is nearest between them."""
    across, f = cross(A, B), dot(A, D)[0].real
    square = dot(D, D)[0].real - f * f
    if square <= 0.0:
        return float(np.sqrt(dot(across, across)[0].real))
    return float(abs(dot(across, D)[0].real) / np.sqrt(square))
