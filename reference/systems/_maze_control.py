"""Torque that balances the ball, snatches a gap under it, and damps it in the centre.

The ball rolls on a face of radius R, rho = R + r outside or R - r inside, at the angle b; k =
J/r^2 and kk = k/mb:

    (mb + k) rho b'' = -mb g cos b + k R theta''         Jm theta'' = u - k R (R theta'' - rho b'')

To give b'' = w the maze needs theta'' = ((1 + kk) rho w + g cos b)/(kk R). With eps the angle
from the equilibrium (top, sg = 1, or bottom, sg = -1) and the flat output's rate y' = kk R theta'
- (1 + kk) rho b', whose y'' = g cos b,

    w = -k2 b' - k1 eps + sg k0 (y' - kk R omega)/g

places the poles of s^3 + k2 s^2 + k1 s + k0 at a constant rate omega of the maze.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.cases.mechanisms.maze.claims import INERTIA
from crossbody.reference import kernels
from crossbody.reference.kinds import Floats
from crossbody.reference.systems._maze_layout import (
    A_MAX,
    BALANCE,
    C0,
    C1,
    C2,
    CONTINUOUS,
    DELAY,
    INNER,
    JM,
    K0,
    K1,
    K2,
    KIND,
    MB,
    MODE,
    MODEL_G,
    MODEL_JM,
    MODEL_MB,
    NOISE,
    NOISE_SPEED,
    OFF,
    OMEGA,
    OUTER,
    RADIUS,
    SEED,
    SNATCH,
    TABLE,
    TARGET,
    U_MAX,
    WN,
    G,
    below,
    limited,
    number,
    polar,
)  # fmt: skip

KK = INERTIA


@kernels.helper
def _face(p: Any, top: bool) -> Any:
    """R and rho of the face that the law holds the ball on."""
    if top:
        R = p[below(p) + OUTER]
        return R, R + p[RADIUS]
    R = p[TABLE + INNER]
    return R, R - p[RADIUS]


@kernels.helper
def _snatch(theta: Any, rate: Any, p: Any) -> Any:
    """Servo of the maze to the latched angle: theta'' = -2 wn theta' - wn^2 (theta - target)."""
    wn = p[WN]
    a = limited(-2.0 * wn * rate - wn * wn * (theta - p[TARGET]), p[A_MAX])
    return p[JM] * p[MODEL_JM] * a


@kernels.helper
def _hold(rate: Any, x: Any, y: Any, xd: Any, yd: Any, p: Any, top: bool) -> Any:
    """The law above, on top of the ring below or at the bottom of ring 0."""
    R, rho = _face(p, top)
    g, k, jm = p[G] * p[MODEL_G], KK * p[MB] * p[MODEL_MB], p[JM] * p[MODEL_JM]
    sg = 1.0 if top else -1.0
    k2, k1, k0, omega = (p[K2], p[K1], p[K0], p[OMEGA]) if top else (p[C2], p[C1], p[C0], 0.0 * p[OMEGA])
    square = x * x + y * y
    bd = (x * yd - y * xd) / square
    eps = polar(sg * y, -sg * x)
    output = KK * R * rate - (1.0 + KK) * rho * bd
    w = -k2 * bd - k1 * eps + sg * k0 * (output - KK * R * omega) / g
    a = limited(((1.0 + KK) * rho * w + g * x / np.sqrt(square)) / (KK * R), p[A_MAX])
    return jm * a + k * R * (R * a - rho * w)


@kernels.helper
def command(theta: Any, rate: Any, x: Any, y: Any, xd: Any, yd: Any, p: Any) -> Any:
    """Torque of the present mode, N m."""
    mode = number(p[MODE])
    if mode == OFF:
        return 0.0 * theta
    u = _snatch(theta, rate, p) if mode == SNATCH else _hold(rate, x, y, xd, yd, p, mode == BALANCE)
    return limited(u, p[U_MAX])


@kernels.helper
def torque(q: Any, v: Any, p: Any) -> Any:
    """Torque of the continuous controller, N m; a sampled one acts through u."""
    if number(p[KIND]) != CONTINUOUS:
        return 0.0 * q[0]
    return command(q[0], v[0], q[1], q[2], v[1], v[2], p)


_MIX = np.array([0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB], dtype=np.uint64)
_SHIFT = np.array([30, 27, 31, 11], dtype=np.uint64)


@kernels.helper
def _uniform(seed: float, count: float, k: int) -> float:
    """A number in (0, 1] that depends on its arguments alone: the finaliser of SplitMix64 on their sum."""
    z = (np.uint64(seed) * _MIX[1] + np.uint64(count) * np.uint64(16) + np.uint64(k) + np.uint64(1)) * _MIX[0]
    z = (z ^ (z >> _SHIFT[0])) * _MIX[1]
    z = (z ^ (z >> _SHIFT[1])) * _MIX[2]
    z = (z ^ (z >> _SHIFT[2])) >> _SHIFT[3]
    return (float(z) + 1.0) * 2.0**-53


@kernels.helper
def _normal(seed: float, count: float, k: int) -> float:
    """A normally distributed number (Box and Muller)."""
    a, b = _uniform(seed, count, 2 * k), _uniform(seed, count, 2 * k + 1)
    return float(np.sqrt(-2.0 * np.log(a)) * np.cos(2.0 * np.pi * b))


@kernels.control
def sampled(t: float, q: Floats, v: Floats, u: Floats, s: Floats, p: Floats) -> None:
    """The same torque from readings at ticks, held, `delay` samples late; s = (count, torques that wait)."""
    count, delay = s[0], number(p[DELAY])
    x, y, xd, yd = q[1], q[2], v[1], v[2]
    if p[NOISE] > 0.0 or p[NOISE_SPEED] > 0.0:
        x += p[NOISE] * _normal(p[SEED], count, 0)
        y += p[NOISE] * _normal(p[SEED], count, 1)
        xd += p[NOISE_SPEED] * _normal(p[SEED], count, 2)
        yd += p[NOISE_SPEED] * _normal(p[SEED], count, 3)
    new = command(q[0], v[0], x, y, xd, yd, p)
    if delay > 0:
        place = 1 + int(count) % delay
        new, s[place] = s[place], new
    u[0] = new
    s[0] = count + 1.0
