"""Accelerations and multipliers of the delta robot by blocks: no dense 9 x 9 or 15 x 15 system.

The third rate of each arm is scaled, s2 w: the mass block becomes [[A, Bc P, Bc Q/s2], [., Cc,
0], [., 0, Cc]] and the Jacobian [l1 n, l2 e2, l2 e3]. Since e2, e3, d are orthonormal, its Schur
complement S and W = dpsi M^-1 dpsi^T are

    S = A - Bc^2/Cc (P^2 + (Q/s2)^2)     k = (l1 - l2 Bc/Cc) n + l2 Bc/Cc (n . d) d
    W = l2^2/Cc (I - d d^T) + k k^T/S

so that H M^-1 H^T = [[W1 + W2, W1], [W1, W1 + W3]] costs a few products.
"""

from __future__ import annotations

from typing import Any

from crossbody.reference import kernels
from crossbody.reference.delta.kernels.arm import (
    curvature,
    geometry,
    inertia,
    psi,
    pull_back,
    rotate,
    rotate_back,
    tip,
    turn,
)
from crossbody.reference.delta.kernels.linear import diagonal, factor6, ill_posed, outer, plus, scaled, solve6
from crossbody.reference.kinds import Floats, Index


@kernels.helper
def directions(T: Any) -> Any:
    """The unit vectors n and d."""
    c1, s1, c2, s2, c3, s3 = T
    return (0.0, -s1, c1), (s2 * s3, c2, s2 * c3)


@kernels.helper
def coupling(T: Any, A: Any, B: Any, C: Any) -> Any:
    """Bc P, Bc Q/s2 and the inverse of the Schur complement S."""
    c1, s1, c2, s2, c3, s3 = T
    P, Q = B * (s1 * s2 + c1 * c2 * c3), -B * c1 * s3
    return P, Q, 1.0 / (A - (P * P + Q * Q) / C)


@kernels.helper
def respond(K: Any, C: Any, f: Any) -> Any:
    """M^-1 f of one arm in scaled rates (a, b, s2 w)."""
    P, Q, inverse = K
    a = (f[0] - (P * f[1] + Q * f[2]) / C) * inverse
    return a, (f[1] - P * a) / C, (f[2] - Q * a) / C


@kernels.helper
def mobility(T: Any, cs: Any, K: Any, l1: Any, l2: Any, B: Any, C: Any) -> Any:
    """R W R^T of one arm."""
    n, d = directions(T)
    along, share = n[1] * d[1] + n[2] * d[2], l2 * B / C
    k = (share * along * d[0], (l1 - share) * n[1] + share * along * d[1], (l1 - share) * n[2] + share * along * d[2])
    k, d = rotate(cs, k), rotate(cs, d)
    c = l2 * l2 / C
    return plus(plus(diagonal(c, c, c), outer(d, d, 1.0), -c), outer(k, k, 1.0), K[2])


@kernels.helper
def _tip_motion(T: Any, v: Floats, i: int, cs: Any, p: Floats, x: Any) -> Any:
    """Position, rate and acceleration of tip i in the base frame, the latter for the scaled accelerations x."""
    r, l1, l2, _ = geometry(p)
    a, b, w = v[3 * i], v[3 * i + 1], v[3 * i + 2]
    y, c = tip(T, l1, l2, x[0], x[1], x[2]), curvature(T, l1, l2, a, b, w)
    acceleration = (y[0] + c[0], y[1] + c[1], y[2] + c[2])
    return rotate(cs, psi(T, r, l1, l2)), rotate(cs, tip(T, l1, l2, a, b, T[3] * w)), rotate(cs, acceleration)


@kernels.helper
def _difference(a: Any, b: Any) -> Any:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernels.helper
def _missing(law: Floats, i: int, h: Any, hd: Any, hdd: Any) -> Any:
    """-(h'' without lam + a1 h' + a0 h + a2 h^3) of one row."""
    return -(hdd + law[i, 1] * hd + (law[i, 0] + law[i, 2] * h * h) * h)


@kernels.helper
def _right_side(one: Any, other: Any, law: Floats, row: int) -> Any:
    """What lam must bring in the three rows from `row` on, and their rates."""
    h, hd, hdd = _difference(one[0], other[0]), _difference(one[1], other[1]), _difference(one[2], other[2])
    return (
        _missing(law, row, h[0], hd[0], hdd[0]),
        _missing(law, row + 1, h[1], hd[1], hdd[1]),
        _missing(law, row + 2, h[2], hd[2], hdd[2]),
    ), hd


