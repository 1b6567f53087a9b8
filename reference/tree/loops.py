"""Rows that join a point of one body to one of another, or its axes, from the poses that the outward sweep left.

Axes: e = the quaternion of E = R2' R1, W = R2' (w1 - w2) the angular velocity between them in the second's axes,

    h = s vec(e),    h' = s/2 (e0 W + W x vec(e)),    H' v = s/2 (e0 C + C x vec(e)) - s/4 |W|^2 vec(e)

with C = R2' (c1 - c2 - w2 x (w1 - w2)) the rate of W at v' = 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.kinds import Array
from crossbody.reference.pairs.jets import value
from crossbody.reference.tree import layout
from crossbody.reference.tree.points import apart, point, pull, twist
from crossbody.reference.tree.sweeps import cross, turned

FIRST, SECOND = 2, 6  # in a row: a node, -1 for the world, and a point in its frame
FIRST_AXES, SECOND_AXES, SCALE = 2, 12, 22  # in a row: a node and the rotation of axes in its frame, by rows


@kernels.helper
def _end(p: Array, o: int, w: Array) -> Any:
    """Return the point at p[o + 1:] of the node at p[o] and its motion."""
    return point(p, w, int(p[o].real), p[o + 1], p[o + 2], p[o + 3])


@kernels.helper
def _component(x: Any, k: int) -> Any:
    return x[0] if k == 0 else (x[1] if k == 1 else x[2])


@kernels.helper
def connect(p: Array, i: int, w: Array) -> tuple[Any, Any, Any]:
    """Return gap, rate and H' v of row i: component k of x1 - x2."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    k = int(p[o + 1].real)
    first, second = apart(p, w, o + FIRST, o + SECOND)
    (x1, v1, a1), (x2, v2, a2) = _component(first, k), _component(second, k)
    return x1 - x2, v1 - v2, a1 - a2


@kernels.helper
def connect_columns(p: Array, i: int, w: Array, H: Array) -> None:
    """Fill H (n,) of row i along the joints of both points."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    k = int(p[o + 1].real)
    n = (1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
    for end in range(2):
        at, sign = (o + FIRST, 1.0) if end == 0 else (o + SECOND, -1.0)
        pull(p, w, int(p[at].real), sign, n, value(_end(p, at, w)), H)


@kernels.helper
def _axis(p: Array, o: int, w: Array, k: int) -> Any:
    """Return column k of the axes at p[o + 1:] of the node at p[o], in the world."""
    node, x, y, z = int(p[o].real), p[o + 1 + k], p[o + 4 + k], p[o + 7 + k]
    if node < 0:
        zero = 0.0 * w[0]
        return x + zero, y + zero, z + zero
    return turned(w, layout.NODE_SCRATCH * node, x, y, z)


@kernels.helper
def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernels.helper
def _between(p: Array, o: int, w: Array) -> Any:
    """Return the second's three axes in the world, and e0 and vec(e) of the first's seen from there."""
    x, y, z = _axis(p, o + SECOND_AXES, w, 0), _axis(p, o + SECOND_AXES, w, 1), _axis(p, o + SECOND_AXES, w, 2)
    a, b, c = _axis(p, o + FIRST_AXES, w, 0), _axis(p, o + FIRST_AXES, w, 1), _axis(p, o + FIRST_AXES, w, 2)
    # Of the two quaternions the one with e0 > 0; the formula is good away from a half turn, where h has no force left.
    e0 = 0.5 * np.sqrt(1.0 + _dot(x, a) + _dot(y, b) + _dot(z, c))
    n = 0.25 / e0
    e = (n * (_dot(z, b) - _dot(y, c)), n * (_dot(x, c) - _dot(z, a)), n * (_dot(y, a) - _dot(x, b)))
    return (x, y, z), e0, e


@kernels.helper
def _angular(p: Array, o: int, w: Array, at: int) -> Any:
    """Return the difference of the entries at `at` (angular velocities or accelerations) of the row's two nodes."""
    x, y, z = 0.0 * w[0], 0.0 * w[0], 0.0 * w[0]
    for end in range(2):
        node, sign = (int(p[o + FIRST_AXES].real), 1.0) if end == 0 else (int(p[o + SECOND_AXES].real), -1.0)
        if node >= 0:
            i = layout.NODE_SCRATCH * node + at
            x, y, z = x + sign * w[i], y + sign * w[i + 1], z + sign * w[i + 2]
    return x, y, z


@kernels.helper
def turn(p: Array, i: int, w: Array) -> tuple[Any, Any, Any]:
    """Return gap, rate and H' v of row i: component k of h."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    k, s = int(p[o + 1].real), p[o + SCALE]
    axes, e0, e = _between(p, o, w)
    d, c, second = _angular(p, o, w, layout.V_AT), _angular(p, o, w, layout.A_AT), int(p[o + SECOND_AXES].real)
    if second >= 0:
        at = layout.NODE_SCRATCH * second + layout.V_AT
        u = cross(w[at], w[at + 1], w[at + 2], d[0], d[1], d[2])
        c = (c[0] - u[0], c[1] - u[1], c[2] - u[2])
    W = (_dot(axes[0], d), _dot(axes[1], d), _dot(axes[2], d))
    C = (_dot(axes[0], c), _dot(axes[1], c), _dot(axes[2], c))
    across, bent = cross(W[0], W[1], W[2], e[0], e[1], e[2]), cross(C[0], C[1], C[2], e[0], e[1], e[2])
    h, along, turned_on = _component(e, k), _component(W, k), _component(C, k)
    hd = 0.5 * (e0 * along + _component(across, k))
    Hdv = 0.5 * (e0 * turned_on + _component(bent, k)) - 0.25 * _dot(W, W) * h
    return s * h, s * hd, s * Hdv


@kernels.helper
def turn_columns(p: Array, i: int, w: Array, H: Array) -> None:
    """Fill H (n,) of row i along the joints of both bodies."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    k, s = int(p[o + 1].real), 0.5 * p[o + SCALE]
    axes, e0, e = _between(p, o, w)
    # The direction of W whose component is h': e0 times axis k, and vec(e) x axis k.
    unit = (1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
    b = cross(e[0], e[1], e[2], unit[0], unit[1], unit[2])
    b = (s * (b[0] + e0 * unit[0]), s * (b[1] + e0 * unit[1]), s * (b[2] + e0 * unit[2]))
    n0 = axes[0][0] * b[0] + axes[1][0] * b[1] + axes[2][0] * b[2]
    n1 = axes[0][1] * b[0] + axes[1][1] * b[1] + axes[2][1] * b[2]
    n2 = axes[0][2] * b[0] + axes[1][2] * b[1] + axes[2][2] * b[2]
    twist(p, w, int(p[o + FIRST_AXES].real), 1.0, (n0, n1, n2), H)
    twist(p, w, int(p[o + SECOND_AXES].real), -1.0, (n0, n1, n2), H)
