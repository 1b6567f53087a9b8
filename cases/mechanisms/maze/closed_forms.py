"""What a ball that rolls on a ring's face does, in closed form.

R is the radius of the face, rho the radius of the circle of the ball's centre: R + r on an outer
face, R - r inside. With k = J/r^2 = 2/5 m of a solid ball, Jm the maze's inertia (infinite where it
is locked), and no input, rolling eliminates spin and maze, and the angle from the vertical obeys

    mu rho delta'' = +- g sin(delta),     mu = 1 + (k/m) (1 - k R^2/(Jm + k R^2))      (1 without friction)
"""

from __future__ import annotations

import math

INERTIA = 0.4  # J/(m r^2) of a solid ball


def effective_mass(mass: float, R: float, maze_inertia: float, rolling: bool) -> float:
    """Mu, the mass that moves along the face over the mass of the ball; 7/5 where the maze is locked."""
    if not rolling:
        return 1.0
    k = INERTIA * mass * R * R
    return 1.0 + INERTIA * (1.0 - k / (maze_inertia + k))


def pole(g: float, rho: float, mu: float) -> float:
    """Unstable pole on top of an outer face, 1/s: sqrt(g/(mu rho)), sqrt(5 g/(7 rho)) if locked."""
    return math.sqrt(g / (mu * rho))


def leave_cosine(angle: float, mu: float) -> float:
    """Cosine of the angle from the top where a ball released at rest at `angle` leaves: 2 cos(angle)/(2 + mu).

    10/17 of cos(angle) in a locked maze, 2/3 without friction.
    """
    return 2.0 * math.cos(angle) / (2.0 + mu)


def period(g: float, rho: float, mu: float, amplitude: float) -> float:
    """Period of the swing inside a face, s: 2 pi sqrt(mu rho/g) over the mean agm(1, cos(amplitude/2))."""
    a, b = 1.0, math.cos(0.5 * amplitude)
    while abs(a - b) > 1e-15:
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return 2.0 * math.pi * math.sqrt(mu * rho / g) / a


def balance_gains(p: float) -> tuple[float, float, float]:
    """(k2, k1, k0) of (s + p)^3."""
    return 3.0 * p, 3.0 * p * p, p**3


def centre_gains(g: float, rho: float, p: float) -> tuple[float, float, float]:
    """(k2, k1, k0) of (s^2 + w0 s + w0^2)(s + p), w0 the frequency of the ball that rolls to the bottom."""
    w0 = pole(g, rho, 1.0 + INERTIA)
    return w0 + p, w0 * w0 + p * w0, p * w0 * w0
