"""What acts on the delta robot beside gravity and its loops, in the coordinates of the tree of hinges (spec 3.8).

Friction and servos act on the absolute angles (q1, q2, q3) of an arm, whose rates follow from those of the tree,
with phi = q1 + alpha and d the direction of the distal link, as

    q2' = (sin gamma cos phi gamma' + cos gamma sin phi phi')/s2        s2 = hypot(d_x, d_z)
    q3' = (-sin phi gamma' + sin gamma cos gamma cos phi phi')/s2^2

so torques on them act on the tree by the transpose. Compiled, because engines call it in every stage of a step.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types

from crossbody.cases.arrays import Floats
from crossbody.reference.cache import compiled
from crossbody.reference.delta import Robot, Servo

_V = types.float64[::1]
_COS = (1.0, -0.5, -0.5)
_SIN = (0.0, -(0.75**0.5), 0.75**0.5)
_NAMES = ("l1", "l2", "d1", "d2", "d3", "sign")
_SERVO = len(_NAMES) + 3


def table(robot: Robot, servo: Servo | None) -> Floats:
    """The numbers that `forces` reads."""
    own = [getattr(robot, name) for name in _NAMES]
    k1 = (robot.m1 / 2 + robot.m2 + robot.m3 / 3) * robot.g * robot.l1
    k2 = (robot.m2 / 2 + robot.m3 / 3) * robot.g * robot.l2
    return np.array([*own, robot.offset, k1, k2, *(servo or Servo()).values()], dtype=np.float64)


def _reference(t: float, i: int, p: Floats) -> Any:
    """Target angle and rate of servo i, and the torque that holds all motors at the target."""
    start, stop = p[_SERVO + 2], p[_SERVO + 3]
    x = 1.0 if t >= stop else 0.0 if t <= start else (t - start) / (stop - start)
    span = p[_SERVO + 8 + i] - p[_SERVO + 5 + i]
    y = p[_SERVO + 5 + i] + span * x**3 * (10.0 + x * (6.0 * x - 15.0))
    rate = span * 30.0 * (x * (1.0 - x)) ** 2 / (stop - start) if stop > start else 0.0
    if p[_SERVO + 4] == 0.0:
        return y, rate, 0.0
    aside = p[6] + p[0] * math.cos(y)
    below = math.sqrt(p[1] * p[1] - aside * aside)
    return y, rate, -p[7] * math.cos(y) - p[8] * aside * p[0] * math.sin(y) / (p[1] * below)


_reference = compiled(_reference)


def forces(t: float, r: Floats, rd: Floats, u: Floats, p: Floats, tau: Floats) -> None:
    """Generalised forces on the tree from friction, servos, motors and a force on the flange.

    Args:
        t: time, s.
        r: angles of the tree (9,).
        rd: rates (9,).
        u: motor torques (3,), N m, and the force on the flange (3,), N.
        p: `table` of the robot.
        tau: receives the forces (9,), N m.
    """
    l1, l2, d1, d2, d3, sign = p[0], p[1], p[2], p[3], p[4], p[5]
    kp, kd = p[_SERVO], p[_SERVO + 1]
    for i in range(3):
        q, gamma, turn, swing = r[3 * i], r[3 * i + 2], rd[3 * i] + rd[3 * i + 1], rd[3 * i + 2]
        phi = q + r[3 * i + 1]
        c, s, cg, sg = math.cos(phi), math.sin(phi), math.cos(gamma), math.sin(gamma)
        square = sg * sg + cg * cg * s * s
        b_phi, b_gamma = cg * s / math.sqrt(square), sg * c / math.sqrt(square)
        w_phi, w_gamma = sg * cg * c / square, -s / square
        t2 = -d2 * (b_phi * turn + b_gamma * swing)
        t3 = -d3 * (w_phi * turn + w_gamma * swing)
        t1 = u[i] - d1 * rd[3 * i]
        if kp != 0.0 or kd != 0.0:
            y, yd, hold = _reference(t, i, p)
            t1 += kp * (y - q) + kd * (yd - rd[3 * i]) + hold
        cs, sn = _COS[i], sign * _SIN[i]
        x, y, z = (cs * u[3] + sn * u[4]) / 3.0, (cs * u[4] - sn * u[3]) / 3.0, u[5] / 3.0
        outer = b_phi * t2 + w_phi * t3 + l2 * cg * (c * z - s * y)
        tau[3 * i] = t1 + outer + l1 * (math.cos(q) * z - math.sin(q) * y)
        tau[3 * i + 1] = outer
        tau[3 * i + 2] = b_gamma * t2 + w_gamma * t3 - l2 * (cg * x + sg * (c * y + s * z))


forces = compiled(forces, [types.void(types.float64, _V, _V, _V, _V, _V)])
