"""The two sweeps of a tree: outwards pose, velocity and acceleration; inwards composite inertia, bias and M.

World axes throughout, and one reference point a tree, the origin of its root: a composite inertia is ten additions and
a force six. Positions count from there, so that what its bodies are to each other is as exact far from the world's
origin as near. Equations: Featherstone, Rigid Body Dynamics Algorithms (2008), chapters 5 and 6, in one frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference._kinds import Array
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
def pose(q: Array, p: Array, o: int, w: Array, x: int, above: int) -> None:
    """Fill the pose at w[x:] of the node at p[o:] whose parent's pose is at w[above:], or the world's if above < 0."""
    kind, at = int(p[o + layout.TYPE].real), int(p[o + layout.Q].real)
    if kind >= layout.SLIDE:
        angle = q[at] - p[o + layout.REFERENCE]
        c, s = (angle, 0.0 * angle) if kind == layout.SLIDE else (np.cos(angle), np.sin(angle))
        a, b, d = o + layout.POSE, o + layout.POSE + 12, o + layout.POSE + 24
        if above < 0:
            for k in range(12):
                w[x + k] = p[a + k] + c * p[b + k] + s * p[d + k]
            return
        for k in range(4):
            # One column of the rotation at a time, the position last; R is kept by rows.
            i0, i1, i2 = (k, k + 3, k + 6) if k < 3 else (9, 10, 11)
            l0 = p[a + i0] + c * p[b + i0] + s * p[d + i0]
            l1 = p[a + i1] + c * p[b + i1] + s * p[d + i1]
            l2 = p[a + i2] + c * p[b + i2] + s * p[d + i2]
            for r in range(3):
                value = w[above + 3 * r] * l0 + w[above + 3 * r + 1] * l1 + w[above + 3 * r + 2] * l2
                if k < 3:
                    w[x + 3 * r + k] = value
                else:
                    w[x + 9 + r] = value + w[above + 9 + r]
        return
    turn = at + 3 if kind == layout.FREE else at
    a0, a1, a2, a3 = q[turn], q[turn + 1], q[turn + 2], q[turn + 3]
    n = 2.0 / (a0 * a0 + a1 * a1 + a2 * a2 + a3 * a3)
    r0, r1, r2 = 1.0 - n * (a2 * a2 + a3 * a3), n * (a1 * a2 - a0 * a3), n * (a1 * a3 + a0 * a2)
    r3, r4, r5 = n * (a1 * a2 + a0 * a3), 1.0 - n * (a1 * a1 + a3 * a3), n * (a2 * a3 - a0 * a1)
    r6, r7, r8 = n * (a1 * a3 - a0 * a2), n * (a2 * a3 + a0 * a1), 1.0 - n * (a1 * a1 + a2 * a2)
    if kind == layout.FREE:
        w[x], w[x + 1], w[x + 2], w[x + 3], w[x + 4], w[x + 5] = r0, r1, r2, r3, r4, r5
        w[x + 6], w[x + 7], w[x + 8] = r6, r7, r8
        w[x + 9], w[x + 10], w[x + 11] = q[at], q[at + 1], q[at + 2]
        return
    a = o + layout.POSE
    g0, g1, g2 = p[o + layout.ANCHOR], p[o + layout.ANCHOR + 1], p[o + layout.ANCHOR + 2]
    m0 = g0 - r0 * g0 - r1 * g1 - r2 * g2
    m1 = g1 - r3 * g0 - r4 * g1 - r5 * g2
    m2 = g2 - r6 * g0 - r7 * g1 - r8 * g2
    b0, b1, b2 = p[a], p[a + 1], p[a + 2]  # the constant pose before the joint
    b3, b4, b5 = p[a + 3], p[a + 4], p[a + 5]
    b6, b7, b8 = p[a + 6], p[a + 7], p[a + 8]
    l0, l1, l2 = b0 * r0 + b1 * r3 + b2 * r6, b0 * r1 + b1 * r4 + b2 * r7, b0 * r2 + b1 * r5 + b2 * r8
    l3, l4, l5 = b3 * r0 + b4 * r3 + b5 * r6, b3 * r1 + b4 * r4 + b5 * r7, b3 * r2 + b4 * r5 + b5 * r8
    l6, l7, l8 = b6 * r0 + b7 * r3 + b8 * r6, b6 * r1 + b7 * r4 + b8 * r7, b6 * r2 + b7 * r5 + b8 * r8
    t0 = p[a + 9] + b0 * m0 + b1 * m1 + b2 * m2
    t1 = p[a + 10] + b3 * m0 + b4 * m1 + b5 * m2
    t2 = p[a + 11] + b6 * m0 + b7 * m1 + b8 * m2
    if above < 0:
        w[x], w[x + 1], w[x + 2], w[x + 3], w[x + 4], w[x + 5] = l0, l1, l2, l3, l4, l5
        w[x + 6], w[x + 7], w[x + 8], w[x + 9], w[x + 10], w[x + 11] = l6, l7, l8, t0, t1, t2
        return
    for r in range(3):
        c0, c1, c2 = w[above + 3 * r], w[above + 3 * r + 1], w[above + 3 * r + 2]
        w[x + 3 * r] = c0 * l0 + c1 * l3 + c2 * l6
        w[x + 3 * r + 1] = c0 * l1 + c1 * l4 + c2 * l7
        w[x + 3 * r + 2] = c0 * l2 + c1 * l5 + c2 * l8
        w[x + 9 + r] = w[above + 9 + r] + c0 * t0 + c1 * t1 + c2 * t2


@kernels.helper
def columns(p: Array, o: int, w: Array, x: int, s: int) -> int:
    """Fill the motion subspace at w[s:] of the node at p[o:] with its pose at w[x:]; return its number of columns."""
    kind = int(p[o + layout.TYPE].real)
    if kind == layout.SLIDE:
        along = turned(w, x, p[o + layout.AXIS], p[o + layout.AXIS + 1], p[o + layout.AXIS + 2])
        none = 0.0 * w[x]
        put(w, s, (none, none, none), along)
        return 1
    d0, d1, d2 = turned(w, x, p[o + layout.ANCHOR], p[o + layout.ANCHOR + 1], p[o + layout.ANCHOR + 2])
    d0, d1, d2 = d0 + w[x + 9], d1 + w[x + 10], d2 + w[x + 11]
    if kind == layout.HINGE:
        axis = turned(w, x, p[o + layout.AXIS], p[o + layout.AXIS + 1], p[o + layout.AXIS + 2])
        put(w, s, axis, cross(d0, d1, d2, axis[0], axis[1], axis[2]))
        return 1
    first = 0
    if kind == layout.FREE:
        first, zero = 3, 0.0 * w[x]
        for k in range(3):
            put(w, s + layout.DOF_SCRATCH * k, (zero, zero, zero), (zero, zero, zero))
            w[s + layout.DOF_SCRATCH * k + 3 + k] = 1.0
    for k in range(3):
        axis = (w[x + k], w[x + 3 + k], w[x + 6 + k])
        put(w, s + layout.DOF_SCRATCH * (first + k), axis, cross(d0, d1, d2, axis[0], axis[1], axis[2]))
    return first + 3


@kernels.helper
def outwards(q: Array, v: Array, p: Array, w: Array) -> None:
    """Fill pose, velocity and acceleration at v' = 0 of every node; weight is an acceleration of the world."""
    nodes, at_node = int(p[layout.NODES].real), int(p[layout.AT_NODE].real)
    for i in range(nodes):
        o, x = at_node + layout.NODE * i, layout.NODE_SCRATCH * i
        parent, first = int(p[o + layout.PARENT].real), int(p[o + layout.V].real)
        above = layout.NODE_SCRATCH * parent
        pose(q, p, o, w, x, above)
        if parent < 0:
            for k in range(3):
                w[x + layout.ORIGIN_AT + k] = w[x + 9 + k]
                w[x + 9 + k] = 0.0 * w[x]
        s = layout.NODE_SCRATCH * nodes + layout.DOF_SCRATCH * first
        count = columns(p, o, w, x, s)
        r = v[first]
        m0, m1, m2, m3, m4, m5 = w[s] * r, w[s + 1] * r, w[s + 2] * r, w[s + 3] * r, w[s + 4] * r, w[s + 5] * r
        for k in range(1, count):
            b, r = s + layout.DOF_SCRATCH * k, v[first + k]
            m0, m1, m2 = m0 + w[b] * r, m1 + w[b + 1] * r, m2 + w[b + 2] * r
            m3, m4, m5 = m3 + w[b + 3] * r, m4 + w[b + 4] * r, m5 + w[b + 5] * r
        if parent < 0:
            put(w, x + layout.V_AT, (m0, m1, m2), (m3, m4, m5))
            b0, b1, b2 = 0.0 * m0, 0.0 * m0, 0.0 * m0
            if count == 6:  # its linear columns are fixed in the world, only the angular ones turn
                b0, b1, b2 = cross(m3, m4, m5, m0, m1, m2)
            zero, g = 0.0 * m0, layout.GRAVITY
            put(w, x + layout.A_AT, (zero, zero, zero), (b0 - p[g], b1 - p[g + 1], b2 - p[g + 2]))
            continue
        u, a = above + layout.V_AT, above + layout.A_AT
        w0, w1, w2, l0, l1, l2 = w[u], w[u + 1], w[u + 2], w[u + 3], w[u + 4], w[u + 5]
        put(w, x + layout.V_AT, (w0 + m0, w1 + m1, w2 + m2), (l0 + m3, l1 + m4, l2 + m5))
        t0, t1, t2 = cross(w0, w1, w2, m0, m1, m2)
        b0, b1, b2 = cross(w0, w1, w2, m3, m4, m5)
        c0, c1, c2 = cross(l0, l1, l2, m0, m1, m2)
        put(
            w,
            x + layout.A_AT,
            (w[a] + t0, w[a + 1] + t1, w[a + 2] + t2),
            (w[a + 3] + b0 + c0, w[a + 4] + b1 + c1, w[a + 5] + b2 + c2),
        )


