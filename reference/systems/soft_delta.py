"""A delta robot with two soft fingers and a free block on a table, with tactile feedback.

q = (nine angles, pL, pR, S, block b1 b2 b3, I1, I2, I3): pads move along x on the flange, the
block has three translations, z points down. As in `soft_contact`, but for the sensors, of which
the loop needs the difference alone:

    S' = s = s_R - s_L, so that y_R - y_L = s + ks mp (pL' + pR')     s' = -ks (fL + fR + y_R - y_L)
    I = INT (r - z) of the flange z, I' = e its error, I'' = r' - z', with r1' = k (y_R - y_L), r2 = 0, and r3 a path
    that comes down, waits and rises

Motor torques tau = My Jy^-1 (ki I + kp I' + kd I'' + r'') + tau_g linearise the flange's motion with
the exact My and without terms in the velocities; r1'' is left out. Forces of the pads act on the
flange through Jv^T. Rows: the six closures, left pad, right pad, table. Inputs u = a force on the
flange, N. Parameters p: those of the robot and its (idle) servos, of `_soft_fingers`, and `PATH`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.delta import scene
from crossbody.reference.delta.kernels import robot as _delta
from crossbody.reference.delta.kernels import servo as _servo
from crossbody.reference.delta.kernels.arm import geometry, rotate, trig, turn, velocity
from crossbody.reference.delta.kernels.control import reflected
from crossbody.reference.delta.kernels.kinematics import control_jacobian, flange, frame, holding, spread
from crossbody.reference.delta.kernels.linear import dot
from crossbody.reference.kinds import Array, Floats, Index
from crossbody.reference.systems import _soft_fingers as _fingers
from crossbody.reference.systems import delta as robot
from crossbody.reference.systems._soft_fingers import (
    BLOCK_MASS,
    BT,
    KS,
    PAD_MASS,
    K,
    half_width,
    pads,
    pid,
    smooth,
)

if TYPE_CHECKING:
    from crossbody.cases import Law
    from crossbody.reference import System

PATH = ("high", "low", "descent", "rise", "rise_time", "table")
"""Depth of the flange before and during the grasp, m; times of coming down, of rising and its length, s; depth, m."""
COORDINATES, ROWS, LOOPS = 18, 9, 6
_SCRATCH = _delta.SCRATCH + 6
_F = _servo.END
_PATH = _F + _fingers.SIZE
_HIGH, _LOW, _DESCENT, _RISE, _RISE_TIME, _TABLE = range(_PATH, _PATH + len(PATH))


@kernels.helper
def _depth(t: float, p: Array) -> Any:
    """Rate and acceleration of the reference of the flange's depth."""
    _, down, slowing = smooth(t, 0.0 * p[_DESCENT], p[_DESCENT])
    _, up, falling = smooth(t, p[_RISE], p[_RISE] + p[_RISE_TIME])
    stroke = p[_LOW] - p[_HIGH]
    return stroke * (down - up), stroke * (slowing - falling)


