"""Sampled controllers of the delta robot, called at ticks.

Their numbers stand in the parameters p from `FIRST` on: a header (`HEADER`), the knots of the
gains, and the reference at every tick. Their state s holds what a rig's computer remembers
(`STATE`). A pose at which the control Jacobian is singular makes the torque NaN, which ends the
run: holding the last torque would hide it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from crossbody.reference import kernels
from crossbody.reference.cache import compiled
from crossbody.reference.delta.kernels.arm import inertia
from crossbody.reference.delta.kernels.kinematics import (
    SINGULAR,
    control_jacobian,
    flange,
    forward,
    frame,
    holding,
    posture,
    spread,
)
from crossbody.reference.delta.kernels.linear import dot
from crossbody.reference.delta.kernels.servo import END as FIRST
from crossbody.reference.kinds import Floats

HEADER = ("period", "quantum", "delay", "limit", "ticks", "knots", "clamp", "exact", "feedforward", "friction")
_PERIOD, _QUANTUM, _DELAY, _LIMIT, _TICKS, _KNOTS, _CLAMP, _EXACT, _FORWARD, _FRICTION = range(
    FIRST, FIRST + len(HEADER)
)
_DATA = FIRST + len(HEADER)
KNOT, TASK_TICK, JOINT_TICK = 28, 9, 6
"""Numbers a knot (t, Kp, Kd, Ki), and numbers a tick of a reference (r, r', r'') and (y_r, y_r')."""

_COUNT, _INTEGRAL, _BEFORE, _X, _Y, _RATE, _TAU, _GAINS, _QUEUE = 0, 1, 4, 7, 13, 16, 19, 22, 49
STATE = _QUEUE  # length of s without the queue of 3 torques for each sample of delay

_V = types.float64[::1]


@kernels.helper
def _row(rows: Any, w: Any) -> Any:
    return dot(rows[0], w), dot(rows[1], w)


@kernels.helper
def reflected(p: Floats, T: Any, X: Any, i: int, a: Any, rate: Any, exact: bool, friction: bool) -> Any:
    """Part of arm i in S^T (M S a + D S rate), D the viscous friction; its own row alone if not exact."""
    A, B, C = inertia(p)
    c1, s1, c2, s2, c3, s3 = T[i]
    P, Q = B * (s1 * s2 + c1 * c2 * c3), -B * c1 * s3
    b, c = _row(X[i], a)
    f1, f2, f3 = A * a[i] + P * b + Q * c, P * a[i] + C * b, Q * a[i] + C * c
    if not exact:
        f2, f3 = 0.0, 0.0
    if friction:
        b, c = _row(X[i], rate)
        f1, f2, f3 = f1 + p[9] * rate[i], f2 + p[10] * b, f3 + p[11] * c / (s2 * s2)
    u, v = X[i]
    return (
        f2 * u[0] + f3 * v[0] + f1 * (i == 0),
        f2 * u[1] + f3 * v[1] + f1 * (i == 1),
        f2 * u[2] + f3 * v[2] + f1 * (i == 2),
    )


@kernels.helper
def _wanted(gains: Floats, reference: Floats, i: int, e: Any, ed: Any, integral: Floats, feedforward: bool) -> Any:
    """Component i of Ki INT e + Kp e + Kd e' + r''."""
    k = 3 * i
    kp, kd, ki = gains[k : k + 3], gains[k + 9 : k + 12], gains[k + 18 : k + 21]
    wanted = dot(kp, e) + dot(kd, ed) + dot(ki, integral)
    return wanted + reference[6 + i] if feedforward else wanted


