"""The delta robot: three arms of three absolute angles, closed by six equations.

q = (q11, q12, q13, q21, ..., q33); z points down. Parameters p are those of `PARAMETERS`, then the servos'
reference (`SERVO_FROM`, `SERVO_TO`: three angles each), then the tables of a sampled controller if there is one.
Inputs u = (three motor torques N m, three components of a force on the flange N).
Rows h = (psi(q1) - R2 psi(q2); psi(q1) - R3 psi(q3)), with R2 = Rz(-sign 120 deg), R3 = Rz(+sign 120 deg).
"""

from __future__ import annotations

from typing import Any

from crossbody.reference import kernels
from crossbody.reference.delta.kernels import arm as _arm
from crossbody.reference.delta.kernels import servo as _servo
from crossbody.reference.delta.kernels.arm import (
    centrifugal,
    curvature,
    dpsi,
    geometry,
    gravity,
    inertia,
    mass,
    psi,
    pull_back,
    rotate,
    rotate_back,
    trig,
    turn,
    velocity,
    weights,
)
from crossbody.reference.delta.kernels.servo import ramp, servo
from crossbody.reference.delta.kernels.solve import accelerate
from crossbody.reference.kinds import Array, Floats, Index

PARAMETERS = _arm.NAMES + _servo.NAMES
SERVO_FROM, SERVO_TO, SIZE = _servo.FROM, _servo.TO, _servo.END
SCRATCH = 18  # length of w: the cosines and sines of the nine angles


_THIRD = 1 / 3


@kernels.helper
def _external(t: float, q: Array, v: Array, u: Array, p: Array) -> Any:
    """Torques of motors and servos on the three arms, and a third of the force on the flange."""
    moved = ramp(t, p)
    push = u[3] * _THIRD, u[4] * _THIRD, u[5] * _THIRD
    a, b, c = (servo(p, moved, 0, q[0], v[0]), servo(p, moved, 1, q[3], v[3]), servo(p, moved, 2, q[6], v[6]))
    return (u[0] + a, u[1] + b, u[2] + c), push


@kernels.helper
def _forces(i: int, v: Array, p: Array, T: Any, external: Any) -> Any:
    """B u + Jv^T (flange force) - c - d - g of arm i."""
    _, l1, l2, sign = geometry(p)
    _, B, C = inertia(p)
    k1, k2 = weights(p)
    motor, push = external
    a, b, w = v[3 * i], v[3 * i + 1], v[3 * i + 2]
    c, g = centrifugal(T, B, C, a, b, w), gravity(T, k1, k2)
    x = pull_back(T, l1, l2, rotate_back(turn(i, sign), push))
    first = motor[i] + x[0] - c[0] - g[0] - p[9] * a
    return first, x[1] - c[1] - g[1] - p[10] * b, x[2] * T[3] - c[2] - g[2] - p[11] * w


@kernels.helper
def _scaled(i: int, v: Array, p: Array, T: Any, external: Any) -> Any:
    """The same with the third component divided by s2."""
    f = _forces(i, v, p, T, external)
    return f[0], f[1], f[2] / T[3]


@kernels.dynamics
def dynamics(t: float, q: Array, v: Array, u: Array, p: Array, M: Array, f: Array, w: Array) -> None:
    """Three 3 x 3 mass blocks and the forces; w receives the cosines and sines."""
    A, B, C = inertia(p)
    external = _external(t, q, v, u, p)
    for i in range(3):
        T = trig(q, i)
        k = 3 * i
        for j in range(6):
            w[6 * i + j] = T[j]
        m12, m13 = mass(T, B)
        M[k, 0], M[k, 1], M[k, 2] = A, m12, m13
        M[k + 1, 0], M[k + 1, 1], M[k + 1, 2] = m12, C, 0.0
        M[k + 2, 0], M[k + 2, 1], M[k + 2, 2] = m13, 0.0, C * T[3] * T[3]
        f[k], f[k + 1], f[k + 2] = _forces(i, v, p, T, external)


@kernels.gaps
def gaps(t: float, q: Array, v: Array, p: Array, h: Array, hd: Array) -> None:
    """Distances between the arms' tips and their rates."""
    r, l1, l2, sign = geometry(p)
    T = trig(q, 0)
    x, xd = psi(T, r, l1, l2), velocity(T, l1, l2, v[0], v[1], v[2])
    for i in range(1, 3):
        T, cs = trig(q, i), turn(i, sign)
        y = rotate(cs, psi(T, r, l1, l2))
        yd = rotate(cs, velocity(T, l1, l2, v[3 * i], v[3 * i + 1], v[3 * i + 2]))
        for j in range(3):
            h[3 * i - 3 + j] = x[j] - y[j]
            hd[3 * i - 3 + j] = xd[j] - yd[j]


