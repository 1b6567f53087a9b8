"""The two sweeps of a tree: outwards pose, velocity and acceleration; inwards composite inertia, bias and M.

World axes throughout, and one reference point a tree, the origin of its root: a composite inertia is ten additions and
a force six. Positions count from there, so that what its bodies are to each other is as exact far from the world's
origin as near. Equations: Featherstone, Rigid Body Dynamics Algorithms (2008), chapters 5 and 6, in one frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.kinds import Array
from crossbody.reference.tree import layout


@kernels.helper
def cross(a: Any, b: Any, c: Any, x: Any, y: Any, z: Any) -> tuple[Any, Any, Any]:
    """Return the cross product of two vectors."""
    return b * z - c * y, c * x - a * z, a * y - b * x


@kernels.helper
def turned(w: Array, x: int, a: Any, b: Any, c: Any) -> tuple[Any, Any, Any]:
    """Return a vector in the axes of the pose at w[x:] in world axes."""
    return (
        w[x] * a + w[x + 1] * b + w[x + 2] * c,
        w[x + 3] * a + w[x + 4] * b + w[x + 5] * c,
        w[x + 6] * a + w[x + 7] * b + w[x + 8] * c,
    )


@kernels.helper
def put(w: Array, at: int, a: tuple[Any, Any, Any], b: tuple[Any, Any, Any]) -> None:
    """Write two vectors."""
    w[at], w[at + 1], w[at + 2] = a
    w[at + 3], w[at + 4], w[at + 5] = b


@kernels.helper
def pose(q: Array, node: Array, w: Array, above: Array, rooted: bool) -> None:
    """Fill the pose of a node from its parent's, or the world's if it is a root."""
    kind, at = int(node[layout.TYPE].real), int(node[layout.Q].real)
    if kind >= layout.SLIDE:
        angle = q[at] - node[layout.REFERENCE]
        c, s = (angle, 0.0 * angle) if kind == layout.SLIDE else (np.cos(angle), np.sin(angle))
        a, b, d = layout.POSE, layout.POSE + 12, layout.POSE + 24
        if rooted:
            for k in range(12):
                w[k] = node[a + k] + c * node[b + k] + s * node[d + k]
            return
        for k in range(4):
            # One column of the rotation at a time, the position last; R is kept by rows.
            i0, i1, i2 = (k, k + 3, k + 6) if k < 3 else (9, 10, 11)
            l0 = node[a + i0] + c * node[b + i0] + s * node[d + i0]
            l1 = node[a + i1] + c * node[b + i1] + s * node[d + i1]
            l2 = node[a + i2] + c * node[b + i2] + s * node[d + i2]
            for r in range(3):
                value = above[3 * r] * l0 + above[3 * r + 1] * l1 + above[3 * r + 2] * l2
                if k < 3:
                    w[3 * r + k] = value
                else:
                    w[9 + r] = value + above[9 + r]
        return
    turn = at + 3 if kind == layout.FREE else at
    a0, a1, a2, a3 = q[turn], q[turn + 1], q[turn + 2], q[turn + 3]
    n = 2.0 / (a0 * a0 + a1 * a1 + a2 * a2 + a3 * a3)
    r0, r1, r2 = 1.0 - n * (a2 * a2 + a3 * a3), n * (a1 * a2 - a0 * a3), n * (a1 * a3 + a0 * a2)
    r3, r4, r5 = n * (a1 * a2 + a0 * a3), 1.0 - n * (a1 * a1 + a3 * a3), n * (a2 * a3 - a0 * a1)
    r6, r7, r8 = n * (a1 * a3 - a0 * a2), n * (a2 * a3 + a0 * a1), 1.0 - n * (a1 * a1 + a2 * a2)
    if kind == layout.FREE:
        w[0], w[1], w[2], w[3], w[4], w[5] = r0, r1, r2, r3, r4, r5
        w[6], w[7], w[8] = r6, r7, r8
        w[9], w[10], w[11] = q[at], q[at + 1], q[at + 2]
        return
    a = layout.POSE
    g0, g1, g2 = node[layout.ANCHOR], node[layout.ANCHOR + 1], node[layout.ANCHOR + 2]
    m0 = g0 - r0 * g0 - r1 * g1 - r2 * g2
    m1 = g1 - r3 * g0 - r4 * g1 - r5 * g2
    m2 = g2 - r6 * g0 - r7 * g1 - r8 * g2
    b0, b1, b2 = node[a], node[a + 1], node[a + 2]  # the constant pose before the joint
    b3, b4, b5 = node[a + 3], node[a + 4], node[a + 5]
    b6, b7, b8 = node[a + 6], node[a + 7], node[a + 8]
    l0, l1, l2 = b0 * r0 + b1 * r3 + b2 * r6, b0 * r1 + b1 * r4 + b2 * r7, b0 * r2 + b1 * r5 + b2 * r8
    l3, l4, l5 = b3 * r0 + b4 * r3 + b5 * r6, b3 * r1 + b4 * r4 + b5 * r7, b3 * r2 + b4 * r5 + b5 * r8
    l6, l7, l8 = b6 * r0 + b7 * r3 + b8 * r6, b6 * r1 + b7 * r4 + b8 * r7, b6 * r2 + b7 * r5 + b8 * r8
    t0 = node[a + 9] + b0 * m0 + b1 * m1 + b2 * m2
    t1 = node[a + 10] + b3 * m0 + b4 * m1 + b5 * m2
    t2 = node[a + 11] + b6 * m0 + b7 * m1 + b8 * m2
    if rooted:
        w[0], w[1], w[2], w[3], w[4], w[5] = l0, l1, l2, l3, l4, l5
        w[6], w[7], w[8], w[9], w[10], w[11] = l6, l7, l8, t0, t1, t2
        return
    for r in range(3):
        c0, c1, c2 = above[3 * r], above[3 * r + 1], above[3 * r + 2]
        w[3 * r] = c0 * l0 + c1 * l3 + c2 * l6
        w[3 * r + 1] = c0 * l1 + c1 * l4 + c2 * l7
        w[3 * r + 2] = c0 * l2 + c1 * l5 + c2 * l8
        w[9 + r] = above[9 + r] + c0 * t0 + c1 * t1 + c2 * t2


@kernels.helper
def columns(node: Array, w: Array, s: Array) -> int:
    """Fill the motion subspace s of a node with the pose in w; return its number of columns."""
    kind = int(node[layout.TYPE].real)
    if kind == layout.SLIDE:
        along = turned(w, 0, node[layout.AXIS], node[layout.AXIS + 1], node[layout.AXIS + 2])
        none = 0.0 * w[0]
        put(s, 0, (none, none, none), along)
        return 1
    d0, d1, d2 = turned(w, 0, node[layout.ANCHOR], node[layout.ANCHOR + 1], node[layout.ANCHOR + 2])
    d0, d1, d2 = d0 + w[9], d1 + w[10], d2 + w[11]
    if kind == layout.HINGE:
        axis = turned(w, 0, node[layout.AXIS], node[layout.AXIS + 1], node[layout.AXIS + 2])
        put(s, 0, axis, cross(d0, d1, d2, axis[0], axis[1], axis[2]))
        return 1
    first = 0
    if kind == layout.FREE:
        first, zero = 3, 0.0 * w[0]
        for k in range(3):
            put(s, layout.DOF_SCRATCH * k, (zero, zero, zero), (zero, zero, zero))
            s[layout.DOF_SCRATCH * k + 3 + k] = 1.0
    for k in range(3):
        axis = (w[k], w[3 + k], w[6 + k])
        put(s, layout.DOF_SCRATCH * (first + k), axis, cross(d0, d1, d2, axis[0], axis[1], axis[2]))
    return first + 3


@kernels.helper
def outwards(q: Array, v: Array, p: Array, scratch: Array) -> None:
    """Fill pose, velocity and acceleration at v' = 0 of every node; weight is an acceleration of the world."""
    nodes, at_node = int(p[layout.NODES].real), int(p[layout.AT_NODE].real)
    # Slices, because a constant index costs nothing more, and a computed one is tested for being negative.
    for i in range(nodes):
        node, w = p[at_node + layout.NODE * i :], scratch[layout.NODE_SCRATCH * i :]
        parent, first = int(node[layout.PARENT].real), int(node[layout.V].real)
        up = scratch[layout.NODE_SCRATCH * max(parent, 0) :]
        pose(q, node, w, up, parent < 0)
        if parent < 0:
            for k in range(3):
                w[layout.ORIGIN_AT + k] = w[9 + k]
                w[9 + k] = 0.0 * w[0]
        s = scratch[layout.NODE_SCRATCH * nodes + layout.DOF_SCRATCH * first :]
        count = columns(node, w, s)
        r = v[first]
        m0, m1, m2, m3, m4, m5 = s[0] * r, s[1] * r, s[2] * r, s[3] * r, s[4] * r, s[5] * r
        for k in range(1, count):
            b, r = layout.DOF_SCRATCH * k, v[first + k]
            m0, m1, m2 = m0 + s[b] * r, m1 + s[b + 1] * r, m2 + s[b + 2] * r
            m3, m4, m5 = m3 + s[b + 3] * r, m4 + s[b + 4] * r, m5 + s[b + 5] * r
        if parent < 0:
            put(w, layout.V_AT, (m0, m1, m2), (m3, m4, m5))
            b0, b1, b2 = 0.0 * m0, 0.0 * m0, 0.0 * m0
            if count == 6:  # its linear columns are fixed in the world, only the angular ones turn
                b0, b1, b2 = cross(m3, m4, m5, m0, m1, m2)
            zero, g = 0.0 * m0, layout.GRAVITY
            put(w, layout.A_AT, (zero, zero, zero), (b0 - p[g], b1 - p[g + 1], b2 - p[g + 2]))
            continue
        u, a = layout.V_AT, layout.A_AT
        w0, w1, w2, l0, l1, l2 = up[u], up[u + 1], up[u + 2], up[u + 3], up[u + 4], up[u + 5]
        put(w, layout.V_AT, (w0 + m0, w1 + m1, w2 + m2), (l0 + m3, l1 + m4, l2 + m5))
        t0, t1, t2 = cross(w0, w1, w2, m0, m1, m2)
        b0, b1, b2 = cross(w0, w1, w2, m3, m4, m5)
        c0, c1, c2 = cross(l0, l1, l2, m0, m1, m2)
        turning = (up[a] + t0, up[a + 1] + t1, up[a + 2] + t2)
        put(w, layout.A_AT, turning, (up[a + 3] + b0 + c0, up[a + 4] + b1 + c1, up[a + 5] + b2 + c2))


