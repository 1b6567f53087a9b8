"""Solutions of x'' + a1 x' + a0 x = 0, accurate through the double pole and for any damping.

sigma = a1/2. Below critical damping x = exp(-sigma t) [x0 cos(wd t) + (x1 + sigma x0) sin(wd
t)/wd]; from there on, with the rates r1 <= r2 and k = (r2 - r1)/2, x = exp(-r1 t) [(x1 + r2 x0) D
+ x0 E], E = exp(-2 k t), D = (1 - E)/(2 k): neither form subtracts what the double pole makes
equal, and no exponential overflows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from crossbody.cases.arrays import Floats


@dataclass(frozen=True, slots=True)
class LinearArc:
    """One solution from its value and its rate at t = 0.

    Attributes:
        a0: stiffness, 1/s^2.
        a1: damping, 1/s.
        x0: value at t = 0.
        x1: rate at t = 0.
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