def command(
    p: Floats,
    y: Floats,
    x: Floats,
    rate: Floats,
    reference: Floats,
    integral: Floats,
    gains: Floats,
    exact: bool,
    feedforward: bool,
    friction: bool,
    step: float,
    clamp: float,
    tau: Floats,
) -> int:
    """Feedback linearisation, tau = My Jy^-1 (Ki INT e + Kp e + Kd e' + r'') + tau_g, with e = r - z.

    Args:
        p: parameters of the robot.
        y: motor angles (3,), rad.
        x: the other angles (6,) of the closed pose.
        rate: motor rates (3,), rad/s.
        reference: r, r', r'' (9,), m, m/s, m/s^2.
        integral: INT e (3,), m s; receives its next value.
        gains: Kp, Kd, Ki (27,), three matrices by rows.
        exact: whether My = S^T M S, else M11 - M12 h_x^-1 h_y.
        feedforward: whether r'' is added.
        friction: whether the reflected viscous friction S^T D S y' is added.
        step: time over which e is added to the integral, s.
        clamp: bound on |INT e| in each axis, m s.
        tau: receives the torques (3,), N m.

    Returns:
        0, or 1 where the control Jacobian or its inverse is singular.
    """
    T = posture(y, x)
    F = frame(p, T)
    D, along, _, det = F
    if not (abs(det) > SINGULAR and along[0] * along[1] * along[2] != 0.0):
        return 1
    J = control_jacobian(p, F)
    X = spread(p, T, J)
    z = flange(p, T)
    e = reference[0] - z[0], reference[1] - z[1], reference[2] - z[2]
    w = (rate[0], rate[1], rate[2])
    ed = (
        reference[3] - J[0][0] * w[0] - J[1][0] * w[1] - J[2][0] * w[2],
        reference[4] - J[0][1] * w[0] - J[1][1] * w[1] - J[2][1] * w[2],
        reference[5] - J[0][2] * w[0] - J[1][2] * w[1] - J[2][2] * w[2],
    )
    for i in range(3):
        integral[i] = min(clamp, max(-clamp, integral[i] + step * e[i]))
    a = (
        _wanted(gains, reference, 0, e, ed, integral, feedforward),
        _wanted(gains, reference, 1, e, ed, integral, feedforward),
        _wanted(gains, reference, 2, e, ed, integral, feedforward),
    )
    l1 = p[2]
    b = dot(D[0], a) / (l1 * along[0]), dot(D[1], a) / (l1 * along[1]), dot(D[2], a) / (l1 * along[2])
    tau[0], tau[1], tau[2] = holding(p, T, X)
    for i in range(3):
        m = reflected(p, T, X, i, b, w, exact, friction)
        tau[0], tau[1], tau[2] = tau[0] + m[0], tau[1] + m[1], tau[2] + m[2]
    return 0


_b, _f = types.boolean, types.float64
command = compiled(command, [types.int64(_V, _V, _V, _V, _V, _V, _V, _b, _b, _b, _f, _f, _V)])


@kernels.helper
def _gains(t: float, p: Floats, out: Floats) -> None:
    """Gains at t: linear between knots, constant outside."""
    n = int(p[_KNOTS])
    k = 0
    while k + 1 < n and p[_DATA + KNOT * (k + 1)] <= t:
        k += 1
    a = _DATA + KNOT * k
    b = a + KNOT if k + 1 < n and t > p[a] else a
    share = (t - p[a]) / (p[b] - p[a]) if b > a else 0.0
    for j in range(27):
        out[j] = p[a + 1 + j] + share * (p[b + 1 + j] - p[a + 1 + j])


@kernels.helper
def _measure(q: Floats, s: Floats, p: Floats) -> None:
    """Encoder readings and their backward difference; at the first tick the robot stands."""
    quantum, first = p[_QUANTUM], s[_COUNT] == 0.0
    for i in range(3):
        y = q[3 * i]
        s[_Y + i] = np.rint(y / quantum) * quantum if quantum > 0.0 else y
        s[_RATE + i] = 0.0 if first else (s[_Y + i] - s[_BEFORE + i]) / p[_PERIOD]
        s[_BEFORE + i] = s[_Y + i]
        if first:
            s[_X + 2 * i], s[_X + 2 * i + 1] = q[3 * i + 1], q[3 * i + 2]


