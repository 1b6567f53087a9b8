"""What one contact does under h'' + a1 h' + a0 h (+ a2 h^3) = 0, in closed form (docs/explanation/model.md).

w = sqrt(a0), zeta = a1 / (2 w), v0 > 0 the speed of approach. The contact ends when lam = 0, not when
h = 0: the textbook restitution exp(-pi zeta / sqrt(1 - zeta^2)) belongs to a contact that pulls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from crossbody.cases.arrays import Floats


@dataclass(frozen=True, slots=True)
class LinearArc:
    """One solution of x'' + a1 x' + a0 x = 0 from its value x0 and rate x1 at t = 0.

    sigma = a1/2. Below critical damping x = exp(-sigma t) [x0 cos(wd t) + (x1 + sigma x0) sin(wd
    t)/wd]; from there on, with the rates r1 <= r2 and k = (r2 - r1)/2, x = exp(-r1 t) [(x1 + r2 x0)
    D + x0 E], E = exp(-2 k t), D = (1 - E)/(2 k): neither form subtracts what the double pole makes
    equal, and no exponential overflows.
    """

    a0: float
    a1: float
    x0: float
    x1: float

    @property
    def rate(self) -> LinearArc:
        """The rate x' solves the same equation."""
        return LinearArc(self.a0, self.a1, self.x1, -self.a1 * self.x1 - self.a0 * self.x0)

    @property
    def _split(self) -> float:
        """sigma^2 - a0: negative where the motion swings."""
        return 0.25 * self.a1 * self.a1 - self.a0

    def __call__(self, t: Floats | float) -> Floats:
        """X at the times t >= 0, s."""
        t = np.asarray(t, dtype=np.float64)
        sigma, split = 0.5 * self.a1, self._split
        if split < 0.0:
            wd = math.sqrt(-split)
            swing = self.x0 * np.cos(wd * t) + (self.x1 + sigma * self.x0) * t * np.sinc(wd * t / np.pi)
            return np.asarray(np.exp(-sigma * t) * swing)
        k = math.sqrt(split)
        r2 = sigma + k
        r1 = self.a0 / r2 if r2 > 0.0 else 0.0
        D = -np.expm1(-2.0 * k * t) / (2.0 * k) if k > 0.0 else t
        return np.asarray(np.exp(-r1 * t) * ((self.x1 + r2 * self.x0) * D + self.x0 * np.exp(-2.0 * k * t)))

    def first_zero(self) -> float:
        """First t > 0 with x = 0; infinite if there is none."""
        sigma, split = 0.5 * self.a1, self._split
        if split < 0.0:
            wd = math.sqrt(-split)
            angle = math.atan2(-self.x0 * wd, self.x1 + sigma * self.x0) % math.pi
            return (angle if angle > 0.0 else math.pi) / wd
        k = math.sqrt(split)
        slope = self.x1 + (sigma + k) * self.x0
        if self.x0 == 0.0 or slope == 0.0:
            return math.inf
        # slope D + x0 E = 0  <=>  expm1(2 k t) / (2 k) = -x0 / slope
        ratio = -self.x0 / slope
        if ratio <= 0.0:
            return math.inf
        return math.log1p(2.0 * k * ratio) / (2.0 * k) if k > 0.0 else ratio


def damping_ratio(a0: float, a1: float) -> float:
    """Zeta = a1 / (2 sqrt(a0)); infinite for a damper without a spring."""
    if a0 > 0.0:
        return 0.5 * a1 / math.sqrt(a0)
    return math.inf if a1 > 0.0 else 0.0


