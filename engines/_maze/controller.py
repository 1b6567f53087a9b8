"""The torque on the maze that balances the ball and drops it through the gaps, in plain Python.

Written apart from the compiled controller, so that each checks the other. With b = atan2(y, x), k = Jb/r^2,
kk = k/mb and R the radius of the face on which the ball rolls at rho, rolling obeys on either face

    (mb + k) rho b'' = -mb g cos b + k R theta''          Jm theta'' = u - R lam_t

so a wanted b'' = w needs theta'' = ((1 + kk) rho w + g cos b)/(kk R). The law places three poles, at a constant rate
omega of the maze (flat output rate y' = kk R theta' - (1 + kk) rho b', y'' = g cos b):

    w = -k2 b' - k1 eps + s k0 (y' - kk R omega)/g        eps = b - s pi/2,  s = +1 on top of a ring, -1 at its bottom
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from crossbody.engines._maze.edges import wrapped

State = tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """What the controller believes of ball and maze: mb kg, r m, Jb and Jm kg m^2, g m/s^2 in the maze's plane."""

    mb: float
    r: float
    Jb: float
    Jm: float
    g: float

    @property
    def k(self) -> float:
        """Inertia of spin as a mass at the rim, kg."""
        return self.Jb / self.r**2

    @property
    def natural(self) -> float:
        """Square of a pendulum's frequency times its length, g/(1 + kk), m/s^2."""
        return self.g / (1.0 + self.k / self.mb)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds: acceleration of the maze rad/s^2, torque N m."""

    acceleration: float
    torque: float


def clipped(x: float, bound: float) -> float:
    """X within -bound..bound."""
    return min(max(x, -bound), bound)


def on_top(pole: float) -> tuple[float, float, float]:
    """(k2, k1, k0) of (s + pole)^3."""
    return 3.0 * pole, 3.0 * pole**2, pole**3


def at_bottom(w2: float, pole: float) -> tuple[float, float, float]:
    """(k2, k1, k0) of (s^2 + w s + w^2)(s + pole): the natural frequency with damping ratio 1/2; w2 = w^2."""
    w = math.sqrt(w2)
    return w + pole, w2 + w * pole, w2 * pole


def balance(
    plant: Plant, limits: Limits, q: State, v: State, face: tuple[float, float, float],
    gains: tuple[float, float, float], omega: float,
) -> float:  # fmt: skip
    """Torque that holds a rolling ball, N m.

    Args:
        plant: masses, inertias and gravity.
        limits: bounds on acceleration and torque.
        q: theta, x, y, phi.
        v: their rates.
        face: radius R of the face, radius rho of the ball's path on it, m, and s (+1 on top, -1 at the bottom).
        gains: k2, k1, k0.
        omega: rate at which the maze shall turn, rad/s.
    """
    (k2, k1, k0), (R, rho, s) = gains, face
    x, y, k = q[1], q[2], plant.k
    kk, square = k / plant.mb, x * x + y * y
    rate = (x * v[2] - y * v[1]) / square
    cosine = x / math.sqrt(square)
    flat = kk * R * v[0] - (1.0 + kk) * rho * rate
    off = wrapped(math.atan2(y, x) - 0.5 * math.pi * s)
    w = -k2 * rate - k1 * off + s * k0 * (flat - kk * R * omega) / plant.g
    turn = clipped(((1.0 + kk) * rho * w + plant.g * cosine) / (kk * R), limits.acceleration)
    return clipped(plant.Jm * turn + k * R * (R * turn - rho * w), limits.torque)


def snatch(plant: Plant, limits: Limits, q: State, v: State, target: float, wn: float) -> float:
    """Torque that takes the maze to a latched angle, N m.

    Args:
        plant: inertia of the maze.
        limits: bounds on acceleration and torque.
        q: theta, x, y, phi.
        v: their rates.
        target: angle of the maze that puts the middle of the gap under the ball, rad.
        wn: speed of both poles, rad/s.
    """
    turn = clipped(-2.0 * wn * v[0] - wn * wn * (q[0] - target), limits.acceleration)
    return clipped(plant.Jm * turn, limits.torque)
