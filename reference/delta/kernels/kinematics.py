"""Kinematics of the closed robot in compiled code.

With R_i d_i the directions of the distal links in the base frame, stacked as the rows of D, a
motion z' of the flange and the rates y' of the motors obey D z' = diag(l1 n_i . d_i) y', since e2
and e3 are orthogonal to d. Therefore the 6 x 6 system h_x dx = -h of Newton's method shrinks to
one with D, and Jy = D^-1 diag(l1 n_i . d_i). D is singular exactly where h_x is.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from crossbody.reference import kernels
from crossbody.reference.cache import compiled
from crossbody.reference.delta.kernels.arm import geometry, inertia, psi, rotate, rotate_back, turn, weights
from crossbody.reference.delta.kernels.linear import cross, dot
from crossbody.reference.delta.kernels.solve import directions
from crossbody.reference.kinds import Floats

SINGULAR = 1e-9  # below this |det D| (a product of unit vectors) the direct kinematics is singular
NOT_CONVERGED, DIVIDED_BY_ZERO = -1, -2

_V = types.float64[::1]
_M = types.float64[:, ::1]


@kernels.helper
def pose(y: Floats, x: Floats, i: int) -> Any:
    """T of arm i from motor angles y (3,) and the six others x = (q12, q13, q22, ...)."""
    b, c = x[2 * i], x[2 * i + 1]
    return np.cos(y[i]), np.sin(y[i]), np.cos(b), np.sin(b), np.cos(c), np.sin(c)


@kernels.helper
def posture(y: Floats, x: Floats) -> Any:
    """T of the three arms."""
    return pose(y, x, 0), pose(y, x, 1), pose(y, x, 2)


@kernels.helper
def axes(T: Any) -> Any:
    """The unit vectors e2 and e3 along which the distal link can move its tip."""
    _, _, c2, s2, c3, s3 = T
    return (c2 * s3, -s2, c2 * c3), (c3, 0.0, -s3)


@kernels.helper
def distal(T: Any, cs: Any) -> Any:
    """R d and n . d of one arm."""
    n, d = directions(T)
    return rotate(cs, d), n[1] * d[1] + n[2] * d[2]


@kernels.helper
def frame(p: Floats, T: Any) -> Any:
    """Rows of D, the three n . d, columns of adj D, det D."""
    sign = p[12]
    a, u = distal(T[0], turn(0, sign))
    b, v = distal(T[1], turn(1, sign))
    c, w = distal(T[2], turn(2, sign))
    adjoint = cross(b, c), cross(c, a), cross(a, b)
    return (a, b, c), (u, v, w), adjoint, dot(a, adjoint[0])


@kernels.helper
def combine(columns: Any, b: Any, c: Any) -> Any:
    """C (b_0 column_0 + b_1 column_1 + b_2 column_2)."""
    x, y, z = columns
    return (
        c * (b[0] * x[0] + b[1] * y[0] + b[2] * z[0]),
        c * (b[0] * x[1] + b[1] * y[1] + b[2] * z[1]),
        c * (b[0] * x[2] + b[1] * y[2] + b[2] * z[2]),
    )


@kernels.helper
def _correct(T: Any, tip: Any, cs: Any, z: Any, l2: Any) -> Any:
    """Newton's change of (q_i2, q_i3) that brings the tip, to first order, to z."""
    e2, e3 = axes(T)
    local = rotate_back(cs, z)
    gap = local[0] - tip[0], local[1] - tip[1], local[2] - tip[2]
    return dot(e2, gap) / l2, dot(e3, gap) / (l2 * T[3])