@kernels.helper
def _tick(s: Floats, p: Floats, width: int) -> int:
    """Where the reference of this tick stands in p; the last one holds for ever."""
    k = min(int(s[_COUNT]), int(p[_TICKS]) - 1)
    return int(_DATA + KNOT * int(p[_KNOTS]) + width * k)


@kernels.helper
def _apply(u: Floats, s: Floats, p: Floats, first: Any) -> None:
    """Limit the torque and let it wait in the queue; at the start the queue holds the torque of the pose."""
    delay, limit = int(p[_DELAY]), p[_LIMIT]
    count = int(s[_COUNT])
    for i in range(3):
        new = min(limit, max(-limit, s[_TAU + i])) if s[_TAU + i] == s[_TAU + i] else np.nan
        if delay == 0:
            u[i] = new
            continue
        if count == 0:
            for k in range(delay):
                s[_QUEUE + 3 * k + i] = first[i]
        place = _QUEUE + 3 * (count % delay) + i
        u[i], s[place] = s[place], new
    s[_COUNT] = count + 1.0


@kernels.helper
def _standing(s: Floats, p: Floats) -> Any:
    """Gravity torque at the measured pose, NaN where it is singular; the robot's x is found on the way."""
    y, x = s[_Y : _Y + 3], s[_X : _X + 6]
    if forward(p, y, x, 1e-6, 20) > 0:
        T = posture(y, x)
        F = frame(p, T)
        if abs(F[3]) > SINGULAR:
            return holding(p, T, spread(p, T, control_jacobian(p, F)))
    return np.nan, np.nan, np.nan


@kernels.control
def linearising(t: float, q: Floats, v: Floats, u: Floats, s: Floats, p: Floats) -> None:
    """PID on the flange through feedback linearisation, see `command`."""
    _measure(q, s, p)
    first = _standing(s, p) if s[_COUNT] == 0.0 else (0.0, 0.0, 0.0)
    _gains(t, p, s[_GAINS : _GAINS + 27])
    k = _tick(s, p, TASK_TICK)
    y, x, tau = s[_Y : _Y + 3], s[_X : _X + 6], s[_TAU : _TAU + 3]
    bad = forward(p, y, x, 1e-6, 20) < 0 or command(
        p,
        y,
        x,
        s[_RATE : _RATE + 3],
        p[k : k + TASK_TICK],
        s[_INTEGRAL : _INTEGRAL + 3],
        s[_GAINS : _GAINS + 27],
        p[_EXACT] != 0.0,
        p[_FORWARD] != 0.0,
        p[_FRICTION] != 0.0,
        p[_PERIOD],
        p[_CLAMP],
        tau,
    )
    if bad:
        tau[:] = np.nan
    _apply(u, s, p, first)


@kernels.control
def proportional(t: float, q: Floats, v: Floats, u: Floats, s: Floats, p: Floats) -> None:
    """PD on the motors with gravity compensation: tau = Kp (y_r - y) + Kd (y_r' - y') + tau_g(y)."""
    _measure(q, s, p)
    hold = _standing(s, p)
    _gains(t, p, s[_GAINS : _GAINS + 27])
    k = _tick(s, p, JOINT_TICK)
    y, rate, gains = s[_Y : _Y + 3], s[_RATE : _RATE + 3], s[_GAINS : _GAINS + 27]
    e = p[k] - y[0], p[k + 1] - y[1], p[k + 2] - y[2]
    ed = p[k + 3] - rate[0], p[k + 4] - rate[1], p[k + 5] - rate[2]
    for i in range(3):
        kp, kd = gains[3 * i : 3 * i + 3], gains[9 + 3 * i : 12 + 3 * i]
        s[_TAU + i] = dot(kp, e) + dot(kd, ed) + hold[i]
    _apply(u, s, p, hold)
