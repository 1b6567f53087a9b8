"""Numbers that carry their first and second derivative in time: (x, x', x''), and vectors of three of them.

A gap that is written once, in jets, has its rate and its second derivative with all terms of the shapes' curvature.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels

Jet = Any
"""(x, x', x'')."""
Vector = Any
"""Three jets."""
Point = Any
"""Three numbers."""


@kernels.helper
def add(a: Jet, b: Jet) -> Jet:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernels.helper
def less(a: Jet, b: Jet) -> Jet:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernels.helper
def shifted(a: Jet, c: float) -> Jet:
    """Return a + c for a constant c."""
    return a[0] + c, a[1], a[2]


@kernels.helper
def scaled(c: float, a: Jet) -> Jet:
    """Return c a for a constant c."""
    return c * a[0], c * a[1], c * a[2]


@kernels.helper
def times(a: Jet, b: Jet) -> Jet:
    """Return a b."""
    return a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2.0 * a[1] * b[1] + a[0] * b[2]


@kernels.helper
def part(a: Any, b: Any) -> Any:
    """Return a / b of two numbers, what is no number where b is 0: of complex ones the division itself would raise."""
    return np.nan * a if b == 0.0 else a / b


@kernels.helper
def over(a: Jet, b: Jet) -> Jet:
    """Return a / b."""
    x = part(a[0], b[0])
    y = part(a[1] - x * b[1], b[0])
    return x, y, part(a[2] - 2.0 * y * b[1] - x * b[2], b[0])


@kernels.helper
def root(a: Jet) -> Jet:
    """Return the square root of a; at 0 it has no derivatives."""
    x = np.sqrt(a[0])
    y = part(0.5 * a[1], x)
    return x, y, part(0.5 * a[2] - y * y, x)


@kernels.helper
def dot(x: Vector, y: Vector) -> Jet:
    """Return the inner product of two vectors."""
    return add(add(times(x[0], y[0]), times(x[1], y[1])), times(x[2], y[2]))


@kernels.helper
def cross(x: Vector, y: Vector) -> Vector:
    """Return the vector product of two vectors."""
    return (
        less(times(x[1], y[2]), times(x[2], y[1])),
        less(times(x[2], y[0]), times(x[0], y[2])),
        less(times(x[0], y[1]), times(x[1], y[0])),
    )


@kernels.helper
def apart(x: Vector, y: Vector) -> Vector:
    """Return the vector x - y."""
    return less(x[0], y[0]), less(x[1], y[1]), less(x[2], y[2])


@kernels.helper
def along(x: Vector, s: Jet, y: Vector) -> Vector:
    """Return the vector x + s y."""
    return add(x[0], times(s, y[0])), add(x[1], times(s, y[1])), add(x[2], times(s, y[2]))


@kernels.helper
def moved(x: Vector, c: float, y: Vector) -> Vector:
    """Return the vector x + c y for a constant c."""
    return add(x[0], scaled(c, y[0])), add(x[1], scaled(c, y[1])), add(x[2], scaled(c, y[2]))


@kernels.helper
def opposite(x: Vector) -> Vector:
    """Return the vector -x."""
    return scaled(-1.0, x[0]), scaled(-1.0, x[1]), scaled(-1.0, x[2])


@kernels.helper
def value(x: Vector) -> Point:
    """Return what a vector is now."""
    return x[0][0], x[1][0], x[2][0]
