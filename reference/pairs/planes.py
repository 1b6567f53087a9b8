"""A half space against a solid: the gap of the solid's lowest points, one row each.

The half space is below the plane through P with normal N. Every function returns the gap as a jet, the normal from the
half space to the solid, and the point of the solid where they would meet.
"""

from __future__ import annotations

from typing import Any

from crossbody.reference import kernels
from crossbody.reference.pairs.jets import (
    Point,
    Vector,
    add,
    apart,
    dot,
    less,
    moved,
    part,
    root,
    scaled,
    shifted,
    times,
    value,
)

Gap = Any
"""A jet, the normal and the lowest point."""


@kernels.helper
def sphere(P: Vector, N: Vector, C: Vector, r: float) -> Gap:
    """Return the gap of a sphere of radius r about C; of a point for r = 0."""
    h = shifted(dot(N, apart(C, P)), -r)
    n, c = value(N), value(C)
    return h, n, (c[0] - r * n[0], c[1] - r * n[1], c[2] - r * n[2])


@kernels.helper
def rim(P: Vector, N: Vector, E: Vector, X: Vector, Y: Vector, r: float) -> Gap:
    """Return the gap of a disc of radius r about E across X and Y; for -r that of its highest point.

    It has no second derivative where the disc lies flat.
    """
    x, y = dot(N, X), dot(N, Y)
    s = root(add(times(x, x), times(y, y)))
    h = less(dot(N, apart(E, P)), scaled(r, s))
    return h, value(N), value(moved(moved(E, part(-r * x[0], s[0]), X), part(-r * y[0], s[0]), Y))


@kernels.helper
def ellipsoid(P: Vector, N: Vector, C: Vector, X: Vector, Y: Vector, Z: Vector, size: Point) -> Gap:
    """Return the gap of an ellipsoid with semi-axes of these sizes along X, Y, Z."""
    x, y, z = scaled(size[0], dot(N, X)), scaled(size[1], dot(N, Y)), scaled(size[2], dot(N, Z))
    s = root(add(add(times(x, x), times(y, y)), times(z, z)))
    low = moved(
        moved(moved(C, part(-size[0] * x[0], s[0]), X), part(-size[1] * y[0], s[0]), Y), part(-size[2] * z[0], s[0]), Z
    )
    return less(dot(N, apart(C, P)), s), value(N), value(low)