@kernels.helper
def times(
    w: Array, i: int, a: Any, b: Any, c: Any, x: Any, y: Any, z: Any
) -> tuple[tuple[Any, Any, Any], tuple[Any, Any, Any]]:
    """Return the inertia at w[i:] times a motion: moment and force."""
    m, h0, h1, h2 = w[i], w[i + 1], w[i + 2], w[i + 3]
    n0, n1, n2 = cross(h0, h1, h2, x, y, z)
    f0, f1, f2 = cross(a, b, c, h0, h1, h2)
    return (
        (
            w[i + 4] * a + w[i + 7] * b + w[i + 8] * c + n0,
            w[i + 7] * a + w[i + 5] * b + w[i + 9] * c + n1,
            w[i + 8] * a + w[i + 9] * b + w[i + 6] * c + n2,
        ),
        (m * x + f0, m * y + f1, m * z + f2),
    )


@kernels.helper
def lift(p: Array, node: Array, w: Array) -> None:
    """Take the weight that a node is spared, -c m g at its parts' centres, from its force."""
    k, g = layout.LIFT, layout.GRAVITY
    c0, c1, c2 = turned(w, 0, node[k + 1], node[k + 2], node[k + 3])
    for r in range(3):
        w[layout.F_AT + 3 + r] += node[k] * p[g + r]
    d0, d1, d2 = w[9], w[10], w[11]
    n0, n1, n2 = cross(c0 + node[k] * d0, c1 + node[k] * d1, c2 + node[k] * d2, p[g], p[g + 1], p[g + 2])
    w[layout.F_AT] += n0
    w[layout.F_AT + 1] += n1
    w[layout.F_AT + 2] += n2


