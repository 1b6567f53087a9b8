"""Rows that bound the distance of two points, of one body or of two, or of one and the world."""

from __future__ import annotations

from typing import Any

from crossbody.reference import kernels
from crossbody.reference._kinds import Array
from crossbody.reference.pairs import solids
from crossbody.reference.pairs.jets import value
from crossbody.reference.tree import layout
from crossbody.reference.tree.points import apart, point, pull

SIGN, FIRST, SECOND, BOUND = 1, 2, 6, 10  # in a row: 1 below, -1 above; a node and a point in its frame, twice


@kernels.helper
def _between(p: Array, o: int, w: Array) -> Any:
    """Return the distance of the second point from the first as a jet, and its direction."""
    one, two = apart(p, w, o + FIRST, o + SECOND)
    d, n = solids.point(two, one)
    return d, n


@kernels.helper
def string(p: Array, i: int, w: Array) -> tuple[Any, Any, Any]:
    """Return gap, rate and H' v of row i."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    d, sign = _between(p, o, w)[0], p[o + SIGN]
    return sign * (d[0] - p[o + BOUND]), sign * d[1], sign * d[2]


@kernels.helper
def string_columns(p: Array, i: int, w: Array, H: Array) -> None:
    """Fill H (n,) of row i along the joints of both points."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    sign, (_, n) = p[o + SIGN].real, _between(p, o, w)
    for end in range(2):
        at, along = (o + FIRST, -sign) if end == 0 else (o + SECOND, sign)
        node = int(p[at].real)
        pull(p, w, node, along, n, value(point(p, w, node, p[at + 1], p[at + 2], p[at + 3])), H)
