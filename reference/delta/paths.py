"""References for the flange: smooth moves, circles, and recorded ones.

Each function returns a path: times (n,) to position, velocity and acceleration, (n, 3) each.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from crossbody.cases import InvalidValue
from crossbody.reference.delta.control import Path
from crossbody.reference.delta.kinematics import vector
from crossbody.reference.kinds import Floats


def _positive(name: str, value: float, unit: str) -> float:
    if not 0 < value < math.inf:
        raise InvalidValue(f"{name} is {value!r} {unit}; it must be above 0 {unit}.")
    return value


def hold(z: ArrayLike) -> Path:
    """Stay at z (3,), m."""
    point = vector("position", z, 3)

    def path(t: Floats) -> tuple[Floats, Floats, Floats]:
        still = np.zeros((len(t), 3))
        return point + still, still, still

    return path


def move(start: ArrayLike, end: ArrayLike, duration: float, begin: float = 0.0) -> Path:
    """Straight from start to end; speed and acceleration vanish at both ends (polynomial of fifth degree).

    Args:
        start: position (3,) until `begin`, m.
        end: position (3,) from `begin + duration` on, m.
        duration: s.
        begin: s.
    """
    a, b = vector("start", start, 3), vector("end", end, 3)
    T = _positive("duration", duration, "s")

    def path(t: Floats) -> tuple[Floats, Floats, Floats]:
        x = np.clip((t - begin) / T, 0.0, 1.0)[:, None]
        s, sd, sdd = x**3 * (10 - 15 * x + 6 * x**2), 30 * x**2 * (1 - x) ** 2, 60 * x * (1 - x) * (1 - 2 * x)
        return a + s * (b - a), sd * (b - a) / T, sdd * (b - a) / T**2

    return path


def circle(centre: ArrayLike, radius: float, frequency: float, fade: float = 1.0) -> Path:
    """A horizontal circle about `centre`, entered by letting the radius grow smoothly from 0.

    Args:
        centre: (3,), m.
        radius: m.
        frequency: turns a second, Hz.
        fade: time in which the radius grows, s.
    """
    c = vector("centre", centre, 3)
    R, w = _positive("radius", radius, "m"), 2 * math.pi * _positive("frequency", frequency, "Hz")
    grow = move((0.0, 0.0, 0.0), (R, 0.0, 0.0), fade)

    def path(t: Floats) -> tuple[Floats, Floats, Floats]:
        g, gd, gdd = (part[:, :1] for part in grow(t))
        zero = np.zeros_like(t)
        e = np.column_stack([np.cos(w * t), np.sin(w * t), zero])
        n = np.column_stack([-np.sin(w * t), np.cos(w * t), zero])
        return c + g * e, gd * e + g * w * n, (gdd - g * w * w) * e + 2 * gd * w * n

    return path


def recorded(t: ArrayLike, z: ArrayLike) -> Path:
    """A recorded path, for example of a joystick: a spline of fifth degree through the samples, at rest outside.

    Args:
        t: times (n,), increasing, s; at least 6.
        z: positions (n, 3), m.

    Raises:
        InvalidValue: if the times do not increase, or shapes or values do not fit.
    """
    times, points = np.asarray(t, dtype=np.float64), np.asarray(z, dtype=np.float64)
    if times.ndim != 1 or len(times) < 6 or points.shape != (len(times), 3):
        raise InvalidValue(f"Recorded path: t {times.shape} and z {points.shape}; (n,) and (n, 3), n >= 6, are valid.")
    if not (np.all(np.isfinite(times)) and np.all(np.isfinite(points)) and np.all(np.diff(times) > 0)):
        raise InvalidValue("Recorded path: times must increase, and times and positions must be finite.")
    spline = make_interp_spline(times, points, k=5)
    rate, acceleration = spline.derivative(1), spline.derivative(2)

    def path(at: Floats) -> tuple[Floats, Floats, Floats]:
        inside = np.clip(at, times[0], times[-1])
        moving = ((at >= times[0]) & (at <= times[-1]))[:, None]
        return spline(inside), rate(inside) * moving, acceleration(inside) * moving

    return path