@kernels.helper
def _turned(cs: Any, J: Any, k: int) -> Any:
    """Row k of Rz J."""
    if k == 2:
        return J[2]
    own, other = (cs[0], -cs[1]) if k == 0 else (cs[1], cs[0])
    return own * J[0][0] + other * J[1][0], own * J[0][1] + other * J[1][1], own * J[0][2] + other * J[1][2]


@kernels.rows
def rows(t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array) -> None:
    """Row 3 (i - 1) + k: component k of psi(q1) - Ri psi(qi); reads the cosines and sines that dynamics left."""
    r, l1, l2, sign = geometry(p)
    T1 = (w[0], w[1], w[2], w[3], w[4], w[5])
    J1, x1, y1 = dpsi(T1, l1, l2), psi(T1, r, l1, l2), curvature(T1, l1, l2, v[0], v[1], v[2])
    H[:na] = 0.0
    for i in range(1, 3):
        o, n = 3 * i, 6 * i
        T, cs = (w[n], w[n + 1], w[n + 2], w[n + 3], w[n + 4], w[n + 5]), turn(i, sign)
        J, x = dpsi(T, l1, l2), rotate(cs, psi(T, r, l1, l2))
        y = rotate(cs, curvature(T, l1, l2, v[o], v[o + 1], v[o + 2]))
        for j in range(na):
            k = idx[j] - 3 * (i - 1)
            if 0 <= k < 3:
                H[j, 0], H[j, 1], H[j, 2] = J1[k]
                a, b, c = _turned(cs, J, k)
                H[j, o], H[j, o + 1], H[j, o + 2] = -a, -b, -c
                h[j], Hdv[j] = x1[k] - x[k], y1[k] - y[k]


@kernels.energy
def energy(q: Array, v: Array, p: Array, e: Array) -> None:
    """T = v^T M v/2 and V = -g ((m1/2 + m2 + m3/3) l1 s1 + (m2/2 + m3/3) l2 s2 c3), summed over the arms."""
    A, B, C = inertia(p)
    k1, k2 = weights(p)
    e[0], e[1] = 0.0, 0.0
    for i in range(3):
        T = trig(q, i)
        m12, m13 = mass(T, B)
        a, b, w = v[3 * i], v[3 * i + 1], v[3 * i + 2]
        e[0] += 0.5 * (A * a * a + C * (b * b + T[3] * T[3] * w * w)) + a * (m12 * b + m13 * w)
        e[1] -= k1 * T[1] + k2 * T[3] * T[4]


@kernels.power
def power(t: float, q: Array, v: Array, u: Array, p: Array, e: Array) -> None:
    """Of motors, servos and flange force; and of the viscous friction."""
    _, l1, l2, sign = geometry(p)
    motor, push = _external(t, q, v, u, p)
    e[0], e[1] = 0.0, 0.0
    for i in range(3):
        a, b, w = v[3 * i], v[3 * i + 1], v[3 * i + 2]
        zd = rotate(turn(i, sign), velocity(trig(q, i), l1, l2, a, b, w))
        e[0] += motor[i] * a + push[0] * zd[0] + push[1] * zd[1] + push[2] * zd[2]
        e[1] += p[9] * a * a + p[10] * b * b + p[11] * w * w


@kernels.solve
def solve(
    t: float,
    q: Floats,
    v: Floats,
    u: Floats,
    p: Floats,
    w: Floats,
    law: Floats,
    idx: Index,
    na: int,
    vd: Floats,
    lam: Floats,
    hd: Floats,
) -> int:
    """Accelerations and multipliers by blocks, see `crossbody.reference.delta.kernels.solve`."""
    T = trig(q, 0), trig(q, 1), trig(q, 2)
    e = _external(t, q, v, u, p)
    f = _scaled(0, v, p, T[0], e), _scaled(1, v, p, T[1], e), _scaled(2, v, p, T[2], e)
    code: int = accelerate(T, f, v, p, law, idx, na, vd, lam, hd)
    return code


KERNELS: dict[str, Any] = {
    "dynamics": dynamics,
    "gaps": gaps,
    "rows": rows,
    "energy": energy,
    "power": power,
    "solve": solve,
}