@kernels.helper
def posed(q: Array, v: Array, p: Array) -> Array:
    """Return the scratch of the outward sweep, filled."""
    w = np.empty(layout.NODE_SCRATCH * int(p[layout.NODES].real) + layout.DOF_SCRATCH * len(v), dtype=q.dtype)
    outwards(q, v, p, w)
    return w


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
def lift(p: Array, o: int, w: Array, x: int) -> None:
    """Take the weight that the node at p[o:] is spared, -c m g at its parts' centres, from its force."""
    k, g = o + layout.LIFT, layout.GRAVITY
    c0, c1, c2 = turned(w, x, p[k + 1], p[k + 2], p[k + 3])
    for r in range(3):
        w[x + layout.F_AT + 3 + r] += p[k] * p[g + r]
    d0, d1, d2 = w[x + 9], w[x + 10], w[x + 11]
    n0, n1, n2 = cross(c0 + p[k] * d0, c1 + p[k] * d1, c2 + p[k] * d2, p[g], p[g + 1], p[g + 2])
    w[x + layout.F_AT] += n0
    w[x + layout.F_AT + 1] += n1
    w[x + layout.F_AT + 2] += n2


@kernels.helper
def inertia(p: Array, o: int, w: Array, x: int) -> None:
    """Fill inertia and force of the node at p[o:]: mass, first moment, second moment (xx yy zz xy xz yz)."""
    i, m = x + layout.I_AT, p[o + layout.MASS]
    if m == 0.0:
        for k in range(10):
            w[i + k] = 0.0
        for k in range(6):
            w[x + layout.F_AT + k] = 0.0
        return
    c0, c1, c2 = turned(w, x, p[o + layout.COM], p[o + layout.COM + 1], p[o + layout.COM + 2])
    c0, c1, c2 = c0 + w[x + 9], c1 + w[x + 10], c2 + w[x + 11]
    j = o + layout.INERTIA
    xx, yy, zz, xy, xz, yz = p[j], p[j + 1], p[j + 2], p[j + 3], p[j + 4], p[j + 5]
    # R J first, row by row, then R J R^T: its six entries alone.
    a0, a1, a2 = turned(w, x, xx, xy, xz)
    b0, b1, b2 = turned(w, x, xy, yy, yz)
    d0, d1, d2 = turned(w, x, xz, yz, zz)
    h0, h1, h2 = m * c0, m * c1, m * c2
    J0 = a0 * w[x] + b0 * w[x + 1] + d0 * w[x + 2] + h1 * c1 + h2 * c2
    J1 = a1 * w[x + 3] + b1 * w[x + 4] + d1 * w[x + 5] + h0 * c0 + h2 * c2
    J2 = a2 * w[x + 6] + b2 * w[x + 7] + d2 * w[x + 8] + h0 * c0 + h1 * c1
    J3 = a0 * w[x + 3] + b0 * w[x + 4] + d0 * w[x + 5] - h0 * c1
    J4 = a0 * w[x + 6] + b0 * w[x + 7] + d0 * w[x + 8] - h0 * c2
    J5 = a1 * w[x + 6] + b1 * w[x + 7] + d1 * w[x + 8] - h1 * c2
    w[i], w[i + 1], w[i + 2], w[i + 3] = m, h0, h1, h2
    w[i + 4], w[i + 5], w[i + 6], w[i + 7], w[i + 8], w[i + 9] = J0, J1, J2, J3, J4, J5
    z, y = x + layout.A_AT, x + layout.V_AT
    n, f = times(w, i, w[z], w[z + 1], w[z + 2], w[z + 3], w[z + 4], w[z + 5])
    L, P = times(w, i, w[y], w[y + 1], w[y + 2], w[y + 3], w[y + 4], w[y + 5])
    e0, e1, e2 = cross(w[y], w[y + 1], w[y + 2], L[0], L[1], L[2])
    k0, k1, k2 = cross(w[y + 3], w[y + 4], w[y + 5], P[0], P[1], P[2])
    g0, g1, g2 = cross(w[y], w[y + 1], w[y + 2], P[0], P[1], P[2])
    put(w, x + layout.F_AT, (n[0] + e0 + k0, n[1] + e1 + k1, n[2] + e2 + k2), (f[0] + g0, f[1] + g1, f[2] + g2))
    if p[o + layout.LIFT] != 0.0:
        lift(p, o, w, x)