@kernels.helper
def newton(p: Floats, y: Floats, x: Floats) -> Any:
    """One step of Newton's method on h(y, x) = 0, in place; its largest component, or -1 where it is singular."""
    r, l1, l2, sign = geometry(p)
    T = posture(y, x)
    D, _, adjoint, det = frame(p, T)
    if not (abs(det) > SINGULAR and T[0][3] * T[1][3] * T[2][3] != 0.0):
        return -1.0
    a, b, c = psi(T[0], r, l1, l2), psi(T[1], r, l1, l2), psi(T[2], r, l1, l2)
    R0, R1, R2 = turn(0, sign), turn(1, sign), turn(2, sign)
    along = dot(D[0], rotate(R0, a)), dot(D[1], rotate(R1, b)), dot(D[2], rotate(R2, c))
    z = combine(adjoint, along, 1.0 / det)
    s0, s1 = _correct(T[0], a, R0, z, l2)
    s2, s3 = _correct(T[1], b, R1, z, l2)
    s4, s5 = _correct(T[2], c, R2, z, l2)
    x[0], x[1], x[2], x[3], x[4], x[5] = x[0] + s0, x[1] + s1, x[2] + s2, x[3] + s3, x[4] + s4, x[5] + s5
    return max(abs(s0), abs(s1), abs(s2), abs(s3), abs(s4), abs(s5))


def forward(p: Floats, y: Floats, x: Floats, tolerance: float, limit: int) -> int:
    """Newton's method from the x given, in place.

    Args:
        p: parameters of the robot.
        y (3,): motor angles, rad.
        x (6,): the other angles; a guess, then the solution.
        tolerance: size of the last step, rad; the error left is of the order of its square.
        limit: steps allowed.

    Returns:
        Steps taken, or NOT_CONVERGED, or DIVIDED_BY_ZERO at a singular pose.
    """
    for k in range(limit):
        step = newton(p, y, x)
        if step < 0.0:
            return DIVIDED_BY_ZERO
        if step <= tolerance:
            return k + 1
    return NOT_CONVERGED


forward = compiled(forward, [types.int64(_V, _V, _V, types.float64, types.int64)])