@kernels.helper
def _kept(idx: Index, na: int, row: int) -> Any:
    """1 for each of three rows that is active, else 0."""
    a, b, c = 0.0, 0.0, 0.0
    for j in range(na):
        a, b, c = a + (idx[j] == row), b + (idx[j] == row + 1), c + (idx[j] == row + 2)
    return a, b, c


@kernels.helper
def _masked(M: Any, a: Any, b: Any) -> Any:
    """Diag(a) M diag(b)."""
    return (
        (a[0] * M[0][0] * b[0], a[0] * M[0][1] * b[1], a[0] * M[0][2] * b[2]),
        (a[1] * M[1][0] * b[0], a[1] * M[1][1] * b[1], a[1] * M[1][2] * b[2]),
        (a[2] * M[2][0] * b[0], a[2] * M[2][1] * b[1], a[2] * M[2][2] * b[2]),
    )


@kernels.helper
def _without(A: Any, X: Any, B: Any, a: Any, b: Any) -> Any:
    """The matrix with an identity in place of the inactive rows and columns, whose lam is then 0."""
    I_a, I_b = diagonal(1 - a[0], 1 - a[1], 1 - a[2]), diagonal(1 - b[0], 1 - b[1], 1 - b[2])
    return plus(_masked(A, a, a), I_a, 1.0), _masked(X, a, b), plus(_masked(B, b, b), I_b, 1.0)


@kernels.helper
def _push(T: Any, cs: Any, K: Any, p: Floats, C: Any, f: Any, g: Any, i: int, vd: Floats) -> None:
    """Accelerations of arm i under its forces f and a force g on its tip in the base frame."""
    _, l1, l2, _ = geometry(p)
    x = pull_back(T, l1, l2, rotate_back(cs, g))
    vd[3 * i], vd[3 * i + 1], ws = respond(K, C, (f[0] + x[0], f[1] + x[1], f[2] + x[2]))
    vd[3 * i + 2] = ws / T[3]


@kernels.helper
def accelerate(
    T: Any, f: Any, v: Floats, p: Floats, law: Floats, idx: Index, na: int, vd: Floats, lam: Floats, hd: Floats
) -> int:
    """Fill vd (9,), lam (na,) and hd (na,).

    Args:
        T: cosines and sines of the three arms.
        f: forces of the three arms, the third component divided by s2.
        v: velocities (9,).
        p: parameters.
        law: a0, a1, a2 of every row (6, 3).
        idx: the active rows.
        na: how many they are.
        vd: receives the accelerations.
        lam: receives the multipliers.
        hd: receives the rates of the active rows.

    Returns:
        0, or 1 where an arm points along x (s2 = 0, the chart ends) or the multipliers are ill posed.
    """
    if T[0][3] * T[1][3] * T[2][3] == 0.0:
        return 1
    _, l1, l2, sign = geometry(p)
    A, B, C = inertia(p)
    R0, R1, R2 = turn(0, sign), turn(1, sign), turn(2, sign)
    K0, K1, K2 = coupling(T[0], A, B, C), coupling(T[1], A, B, C), coupling(T[2], A, B, C)
    W = mobility(T[0], R0, K0, l1, l2, B, C)
    S = plus(W, mobility(T[1], R1, K1, l1, l2, B, C), 1.0)
    Q = plus(W, mobility(T[2], R2, K2, l1, l2, B, C), 1.0)
    tip0 = _tip_motion(T[0], v, 0, R0, p, respond(K0, C, f[0]))
    a, ad = _right_side(tip0, _tip_motion(T[1], v, 1, R1, p, respond(K1, C, f[1])), law, 0)
    b, bd = _right_side(tip0, _tip_motion(T[2], v, 2, R2, p, respond(K2, C, f[2])), law, 3)
    if na < 6:
        keep_a, keep_b = _kept(idx, na, 0), _kept(idx, na, 3)
        S, W, Q = _without(S, W, Q, keep_a, keep_b)
        a, b = scaled(keep_a, a), scaled(keep_b, b)
    F6 = factor6(S, W, Q)
    if ill_posed(F6, S, W, Q):
        return 1
    a, b = solve6(F6, a, b)
    _push(T[0], R0, K0, p, C, f[0], (a[0] + b[0], a[1] + b[1], a[2] + b[2]), 0, vd)
    _push(T[1], R1, K1, p, C, f[1], (-a[0], -a[1], -a[2]), 1, vd)
    _push(T[2], R2, K2, p, C, f[2], (-b[0], -b[1], -b[2]), 2, vd)
    multipliers, rates = (a[0], a[1], a[2], b[0], b[1], b[2]), (ad[0], ad[1], ad[2], bd[0], bd[1], bd[2])
    for j in range(na):
        lam[j], hd[j] = multipliers[idx[j]], rates[idx[j]]
    return 0
