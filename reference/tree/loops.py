"""Rows that join a point of one body to one of another, from the poses that the outward sweep left.

With the motion (w, l) and acceleration (c, b) of a node about the reference point O of its tree, a point at r from
O has

    x' = l + w x r,    x'' = b + c x r + w x x'        and columns  S_lin + S_ang x r  along its joints.

The world's acceleration -g, which stands for the weight, is in b of every node: it is taken off.
"""

from __future__ import annotations

from typing import Any

from crossbody.reference import kernels
from crossbody.reference._kinds import Array
from crossbody.reference.tree import layout
from crossbody.reference.tree.sweeps import cross, turned

FIRST, SECOND = 2, 6  # in a row: a node, -1 for the world, and a point in its frame


@kernels.helper
def _arm(p: Array, o: int, w: Array) -> tuple[Any, Any, Any]:
    """Return the place of the point at p[o + 1:] of the node at p[o]: from its tree's reference point."""
    node = int(p[o].real)
    x = layout.NODE_SCRATCH * node
    at_node = int(p[layout.AT_NODE].real) + layout.NODE * node
    root = layout.NODE_SCRATCH * int(p[at_node + layout.ROOT].real)
    a, b, c = turned(w, x, p[o + 1], p[o + 2], p[o + 3])
    return a + w[x + 9] - w[root + 9], b + w[x + 10] - w[root + 10], c + w[x + 11] - w[root + 11]


@kernels.helper
def _moving(p: Array, o: int, w: Array, k: int) -> tuple[Any, Any, Any]:
    """Return component k of the place, velocity and acceleration at v' = 0 of the point at p[o:]."""
    node, zero = int(p[o].real), 0.0 * w[0]
    if node < 0:
        return p[o + 1 + k] + zero, zero, zero
    x = layout.NODE_SCRATCH * node
    at_node = int(p[layout.AT_NODE].real) + layout.NODE * node
    root = layout.NODE_SCRATCH * int(p[at_node + layout.ROOT].real)
    y, z = x + layout.V_AT, x + layout.A_AT
    r0, r1, r2 = _arm(p, o, w)
    n = cross(w[y], w[y + 1], w[y + 2], r0, r1, r2)
    s0, s1, s2 = n[0] + w[y + 3], n[1] + w[y + 4], n[2] + w[y + 5]
    m = cross(w[z], w[z + 1], w[z + 2], r0, r1, r2)
    e = cross(w[y], w[y + 1], w[y + 2], s0, s1, s2)
    g = layout.GRAVITY
    if k == 0:
        return r0 + w[root + 9], s0, w[z + 3] + m[0] + e[0] + p[g]
    if k == 1:
        return r1 + w[root + 10], s1, w[z + 4] + m[1] + e[1] + p[g + 1]
    return r2 + w[root + 11], s2, w[z + 5] + m[2] + e[2] + p[g + 2]


@kernels.helper
def connect(p: Array, i: int, w: Array) -> tuple[Any, Any, Any]:
    """Return gap, rate and H' v of row i: component k of x1 - x2."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    k = int(p[o + 1].real)
    x1, v1, a1 = _moving(p, o + FIRST, w, k)
    x2, v2, a2 = _moving(p, o + SECOND, w, k)
    return x1 - x2, v1 - v2, a1 - a2


@kernels.helper
def connect_columns(p: Array, i: int, w: Array, H: Array) -> None:
    """Fill H (n,) of row i along the joints of both points."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    k, at_dof = int(p[o + 1].real), int(p[layout.AT_DOF].real)
    spaces = layout.NODE_SCRATCH * int(p[layout.NODES].real)
    for end in range(2):
        at, sign = (o + FIRST, 1.0) if end == 0 else (o + SECOND, -1.0)
        node = int(p[at].real)
        if node < 0:
            continue
        r0, r1, r2 = _arm(p, at, w)
        at_node = int(p[layout.AT_NODE].real) + layout.NODE * node
        kind = int(p[at_node + layout.TYPE].real)
        dof = int(p[at_node + layout.V].real)
        dof += 5 if kind == layout.FREE else (2 if kind == layout.BALL else 0)
        while dof >= 0:
            s = spaces + layout.DOF_SCRATCH * dof
            n = cross(w[s], w[s + 1], w[s + 2], r0, r1, r2)
            turn = n[0] if k == 0 else (n[1] if k == 1 else n[2])
            H[dof] += sign * (w[s + 3 + k] + turn)
            dof = int(p[at_dof + layout.DOF * dof].real)
