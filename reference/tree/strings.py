"""Distances of two points, of one body or of two, or of one and the world: their bounds, and forces along them."""

from __future__ import annotations

from typing import Any

from crossbody.reference import kernels
from crossbody.reference.kinds import Array
from crossbody.reference.pairs import solids
from crossbody.reference.pairs.jets import value
from crossbody.reference.tree import layout
from crossbody.reference.tree.points import apart, point, pull

SIGN, ENDS, BOUND = 1, 2, 10  # in a row: 1 below, -1 above; a node and a point in its frame, twice
END = 4  # numbers of one end


@kernels.helper
def between(p: Array, o: int, w: Array) -> Any:
    """Return the distance of the second end at p[o:] from the first as a jet, and its direction."""
    one, two = apart(p, w, o, o + END)
    d, D, length = solids.point(two, one)
    return d, solids.unit(D, length)


@kernels.helper
def along(p: Array, o: int, w: Array, force: Any, f: Array) -> None:
    """Add what a force that lengthens the distance of the ends at p[o:] does to the joints."""
    _, n = between(p, o, w)
    n = (force * n[0], force * n[1], force * n[2])
    for end in range(2):
        at = o + END * end
        node = int(p[at].real)
        where = value(point(p, w, node, p[at + 1], p[at + 2], p[at + 3]))
        pull(p, w, node, 2.0 * end - 1.0, n, where, f)


@kernels.helper
def string(p: Array, i: int, w: Array) -> tuple[Any, Any, Any]:
    """Return gap, rate and H' v of row i."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    d, sign = between(p, o + ENDS, w)[0], p[o + SIGN]
    return sign * (d[0] - p[o + BOUND]), sign * d[1], sign * d[2]


@kernels.helper
def string_columns(p: Array, i: int, w: Array, H: Array) -> None:
    """Fill H (n,) of row i along the joints of both points."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    along(p, o + ENDS, w, p[o + SIGN], H)
