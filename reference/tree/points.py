"""Points and directions that a node carries: how they move, and what a force there is along the joints.

With the motion (w, l) and acceleration (c, b) of a node about the reference point O of its tree, a point at r from
O has

    x' = l + w x r,    x'' = b + c x r + w x x'        and columns  S_lin + S_ang x r  along its joints.

The world's acceleration -g, which stands for the weight, is in b of every node: it is taken off.
"""

from __future__ import annotations

from typing import Any

from crossbody.reference import kernels
from crossbody.reference.kinds import Array
from crossbody.reference.tree import layout
from crossbody.reference.tree.sweeps import cross, turned


@kernels.helper
def _root(p: Array, node: int) -> int:
    """Return the root of a node's tree, -1 of the world's."""
    return int(p[int(p[layout.AT_NODE].real) + layout.NODE * node + layout.ROOT].real) if node >= 0 else -1


@kernels.helper
def _origin(p: Array, w: Array, node: int) -> Any:
    """Return the reference point of a node's tree in the world."""
    o = layout.NODE_SCRATCH * _root(p, node) + layout.ORIGIN_AT
    return w[o], w[o + 1], w[o + 2]


@kernels.helper
def point(p: Array, w: Array, node: int, a: Any, b: Any, c: Any) -> Any:
    """Return three times place, velocity and acceleration at v' = 0 of a point in a node's frame; node -1 rests."""
    if node < 0:
        zero = 0.0 * w[0]
        return (a + zero, zero, zero), (b + zero, zero, zero), (c + zero, zero, zero)
    (x, u, e), (y, v, f), (z, t, g) = _from_origin(p, w, node, a, b, c)
    o = _origin(p, w, node)
    return (o[0] + x, u, e), (o[1] + y, v, f), (o[2] + z, t, g)


@kernels.helper
def apart(p: Array, w: Array, one: int, other: int) -> Any:
    """Return the two points at p[one:] and p[other:], each a node and a place in its frame, and their motion.

    They count from the reference point of their tree if it is the same one: their difference is then as exact far from
    the world's origin as near.
    """
    first, second = int(p[one].real), int(p[other].real)
    if first >= 0 and _root(p, first) == _root(p, second):
        return (
            _from_origin(p, w, first, p[one + 1], p[one + 2], p[one + 3]),
            _from_origin(p, w, second, p[other + 1], p[other + 2], p[other + 3]),
        )
    return (
        point(p, w, first, p[one + 1], p[one + 2], p[one + 3]),
        point(p, w, second, p[other + 1], p[other + 2], p[other + 3]),
    )


@kernels.helper
def _from_origin(p: Array, w: Array, node: int, a: Any, b: Any, c: Any) -> Any:
    """Return the same of a point of a node that moves, its place from the reference point of its tree."""
    x, g = layout.NODE_SCRATCH * node, layout.GRAVITY
    y, z = x + layout.V_AT, x + layout.A_AT
    d0, d1, d2 = turned(w, x, a, b, c)
    d0, d1, d2 = d0 + w[x + 9], d1 + w[x + 10], d2 + w[x + 11]
    u0, u1, u2 = cross(w[y], w[y + 1], w[y + 2], d0, d1, d2)
    u0, u1, u2 = u0 + w[y + 3], u1 + w[y + 4], u2 + w[y + 5]
    e = cross(w[z], w[z + 1], w[z + 2], d0, d1, d2)
    f = cross(w[y], w[y + 1], w[y + 2], u0, u1, u2)
    return (
        (d0, u0, w[z + 3] + p[g] + e[0] + f[0]),
        (d1, u1, w[z + 4] + p[g + 1] + e[1] + f[1]),
        (d2, u2, w[z + 5] + p[g + 2] + e[2] + f[2]),
    )