@kernels.helper
def inertia(p: Array, node: Array, w: Array) -> None:
    """Fill inertia and force of a node: mass, first moment, second moment (xx yy zz xy xz yz)."""
    i, m = layout.I_AT, node[layout.MASS]
    if m == 0.0:
        for k in range(10):
            w[i + k] = 0.0
        for k in range(6):
            w[layout.F_AT + k] = 0.0
        return
    c0, c1, c2 = turned(w, 0, node[layout.COM], node[layout.COM + 1], node[layout.COM + 2])
    c0, c1, c2 = c0 + w[9], c1 + w[10], c2 + w[11]
    j = layout.INERTIA
    xx, yy, zz, xy, xz, yz = node[j], node[j + 1], node[j + 2], node[j + 3], node[j + 4], node[j + 5]
    # R J first, row by row, then R J R^T: its six entries alone.
    a0, a1, a2 = turned(w, 0, xx, xy, xz)
    b0, b1, b2 = turned(w, 0, xy, yy, yz)
    d0, d1, d2 = turned(w, 0, xz, yz, zz)
    h0, h1, h2 = m * c0, m * c1, m * c2
    J0 = a0 * w[0] + b0 * w[1] + d0 * w[2] + h1 * c1 + h2 * c2
    J1 = a1 * w[3] + b1 * w[4] + d1 * w[5] + h0 * c0 + h2 * c2
    J2 = a2 * w[6] + b2 * w[7] + d2 * w[8] + h0 * c0 + h1 * c1
    J3 = a0 * w[3] + b0 * w[4] + d0 * w[5] - h0 * c1
    J4 = a0 * w[6] + b0 * w[7] + d0 * w[8] - h0 * c2
    J5 = a1 * w[6] + b1 * w[7] + d1 * w[8] - h1 * c2
    w[i], w[i + 1], w[i + 2], w[i + 3] = m, h0, h1, h2
    w[i + 4], w[i + 5], w[i + 6], w[i + 7], w[i + 8], w[i + 9] = J0, J1, J2, J3, J4, J5
    z, y = layout.A_AT, layout.V_AT
    n, f = times(w, i, w[z], w[z + 1], w[z + 2], w[z + 3], w[z + 4], w[z + 5])
    L, P = times(w, i, w[y], w[y + 1], w[y + 2], w[y + 3], w[y + 4], w[y + 5])
    e0, e1, e2 = cross(w[y], w[y + 1], w[y + 2], L[0], L[1], L[2])
    k0, k1, k2 = cross(w[y + 3], w[y + 4], w[y + 5], P[0], P[1], P[2])
    g0, g1, g2 = cross(w[y], w[y + 1], w[y + 2], P[0], P[1], P[2])
    put(w, layout.F_AT, (n[0] + e0 + k0, n[1] + e1 + k1, n[2] + e2 + k2), (f[0] + g0, f[1] + g1, f[2] + g2))
    if node[layout.LIFT] != 0.0:
        lift(p, node, w)


