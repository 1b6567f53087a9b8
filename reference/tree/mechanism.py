"""The kernels of a scene that are given scratch: mass matrix and forces, active rows; and rates of positions."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.kinds import Array, Index
from crossbody.reference.pairs import layout as pairs
from crossbody.reference.pairs.jets import value
from crossbody.reference.tree import balls, forces, layout, loops, strings, sweeps, traced
from crossbody.reference.tree import pair_slip as slip
from crossbody.reference.tree.pair_rows import gradient, touch
from crossbody.reference.tree.points import point, pull

REAL = 8  # bytes of a number that is not complex
PAIRED = True  # whether shapes may meet; another value is seen by `quantities.declared` alone
PULL = 0.1  # 1/s, of a quaternion to length 1: a tenth of a rate that would cost steps


@kernels.helper
def pushed(u: Array, p: Array, w: Array, i: int) -> tuple[int, Any, Any]:
    """Return which node push i acts on, the motion of the point there, and the force."""
    o, k = int(p[layout.AT_PUSH].real) + layout.PUSH * i, int(p[layout.ACTUATORS].real) + 3 * i
    node = int(p[o + layout.PUSHED].real)
    return node, point(p, w, node, p[o + 1], p[o + 2], p[o + 3]), (u[k], u[k + 1], u[k + 2])


@kernels.dynamics
def dynamics(t: float, q: Array, v: Array, u: Array, p: Array, M: Array, f: Array, w: Array) -> None:
    """M by composite inertias; f = springs, dampers, actuators less the bias."""
    forces.passive(q, v, p, f)
    code = p[layout.TRACED].real if q.itemsize == REAL else 0.0
    if code == 0.0 or p[layout.SPANNED].real > 0.0:
        sweeps.outwards(q, v, p, w)
    if len(u) > 0 and p[layout.BOUNDED].real > 0.0:
        sums = w[len(w) - len(f) :]
        forces.driven(t, q, v, u, p, w, sums)
        for j in range(len(f)):
            f[j] += sums[j]
    elif len(u) > 0 and p[layout.EXERTING].real > 0.0:
        forces.actuated(t, q, v, u, p, w, f)
    if p[layout.SPANNED].real > 0.0:
        forces.stretched(p, w, f)
    if code != 0.0:
        traced.call(np.int64(code), q.ctypes.data, v.ctypes.data, M.ctypes.data, f.ctypes.data, w.ctypes.data)
    else:
        sweeps.inwards(p, w, M, f)
    for i in range(int(p[layout.PUSHES].real)):
        node, x, force = pushed(u, p, w, i)
        pull(p, w, node, 1.0, force, value(x), f)


@kernels.helper
def _polynomial(p: Array, c: int, y: Any) -> tuple[Any, Any, Any]:
    """Return the polynomial with the coefficients p[c:] at y, and its first and second derivative."""
    total = p[c] + y * (p[c + 1] + y * (p[c + 2] + y * (p[c + 3] + y * p[c + 4])))
    slope = p[c + 1] + y * (2.0 * p[c + 2] + y * (3.0 * p[c + 3] + y * 4.0 * p[c + 4]))
    return total, slope, 2.0 * p[c + 2] + y * (6.0 * p[c + 3] + y * 12.0 * p[c + 4])


@kernels.helper
def _followed(q: Array, v: Array, p: Array, kind: int, o: int) -> tuple[Any, Any]:
    """Return how far the coordinate or tendon at p[o:] is from where it rests, and its rate; 0 if there is none."""
    if p[o].real < 0.0:
        return 0.0 * q[0], 0.0 * v[0]
    if kind == layout.TENDON_LOOP:
        at = forces.tendon(p, int(p[o].real))
        return forces.length(q, p, at) - p[o + 2], forces.rate(v, p, at)
    return q[int(p[o].real)] - p[o + 2], v[int(p[o + 1].real)]


@kernels.helper
def _along(p: Array, kind: int, o: int, slope: Any, H: Array) -> None:
    """Add a derivative along the coordinate or tendon at p[o:], if there is one."""
    if p[o].real < 0.0:
        return
    if kind == layout.TENDON_LOOP:
        forces.pull(p, forces.tendon(p, int(p[o].real)), slope, H)
    else:
        H[int(p[o + 1].real)] += slope


@kernels.helper
def joint_row(q: Array, v: Array, p: Array, i: int) -> Any:
    """Return gap, rate and H' v of row i."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    kind = int(p[o].real)
    if kind == layout.LIMIT:
        return p[o + 1] * (q[int(p[o + 2].real)] - p[o + 4]), p[o + 1] * v[int(p[o + 3].real)], 0.0 * v[0]
    if kind == layout.BALL_LIMIT:
        return balls.bound(q, v, p, o)
    if kind == layout.DRY_JOINT:
        return 0.0 * q[0], v[int(p[o + 3].real)], 0.0 * v[0]
    if kind == layout.DRY_TENDON:
        return 0.0 * q[0], forces.rate(v, p, forces.tendon(p, int(p[o + 2].real))), 0.0 * v[0]
    if kind == layout.TENDON_LIMIT:
        at = forces.tendon(p, int(p[o + 2].real))
        return p[o + 1] * (forces.length(q, p, at) - p[o + 3]), p[o + 1] * forces.rate(v, p, at), 0.0 * v[0]
    x, xd = _followed(q, v, p, kind, o + layout.LED)
    y, yd = _followed(q, v, p, kind, o + layout.LEADS)
    there, slope, curve = _polynomial(p, o + layout.POLYNOMIAL, y)
    return x - there, xd - slope * yd, -curve * yd * yd


