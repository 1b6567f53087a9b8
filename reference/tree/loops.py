"""Rows that join a point of one body to one of another, from the poses that the outward sweep left."""

from __future__ import annotations

from typing import Any

from crossbody.reference import kernels
from crossbody.reference._kinds import Array
from crossbody.reference.tree import layout
from crossbody.reference.tree.points import point, pull

FIRST, SECOND = 2, 6  # in a row: a node, -1 for the world, and a point in its frame


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
    x1, v1, a1 = _component(_end(p, o + FIRST, w), k)
    x2, v2, a2 = _component(_end(p, o + SECOND, w), k)
    return x1 - x2, v1 - v2, a1 - a2


@kernels.helper
def connect_columns(p: Array, i: int, w: Array, H: Array) -> None:
    """Fill H (n,) of row i along the joints of both points."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    k = int(p[o + 1].real)
    n = (1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
    for end in range(2):
        at, sign = (o + FIRST, 1.0) if end == 0 else (o + SECOND, -1.0)
        x = _end(p, at, w)
        pull(p, w, int(p[at].real), sign, n, (x[0][0], x[1][0], x[2][0]), H)