@kernels.helper
def inwards(p: Array, scratch: Array, M: Array, f: Array) -> None:
    """Fill M (n, n) and take the bias C + G from f (n,)."""
    nodes, at_node, at_dof = int(p[layout.NODES].real), int(p[layout.AT_NODE].real), int(p[layout.AT_DOF].real)
    spaces = scratch[layout.NODE_SCRATCH * nodes :]
    for i in range(nodes):
        inertia(p, p[at_node + layout.NODE * i :], scratch[layout.NODE_SCRATCH * i :])
    M[:, :] = 0.0
    for i in range(nodes - 1, -1, -1):
        node, w = p[at_node + layout.NODE * i :], scratch[layout.NODE_SCRATCH * i :]
        parent, first, kind = int(node[layout.PARENT].real), int(node[layout.V].real), node[layout.TYPE].real
        width = 1 if kind >= layout.SLIDE else (6 if kind == layout.FREE else 3)
        y = layout.F_AT
        for j in range(first + width - 1, first - 1, -1):
            s, dof = spaces[layout.DOF_SCRATCH * j :], p[at_dof + layout.DOF * j :]
            a, b, c, d, e, g = s[0], s[1], s[2], s[3], s[4], s[5]
            f[j] -= a * w[y] + b * w[y + 1] + c * w[y + 2] + d * w[y + 3] + e * w[y + 4] + g * w[y + 5]
            N, F = times(w, layout.I_AT, a, b, c, d, e, g)
            own = a * N[0] + b * N[1] + c * N[2] + d * F[0] + e * F[1] + g * F[2]
            M[j, j] = own + dof[layout.ARMATURE]
            k = int(dof[layout.BEFORE].real)
            while k >= 0:
                s = spaces[layout.DOF_SCRATCH * k :]
                value = s[0] * N[0] + s[1] * N[1] + s[2] * N[2] + s[3] * F[0] + s[4] * F[1] + s[5] * F[2]
                M[j, k] = value
                M[k, j] = value
                k = int(p[at_dof + layout.DOF * k].real)
        if parent >= 0:
            up = scratch[layout.NODE_SCRATCH * parent :]
            for k in range(6):
                up[y + k] += w[y + k]
            for k in range(10):
                up[layout.I_AT + k] += w[layout.I_AT + k]