@kernels.helper
def _gradient(q: Array, v: Array, p: Array, i: int, H: Array) -> None:
    """Fill H (n,) of row i where it is not zero."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    kind = int(p[o].real)
    if kind in (layout.LIMIT, layout.DRY_JOINT):
        H[int(p[o + 3].real)] = p[o + 1]
    elif kind == layout.BALL_LIMIT:
        balls.bound_columns(q, p, o, H)
    elif kind in (layout.TENDON_LIMIT, layout.DRY_TENDON):
        forces.pull(p, forces.tendon(p, int(p[o + 2].real)), p[o + 1] + 0.0 * q[0], H)
    else:
        y = _followed(q, v, p, kind, o + layout.LEADS)[0]
        _along(p, kind, o + layout.LED, 1.0 + 0.0 * q[0], H)
        _along(p, kind, o + layout.LEADS, -_polynomial(p, o + layout.POLYNOMIAL, y)[1], H)


@kernels.helper
def contact(p: Array, w: Array, i: int) -> tuple[int, Any]:
    """Return where the pair of row i stands in p, and gap, normal and place of its contact."""
    o = int(p[layout.AT_ROW].real) + layout.ROW * i
    at = int(p[layout.AT_PAIR].real) + pairs.PAIR * int(p[o + pairs.WHICH].real)
    return at, touch(p, w, at, o)


@kernels.helper
def slip_of(p: Array, w: Array, i: int) -> Any:
    """Return of the tangential row i where its pair stands in p, where its shapes meet, and both directions there.

    Its own comes first; the other one is that of its partner, the next row of a contact in space.
    """
    at, row = slip.place_of(p, i)
    x, one, other = slip.meeting(p, w, at, row)
    if p[row + pairs.ACROSS].real == 0.0:
        return at, x, one, other
    return at, x, other, one


@kernels.helper
def has_partner(p: Array, i: int, k: int) -> bool:
    """Return whether row k is the second tangential row of the contact of which row i is the first one."""
    o, step = int(p[layout.AT_ROW].real), layout.ROW
    one, other = o + step * i, o + step * k
    first = p[one + pairs.ACROSS].real == 0.0 and int(p[other].real) == layout.TANGENT
    across = p[other + pairs.ACROSS].real != 0.0 and p[one + pairs.WHICH].real == p[other + pairs.WHICH].real
    return bool(first and across and p[one + pairs.PLACE].real == p[other + pairs.PLACE].real)


def rows(t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array) -> None:
    """The active ones."""
    H[:na] = 0.0
    paired = -1
    for j in range(na):
        if j == paired:
            continue
        kind = int(p[int(p[layout.AT_ROW].real) + layout.ROW * idx[j]].real)
        if kind == layout.CONNECT:
            h[j], _, Hdv[j] = loops.connect(p, idx[j], w)
            loops.connect_columns(p, idx[j], w, H[j])
        elif kind == layout.TURN:
            h[j], _, Hdv[j] = loops.turn(p, idx[j], w)
            loops.turn_columns(p, idx[j], w, H[j])
        elif kind in (layout.STRING, layout.DRY_STRING):
            h[j], _, Hdv[j] = strings.string(p, idx[j], w)
            if kind == layout.DRY_STRING:
                h[j] = 0.0 * w[0]
            strings.string_columns(p, idx[j], w, H[j])
        elif PAIRED and kind == layout.CONTACT:
            at, (gap, n, place) = contact(p, w, idx[j])
            h[j], Hdv[j] = gap[0], gap[2]
            gradient(p, w, at, n, place, H[j])
        elif PAIRED and kind == layout.TANGENT:
            at, x, way, other = slip_of(p, w, idx[j])
            V, A = slip.apart(p, w, at, x)
            h[j], Hdv[j] = 0.0 * w[0], slip.velocity(V, A, way)[1]
            slip.columns(p, w, at, x, way, H[j])
            if j + 1 < na and has_partner(p, idx[j], idx[j + 1]):
                paired = j + 1
                h[paired], Hdv[paired] = 0.0 * w[0], slip.velocity(V, A, other)[1]
                slip.columns(p, w, at, x, other, H[paired])
        else:
            h[j], _, Hdv[j] = joint_row(q, v, p, idx[j])
            _gradient(q, v, p, idx[j], H[j])


@kernels.helper
def _turn(q: Array, at: int, v: Array, j: int, qd: Array) -> None:
    """Fill q' = q w / 2 + PULL (1 - |q|^2) q of the quaternion at q[at:] with the angular velocity w at v[j:].

    The pull keeps the length at 1 and turns nothing: R is that of q / |q|.
    """
    w, x, y, z = q[at], q[at + 1], q[at + 2], q[at + 3]
    a, b, c = 0.5 * v[j], 0.5 * v[j + 1], 0.5 * v[j + 2]
    g = PULL * (1.0 - w * w - x * x - y * y - z * z)
    qd[at], qd[at + 1] = g * w - x * a - y * b - z * c, g * x + w * a + y * c - z * b
    qd[at + 2], qd[at + 3] = g * y + w * b + z * a - x * c, g * z + w * c + x * b - y * a


@kernels.velocity
def velocity(t: float, q: Array, v: Array, p: Array, qd: Array) -> None:
    """The rates of all positions: v itself of hinges, slides and free joints' origins."""
    for i in range(int(p[layout.NODES].real)):
        o = int(p[layout.AT_NODE].real) + layout.NODE * i
        kind, at, j = p[o + layout.TYPE].real, int(p[o + layout.Q].real), int(p[o + layout.V].real)
        if kind >= layout.SLIDE:
            qd[at] = v[j]
        elif kind == layout.FREE:
            qd[at], qd[at + 1], qd[at + 2] = v[j], v[j + 1], v[j + 2]
            _turn(q, at + 3, v, j + 3, qd)
        else:
            _turn(q, at, v, j, qd)
