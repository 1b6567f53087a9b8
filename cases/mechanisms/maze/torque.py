"""The torque on the maze that balances the ball and drops it through the gaps, and rolling damping.

With b = atan2(y, x), k = Jb/r^2, kk = k/mb and R the radius of the face on which the ball rolls
at rho, rolling obeys

    (mb + k) rho b'' = -mb g cos b + k R theta''          Jm theta'' = u - R lam_t

so a wanted b'' = w needs theta'' = ((1 + kk) rho w + g cos b)/(kk R). The law places three poles, at a
constant rate omega of the maze (flat output rate y' = kk R theta' - (1 + kk) rho b', y'' = g cos b):

    w = -k2 b' - k1 eps + s k0 (y' - kk R omega)/g        eps = b - s pi/2,  s = +1 on top of a ring, -1 at its bottom

Written apart from the reference's kernels, so that each checks the other.
"""

from __future__ import annotations

import math

from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.maze.numbers import (
    BALANCE,
    BALL_INERTIA,
    BALL_MASS,
    CENTRE0,
    CENTRE1,
    CENTRE2,
    CONTROL,
    DRAG,
    GRAVITY,
    INNER,
    MAZE_INERTIA,
    MOST_TORQUE,
    MOST_TURN,
    OFF,
    OMEGA,
    OUTER,
    RADIUS,
    SNATCH,
    TARGET,
    TOP0,
    TOP1,
    TOP2,
    TOUCHING,
    WN,
    bounded,
    line,
    wrapped,
)


def force(t: float, q: Floats, v: Floats, p: Floats, out: Floats) -> None:
    """Write the controller's torque on the maze, and rolling damping between maze and ball."""
    brake = p[DRAG] * p[TOUCHING] * (v[3] - v[0])
    out[0], out[1], out[2], out[3] = torque(q, v, p) + brake, 0.0, 0.0, -brake


def torque(q: Floats, v: Floats, p: Floats) -> float:
    """Return that of the controller's mode, N m."""
    if p[CONTROL] == OFF:
        return 0.0
    if p[CONTROL] == SNATCH:
        turn = bounded(-2.0 * p[WN] * v[0] - p[WN] ** 2 * (q[0] - p[TARGET]), p[MOST_TURN])
        return bounded(p[MAZE_INERTIA] * turn, p[MOST_TORQUE])
    if p[CONTROL] == BALANCE:
        R = p[line(p, True) + OUTER]
        return _hold(q, v, p, R, R + p[RADIUS], 1.0, p[TOP2], p[TOP1], p[TOP0], p[OMEGA])
    R = p[line(p, False) + INNER]
    return _hold(q, v, p, R, R - p[RADIUS], -1.0, p[CENTRE2], p[CENTRE1], p[CENTRE0], 0.0)


def _hold(
    q: Floats, v: Floats, p: Floats, R: float, rho: float, s: float, k2: float, k1: float, k0: float, omega: float
) -> float:  # fmt: skip
    """Return the torque that holds a rolling ball, N m: the law above, bounded."""
    k, x, y = p[BALL_INERTIA] / p[RADIUS] ** 2, q[1], q[2]
    kk, square = k / p[BALL_MASS], x * x + y * y
    rate, cosine = (x * v[2] - y * v[1]) / square, x / math.sqrt(square)
    flat = kk * R * v[0] - (1.0 + kk) * rho * rate
    off = wrapped(math.atan2(y, x) - 0.5 * math.pi * s)
    w = -k2 * rate - k1 * off + s * k0 * (flat - kk * R * omega) / p[GRAVITY]
    turn = bounded(((1.0 + kk) * rho * w + p[GRAVITY] * cosine) / (kk * R), p[MOST_TURN])
    return bounded(p[MAZE_INERTIA] * turn + k * R * (R * turn - rho * w), p[MOST_TORQUE])