@kernels.helper
def field(p: Array, w: Array, node: int, x: Any) -> Any:
    """Return the velocity of a node's material at x, three times place and velocity, and how it changes along x.

    At v' = 0; of the world's node, -1, both are zero.
    """
    zero = 0.0 * w[0]
    if node < 0:
        return (zero, zero, zero), (zero, zero, zero)
    y, g = layout.NODE_SCRATCH * node + layout.V_AT, layout.GRAVITY
    z, o = layout.NODE_SCRATCH * node + layout.A_AT, _origin(p, w, node)
    d0, d1, d2 = x[0][0] - o[0], x[1][0] - o[1], x[2][0] - o[2]
    u = cross(w[y], w[y + 1], w[y + 2], d0, d1, d2)
    e = cross(w[z], w[z + 1], w[z + 2], d0, d1, d2)
    f = cross(w[y], w[y + 1], w[y + 2], x[0][1], x[1][1], x[2][1])
    return (
        (w[y + 3] + u[0], w[y + 4] + u[1], w[y + 5] + u[2]),
        (
            w[z + 3] + p[g] + e[0] + f[0],
            w[z + 4] + p[g + 1] + e[1] + f[1],
            w[z + 5] + p[g + 2] + e[2] + f[2],
        ),
    )


@kernels.helper
def direction(w: Array, node: int, a: Any, b: Any, c: Any) -> Any:
    """Return the same of a direction in a node's frame."""
    zero = 0.0 * w[0]
    if node < 0:
        return (a + zero, zero, zero), (b + zero, zero, zero), (c + zero, zero, zero)
    x = layout.NODE_SCRATCH * node
    y, z = x + layout.V_AT, x + layout.A_AT
    r0, r1, r2 = turned(w, x, a, b, c)
    u = cross(w[y], w[y + 1], w[y + 2], r0, r1, r2)
    e = cross(w[z], w[z + 1], w[z + 2], r0, r1, r2)
    f = cross(w[y], w[y + 1], w[y + 2], u[0], u[1], u[2])
    return (r0, u[0], e[0] + f[0]), (r1, u[1], e[1] + f[1]), (r2, u[2], e[2] + f[2])


@kernels.helper
def _last(p: Array, node: int) -> int:
    """Return the last velocity of a node."""
    o = int(p[layout.AT_NODE].real) + layout.NODE * node
    kind = int(p[o + layout.TYPE].real)
    return int(p[o + layout.V].real) + (5 if kind == layout.FREE else (2 if kind == layout.BALL else 0))


@kernels.helper
def pull(p: Array, w: Array, node: int, sign: float, n: Any, at: Any, H: Array) -> None:
    """Add what a force of size `sign` along n at a place of a node is in the velocities on the way to the world."""
    if node < 0:
        return
    o = _origin(p, w, node)
    m0, m1, m2 = cross(at[0] - o[0], at[1] - o[1], at[2] - o[2], n[0], n[1], n[2])
    spaces, at_dof = layout.NODE_SCRATCH * int(p[layout.NODES].real), int(p[layout.AT_DOF].real)
    j = _last(p, node)
    while j >= 0:
        s = spaces + layout.DOF_SCRATCH * j
        along = w[s + 3] * n[0] + w[s + 4] * n[1] + w[s + 5] * n[2]
        H[j] += sign * (w[s] * m0 + w[s + 1] * m1 + w[s + 2] * m2 + along)
        j = int(p[at_dof + layout.DOF * j].real)


@kernels.helper
def twist(p: Array, w: Array, node: int, sign: float, n: Any, H: Array) -> None:
    """Add the same of a torque."""
    if node < 0:
        return
    spaces, at_dof = layout.NODE_SCRATCH * int(p[layout.NODES].real), int(p[layout.AT_DOF].real)
    j = _last(p, node)
    while j >= 0:
        s = spaces + layout.DOF_SCRATCH * j
        H[j] += sign * (w[s] * n[0] + w[s + 1] * n[1] + w[s + 2] * n[2])
        j = int(p[at_dof + layout.DOF * j].real)
