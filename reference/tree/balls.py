"""The bound of a ball joint: how far it may turn from the pose in which its quaternion is (1, 0, 0, 0).

With a quaternion (w, x) of any length, s = |x|, n = x / s and the angular velocity o in body axes,

    angle = 2 atan2(s, w),    angle' = n.o,    angle'' at v' = 0  =  cot(angle/2) |o - (n.o) n|^2 / 2

A quaternion and its negative are one rotation: w counts with the sign `side`, so that the angle is at most half a turn.
There its rate jumps. A run keeps the side from one such instant to the next, and each is an event: inside a step the
angle goes on beyond half a turn, as smooth as the motion. Side 0 stands for the sign of w itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.kinds import Array
from crossbody.reference.tree import layout

AT_Q, AT_V, BOUND, WHICH = 1, 2, 3, 4  # in a row: where q and v begin, the largest angle, and which side is its own
BAND = 1e-12  # of w, of a quaternion of length 1: a side that has just changed does not change back by rounding


@kernels.helper
def _turn(q: Array, p: Array, o: int) -> Any:
    """Return the angle, the axis n and cot(angle/2)/2 of the row at p[o:]; 0 where there is no axis."""
    at, side = int(p[o + AT_Q].real), p[int(p[layout.AT_SIDE].real) + int(p[o + WHICH].real)].real
    w, x, y, z = q[at], q[at + 1], q[at + 2], q[at + 3]
    sign = -1.0 if side < 0.0 or (side == 0.0 and w.real < 0.0) else 1.0
    c = sign * w
    square = x * x + y * y + z * z
    if square.real == 0.0:
        return square, (square, square, square), square
    s = np.sqrt(square)
    if s.real < c.real:
        angle = 2.0 * np.arctan(s / c)
    else:
        angle = 2.0 * np.pi + 2.0 * np.arctan(s / c) if s.real < -c.real else np.pi - 2.0 * np.arctan(c / s)
    return angle, (sign * x / s, sign * y / s, sign * z / s), 0.5 * c / s


@kernels.helper
def bound(q: Array, v: Array, p: Array, o: int) -> tuple[Any, Any, Any]:
    """Return gap, rate and H' v of the row at p[o:]."""
    angle, n, cot = _turn(q, p, o)
    j = int(p[o + AT_V].real)
    rate = n[0] * v[j] + n[1] * v[j + 1] + n[2] * v[j + 2]
    square = v[j] * v[j] + v[j + 1] * v[j + 1] + v[j + 2] * v[j + 2]
    return p[o + BOUND] - angle, -rate, -cot * (square - rate * rate)


@kernels.helper
def bound_columns(q: Array, p: Array, o: int, H: Array) -> None:
    """Fill H (n,) of the row at p[o:]."""
    n, j = _turn(q, p, o)[1], int(p[o + AT_V].real)
    H[j], H[j + 1], H[j + 2] = -n[0], -n[1], -n[2]


@kernels.helper
def to_half_a_turn(q: Array, p: Array, o: int) -> float:
    """Return how far the angle of the row at p[o:] is from half a turn, as the cosine of half of it."""
    side = p[int(p[layout.AT_SIDE].real) + int(p[o + WHICH].real)].real
    return float(side * q[int(p[o + AT_Q].real)].real + BAND if side != 0.0 else 1.0)