def half_angle(zeta: float) -> float:
    """Th(zeta) = acos(zeta)/sqrt(1 - zeta^2), continued through 1 to acosh(zeta)/sqrt(zeta^2 - 1).

    With y^2 = (1 - zeta)/(1 + zeta) both are 2/(1 + zeta) atan(y)/y, an even series in y: no
    digits are lost at 1.
    """
    if zeta > 2.0:
        return math.acosh(zeta) / (math.sqrt(zeta - 1.0) * math.sqrt(zeta + 1.0))
    y2 = (1.0 - zeta) / (1.0 + zeta)
    if abs(y2) < 1e-2:
        ratio = sum((-y2) ** k / (2 * k + 1) for k in range(9))
    elif y2 > 0.0:
        ratio = math.atan(math.sqrt(y2)) / math.sqrt(y2)
    else:
        ratio = math.atanh(math.sqrt(-y2)) / math.sqrt(-y2)
    return 2.0 / (1.0 + zeta) * ratio


def restitution(zeta: float) -> float:
    """E = exp(-2 zeta Th(zeta)): 1 undamped, 1/e^2 at a double pole, some 1/(4 zeta^2) for strong damping."""
    return 0.0 if math.isinf(zeta) else math.exp(-2.0 * zeta * half_angle(zeta))


def contact_time(a0: float, a1: float) -> float:
    """Time from touch to lam = 0 without gravity, 2 Th / w, s: independent of mass and of speed."""
    return 2.0 * half_angle(damping_ratio(a0, a1)) / math.sqrt(a0)


def depth(a0: float, a1: float, v0: float) -> float:
    """Largest penetration without gravity, v0 sqrt(e) / w, m, reached at half the contact time."""
    return v0 * math.sqrt(restitution(damping_ratio(a0, a1)) / a0)


def separation_gap(a0: float, a1: float, v0: float) -> float:
    """Gap at lam = 0 without gravity, -2 zeta v0 e / w, m: the body leaves below the surface."""
    zeta = damping_ratio(a0, a1)
    return -2.0 * zeta * v0 * restitution(zeta) / math.sqrt(a0)


def ballistic_time(a0: float, a1: float) -> float:
    """Time from lam = 0 back to h = 0 without gravity, 2 zeta / w = a1 / a0, s."""
    return a1 / a0


def threshold_speed(a0: float, a1: float, gravity: float) -> float:
    """Speed below which a body under gravity never leaves the linear contact again, g / (w e^(3/2)), m/s."""
    zeta = damping_ratio(a0, a1)
    return gravity / math.sqrt(a0) * math.exp(3.0 * zeta * half_angle(zeta))


def elastic_separation_gap(a0: float, a2: float, gravity: float) -> float:
    """Gap at which an undamped contact lets go, whatever the speed: the real root of a0 h + a2 h^3 = g, m."""
    if a2 == 0.0:
        return gravity / a0
    # Newton from the right of the root: a0 h + a2 h^3 is convex and rising there, so the descent is monotonic.
    h = min(gravity / a0 if a0 > 0.0 else math.inf, math.cbrt(gravity / a2))
    for _ in range(60):
        step = (a0 * h + a2 * h**3 - gravity) / (a0 + 3.0 * a2 * h * h)
        h -= step
        if abs(step) <= 1e-16 * h:
            break
    return h


def contact_work(
    mass: float, gravity: float, a0: float, a1: float, a2: float, h_in: float, h_out: float, speed2: float
) -> float:
    """Energy that one contact gives the body (negative: takes), J (docs/explanation/model.md).

    dE = -m a1 INT h'^2 dt + m [g (h_out - h_in) - a0 (h_out^2 - h_in^2)/2 - a2 (h_out^4 - h_in^4)/4]

    Args:
        mass: kg.
        gravity: along the normal, m/s^2.
        a0: stiffness, 1/s^2.
        a1: damping, 1/s.
        a2: cubic stiffness, 1/(m^2 s^2).
        h_in: gap at activation, m.
        h_out: gap at separation, m.
        speed2: INT h'^2 dt over the contact, m^2/s; it matters only with damping.
    """
    potential = 0.5 * a0 * (h_out**2 - h_in**2) + 0.25 * a2 * (h_out**4 - h_in**4)
    return mass * (gravity * (h_out - h_in) - a1 * speed2 - potential)