@kernels.helper
def inwards(p: Array, w: Array, M: Array, f: Array) -> None:
    """Fill M (n, n) and take the bias C + G from f (n,)."""
    nodes, at_node, at_dof = int(p[layout.NODES].real), int(p[layout.AT_NODE].real), int(p[layout.AT_DOF].real)
    spaces = layout.NODE_SCRATCH * nodes
    for i in range(nodes):
        o = at_node + layout.NODE * i
        inertia(p, o, w, layout.NODE_SCRATCH * i)
    M[:, :] = 0.0
    for i in range(nodes - 1, -1, -1):
        o, x = at_node + layout.NODE * i, layout.NODE_SCRATCH * i
        parent, first = int(p[o + layout.PARENT].real), int(p[o + layout.V].real)
        last = (
            first + 1
            if p[o + layout.TYPE].real >= layout.SLIDE
            else (first + 6 if p[o + layout.TYPE].real == layout.FREE else first + 3)
        )
        y = x + layout.F_AT
        for j in range(last - 1, first - 1, -1):
            s = spaces + layout.DOF_SCRATCH * j
            a, b, c, d, e, g = w[s], w[s + 1], w[s + 2], w[s + 3], w[s + 4], w[s + 5]
            f[j] -= a * w[y] + b * w[y + 1] + c * w[y + 2] + d * w[y + 3] + e * w[y + 4] + g * w[y + 5]
            N, F = times(w, x + layout.I_AT, a, b, c, d, e, g)
            M[j, j] = (
                a * N[0]
                + b * N[1]
                + c * N[2]
                + d * F[0]
                + e * F[1]
                + g * F[2]
                + p[at_dof + layout.DOF * j + layout.ARMATURE]
            )
            k = int(p[at_dof + layout.DOF * j].real)
            while k >= 0:
                s = spaces + layout.DOF_SCRATCH * k
                value = w[s] * N[0] + w[s + 1] * N[1] + w[s + 2] * N[2]
                value += w[s + 3] * F[0] + w[s + 4] * F[1] + w[s + 5] * F[2]
                M[j, k] = value
                M[k, j] = value
                k = int(p[at_dof + layout.DOF * k].real)
        if parent >= 0:
            above = layout.NODE_SCRATCH * parent
            for k in range(6):
                w[above + layout.F_AT + k] += w[y + k]
            for k in range(10):
                w[above + layout.I_AT + k] += w[x + layout.I_AT + k]