@kernels.helper
def flange(p: Floats, T: Any) -> Any:
    """The mean of the three tips in the base frame, m."""
    r, l1, l2, sign = geometry(p)
    a, b, c = psi(T[0], r, l1, l2), psi(T[1], r, l1, l2), psi(T[2], r, l1, l2)
    b, c = rotate(turn(1, sign), b), rotate(turn(2, sign), c)
    return (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3, (a[2] + b[2] + c[2]) / 3


@kernels.helper
def control_jacobian(p: Floats, F: Any) -> Any:
    """The three columns of Jy = dz/dy."""
    l1, (_, nd, adjoint, det) = p[2], F
    a, b, c = l1 * nd[0] / det, l1 * nd[1] / det, l1 * nd[2] / det
    x, y, z = adjoint
    return (
        (a * x[0], a * x[1], a * x[2]),
        (b * y[0], b * y[1], b * y[2]),
        (c * z[0], c * z[1], c * z[2]),
    )


@kernels.helper
def follow(p: Floats, T: Any, J: Any, i: int) -> Any:
    """Rows i of X = dx/dy: d q_i2/dy and s2 d q_i3/dy."""
    _, l1, l2, sign = geometry(p)
    n, _ = directions(T)
    e2, e3 = axes(T)
    cs = turn(i, sign)
    a, b = rotate(cs, e2), rotate(cs, e3)
    own2, own3 = l1 * dot(e2, n), l1 * dot(e3, n)
    return (
        (
            (dot(a, J[0]) - own2 * (i == 0)) / l2,
            (dot(a, J[1]) - own2 * (i == 1)) / l2,
            (dot(a, J[2]) - own2 * (i == 2)) / l2,
        ),
        (
            (dot(b, J[0]) - own3 * (i == 0)) / l2,
            (dot(b, J[1]) - own3 * (i == 1)) / l2,
            (dot(b, J[2]) - own3 * (i == 2)) / l2,
        ),
    )


@kernels.helper
def holding(p: Floats, T: Any, X: Any) -> Any:
    """Motor torques that balance gravity: S^T dV/dq with S = [I; X], N m."""
    k1, k2 = weights(p)
    out0, out1, out2 = -k1 * T[0][0], -k1 * T[1][0], -k1 * T[2][0]
    for i in range(3):
        _, _, c2, _, c3, s3 = T[i]
        g2, g3 = -k2 * c2 * c3, k2 * s3
        a, b = X[i]
        out0, out1, out2 = out0 + a[0] * g2 + b[0] * g3, out1 + a[1] * g2 + b[1] * g3, out2 + a[2] * g2 + b[2] * g3
    return out0, out1, out2


@kernels.helper
def spread(p: Floats, T: Any, J: Any) -> Any:
    """Rows of X for the three arms, see `follow`."""
    return follow(p, T[0], J, 0), follow(p, T[1], J, 1), follow(p, T[2], J, 2)


@kernels.helper
def _coupled(T: Any, B: Any, i: int) -> Any:
    """M_i12 and M_i13/s2."""
    c1, s1, c2, s2, c3, s3 = T[i]
    return B * (s1 * s2 + c1 * c2 * c3), -B * c1 * s3


@kernels.helper
def fill_mass(p: Floats, T: Any, X: Any, exact: bool, My: Floats) -> None:
    """My = S^T M S, or its approximation M11 - M12 h_x^-1 h_y, kg m^2."""
    A, B, C = inertia(p)
    My[:] = 0.0
    for i in range(3):
        P, Q = _coupled(T, B, i)
        a, b = X[i]
        My[i, i] += A
        for j in range(3):
            My[i, j] += P * a[j] + Q * b[j]
        if exact:
            for k in range(3):
                My[k, i] += P * a[k] + Q * b[k]
                for j in range(3):
                    My[k, j] += C * (a[k] * a[j] + b[k] * b[j])


def task_mass(p: Floats, y: Floats, x: Floats, exact: bool, My: Floats) -> float:
    """Fill My (3, 3), kg m^2; returns det D, and fills nothing where it is singular."""
    T = posture(y, x)
    F = frame(p, T)
    det: float = F[3]
    if abs(det) > SINGULAR:
        fill_mass(p, T, spread(p, T, control_jacobian(p, F)), exact, My)
    return det


task_mass = compiled(task_mass, [types.float64(_V, _V, _V, types.boolean, _M)])


def jacobians(p: Floats, y: Floats, x: Floats, z: Floats, Jy: Floats, X: Floats, tau: Floats) -> float:
    """Fill z (3,), Jy (3, 3), X (6, 3) and the gravity torque tau (3,) of a closed pose.

    Returns:
        det D; only z is filled where it is singular.
    """
    T = posture(y, x)
    z[0], z[1], z[2] = flange(p, T)
    F = frame(p, T)
    det: float = F[3]
    if not abs(det) > SINGULAR:
        return det
    J = control_jacobian(p, F)
    rows = spread(p, T, J)
    tau[0], tau[1], tau[2] = holding(p, T, rows)
    for i in range(3):
        a, b = rows[i]
        for j in range(3):
            Jy[j, i] = J[i][j]
            X[2 * i, j], X[2 * i + 1, j] = a[j], b[j] / T[i][3]
    return det


jacobians = compiled(jacobians, [types.float64(_V, _V, _V, _V, _M, _M, _V)])


def update(p: Floats, y: Floats, x: Floats, z: Floats, Jy: Floats, X: Floats, tau: Floats) -> int:
    """One control update: forward kinematics from the last x, control Jacobian, gravity torque; as `forward`."""
    steps = forward(p, y, x, 1e-6, 20)
    if steps > 0 and not abs(jacobians(p, y, x, z, Jy, X, tau)) > SINGULAR:
        return DIVIDED_BY_ZERO
    return steps


update = compiled(update, [types.int64(_V, _V, _V, _V, _M, _M, _V)])