@kernels.helper
def _flange_velocity(T: Any, v: Array, p: Array) -> Any:
    """Z' = Jv v, m/s."""
    _, l1, l2, sign = geometry(p)
    a = velocity(T[0], l1, l2, v[0], v[1], v[2])
    b = rotate(turn(1, sign), velocity(T[1], l1, l2, v[3], v[4], v[5]))
    c = rotate(turn(2, sign), velocity(T[2], l1, l2, v[6], v[7], v[8]))
    return (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3, (a[2] + b[2] + c[2]) / 3


@kernels.helper
def _torque(p: Array, T: Any, a: Any) -> Any:
    """My Jy^-1 a + tau_g, N m."""
    F = frame(p, T)
    D, along, _, _ = F
    X = spread(p, T, control_jacobian(p, F))
    l1 = p[2]
    b = dot(D[0], a) / (l1 * along[0]), dot(D[1], a) / (l1 * along[1]), dot(D[2], a) / (l1 * along[2])
    t0, t1, t2 = holding(p, T, X)
    for i in range(3):
        m = reflected(p, T, X, i, b, b, True, False)
        t0, t1, t2 = t0 + m[0], t1 + m[1], t2 + m[2]
    return t0, t1, t2


@kernels.helper
def _actions(t: float, q: Array, v: Array, p: Array) -> Any:
    """Pad forces, the sensors' difference, rates of the error, motor torques, velocity of the flange."""
    T = trig(q, 0), trig(q, 1), trig(q, 2)
    z, zd = flange(p, T), _flange_velocity(T, v, p)
    left, right = pads(t, p, _F, z[0], zd[0], q[9], v[9], q[10], v[10])
    felt = v[11] + p[_F + KS] * p[_F + PAD_MASS] * (v[9] + v[10])
    fall, falling = _depth(t, p)
    rates = p[_F + K] * felt - zd[0], -zd[1], fall - zd[2]
    wanted = (
        pid(p, _F, q[15], v[15], rates[0]),
        pid(p, _F, q[16], v[16], rates[1]),
        pid(p, _F, q[17], v[17], rates[2]) + falling,
    )
    return (left, right), felt, rates, _torque(p, T, wanted), zd


@kernels.dynamics
def dynamics(t: float, q: Array, v: Array, u: Array, p: Array, M: Array, f: Array, w: Array) -> None:
    """The robot's three blocks, then diag(mp, mp, 1), diag(mb, mb, mb), 1."""
    (left, right), felt, rates, torque, _ = _actions(t, q, v, p)
    n = _delta.SCRATCH
    w[n], w[n + 1], w[n + 2] = torque
    w[n + 3], w[n + 4], w[n + 5] = u[0] - left - right, u[1], u[2]
    _delta.dynamics(t, q, v, w[n : n + 6], p, M, f, w)
    M[9:] = 0.0
    mp, mb, bt = p[_F + PAD_MASS], p[_F + BLOCK_MASS], p[_F + BT]
    M[9, 0], M[10, 1], M[11, 2] = mp, mp, 1.0
    M[12, 0], M[13, 1], M[14, 2] = mb, mb, mb
    M[15, 0], M[16, 1], M[17, 2] = 1.0, 1.0, 1.0
    f[9], f[10], f[11] = left, right, -p[_F + KS] * (left + right + felt)
    f[12], f[13], f[14] = -bt * v[12], -bt * v[13], mb * p[8]
    f[15], f[16], f[17] = rates


@kernels.gaps
def gaps(t: float, q: Array, v: Array, p: Array, h: Array, hd: Array) -> None:
    """Closures, pads, and the block above the table."""
    _delta.gaps(t, q, v, p, h, hd)
    half = half_width(p, _F)
    h[6], hd[6] = q[12] - half - q[9], v[12] - v[9]
    h[7], hd[7] = q[10] - q[12] - half, v[10] - v[12]
    h[8], hd[8] = p[_TABLE] - half - q[14], -v[14]


@kernels.rows
def rows(t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array) -> None:
    """The robot's rows; H of (pL, b1) is (-1, 1), of (pR, b1) (1, -1), of b3 -1."""
    _delta.rows(t, q, v, p, w, idx, na, H, h, Hdv)
    half = half_width(p, _F)
    for j in range(na):
        if idx[j] < LOOPS:
            continue
        Hdv[j] = 0.0
        if idx[j] == 6:
            H[j, 9], H[j, 12], h[j] = -1.0, 1.0, q[12] - half - q[9]
        elif idx[j] == 7:
            H[j, 10], H[j, 12], h[j] = 1.0, -1.0, q[10] - q[12] - half
        else:
            H[j, 14], h[j] = -1.0, p[_TABLE] - half - q[14]


@kernels.energy
def energy(q: Array, v: Array, p: Array, e: Array) -> None:
    """Of the robot, the pads and the block; the pads' springs are tied to the moving jaws and count as inputs."""
    _delta.energy(q, v, p, e)
    mb = p[_F + BLOCK_MASS]
    e[0] += 0.5 * mb * (v[12] * v[12] + v[13] * v[13] + v[14] * v[14])
    e[0] += 0.5 * p[_F + PAD_MASS] * (v[9] * v[9] + v[10] * v[10])
    e[1] -= mb * p[8] * q[14]


@kernels.power
def power(t: float, q: Array, v: Array, u: Array, p: Array, e: Array) -> None:
    """Of motors, fingers and force on the flange; and of the viscous friction in the joints and on the table."""
    (left, right), _, _, torque, zd = _actions(t, q, v, p)
    e[0] = left * (v[9] - zd[0]) + right * (v[10] - zd[0]) + u[0] * zd[0] + u[1] * zd[1] + u[2] * zd[2]
    e[0] += torque[0] * v[0] + torque[1] * v[3] + torque[2] * v[6]
    e[1] = p[_F + BT] * (v[12] * v[12] + v[13] * v[13])
    for i in range(3):
        e[1] += p[9] * v[3 * i] ** 2 + p[10] * v[3 * i + 1] ** 2 + p[11] * v[3 * i + 2] ** 2


KERNELS: dict[str, Any] = {"dynamics": dynamics, "gaps": gaps, "rows": rows, "energy": energy, "power": power}


def build(parameters: Mapping[str, Any], law: Law) -> System:
    """The mechanism of a case.

    Args:
        parameters: of the case: the robot's, and the names of `_soft_fingers.NAMES` and `PATH`,
            with kstar for k.
        law: of the nine rows.
    """
    from crossbody.reference import System

    values = _fingers.values(parameters, (*_fingers.NAMES, *PATH))
    return System(
        n=COORDINATES, parameters=np.concatenate([scene.robot_of(parameters).array(), values]),
        a0=law.a0, a1=law.a1, a2=law.a2, unilateral=law.unilateral, mass_block=3, inputs=3, scratch=_SCRATCH,
        **KERNELS,
    )  # fmt: skip


def check_start(parameters: Mapping[str, Any], q0: Floats, v0: Floats) -> None:
    """Raise SceneError for a start that does not close the loops."""
    scene.check_start(parameters, q0[:9], v0[:9])


def listed(p: Floats) -> dict[str, Any]:
    """What the parity audit lists: masses of the robot's bodies, the pads and the block, kg, and gravity."""
    own = robot.listed(p)
    soft = [p[_F + PAD_MASS], p[_F + PAD_MASS], p[_F + BLOCK_MASS]]
    return own | {"masses": np.concatenate([own["masses"], soft])}
