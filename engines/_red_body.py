"""The red body as engines need it: geometry of its five gaps, sizes, energies (spec 2.5).

Written from the geometry, not from the reference's kernels: every gap is n . (a - b) - offset, with a and b points
fixed to bodies (or to the ground) and n fixed to one of them, in the plane of the motion, y up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.engines import _scale

BOX, SLAB = slice(0, 3), slice(3, 6)
ROWS = 5


def _turned(angle: float, point: tuple[float, float]) -> Floats:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * point[0] - s * point[1], s * point[0] + c * point[1]])


def _across(a: Floats) -> Floats:
    """A quarter turn to the left: the derivative of a turned vector by its angle."""
    return np.array([-a[1], a[0]])


@dataclass(frozen=True, kw_only=True)
class RedBody:
    """The two bodies.

    Attributes:
        p: parameters of the case.
    """

    p: Mapping[str, float]

    @property
    def masses(self) -> Floats:
        """Mass and moment of inertia of the box, then of the slab, kg and kg m^2; both are uniform."""
        p = self.p
        box = p["mass"] * (p["half_width"] ** 2 + p["half_height"] ** 2) / 3.0
        slab = p["slab_mass"] * (p["slab_half_length"] ** 2 + p["slab_half_height"] ** 2) / 3.0
        return np.array([p["mass"], box, p["slab_mass"], slab])

    def corner(self, side: float, level: float) -> tuple[float, float]:
        """A corner of the box in its own axes, m: side -1 left, level -1 lower."""
        return side * self.p["half_width"], level * self.p["half_height"]

    def foot(self, side: float) -> tuple[float, float]:
        """A foot of the slab in its own axes, m."""
        return side * self.p["foot"], -self.p["slab_half_height"]

    def point(self, q: Floats, row: int) -> Floats:
        """Where row's own point is in the world (2,), m: a foot, a lower corner, the upper right corner."""
        body = SLAB if row < 2 else BOX
        return q[body][:2] + _turned(q[body][2], self.arm(row))

    def arm(self, row: int) -> tuple[float, float]:
        """Row's own point in the axes of its body, m."""
        side = -1.0 if row in (0, 2) else 1.0
        return self.foot(side) if row < 2 else self.corner(side, -1.0 if row < 4 else 1.0)

    def normal(self, q: Floats, row: int) -> Floats:
        """Direction in which the row pushes its point (2,)."""
        if row == 4:
            return np.array([-1.0, 0.0])
        return _turned(0.0 if row < 2 else float(q[5]), (0.0, 1.0))

    def heights(self, q: Floats) -> Floats:
        """Gaps (5,), m."""
        foot, corner = [self.point(q, i)[1] for i in (0, 1)], [self.point(q, i) - q[3:5] for i in (2, 3)]
        on_slab = [float(self.normal(q, 2) @ d) - self.p["slab_half_height"] for d in corner]
        return np.array([*foot, *on_slab, self.p["wall"] - self.point(q, 4)[0]])

    def jacobian(self, q: Floats) -> Floats:
        """H (5, 6)."""
        H = np.zeros((ROWS, 6))
        for i in range(ROWS):
            n, body = self.normal(q, i), SLAB if i < 2 else BOX
            H[i, body] = self._lever(q, body, n, self.point(q, i))
            if i in (2, 3):
                H[i, SLAB] = -self._lever(q, SLAB, n, self.point(q, i))
        return H

    def _lever(self, q: Floats, body: slice, n: Floats, point: Floats) -> Floats:
        """What moves a point of a body along n: (n, n . across(arm))."""
        return np.array([*n, n @ _across(point - q[body][:2])])

    def drift(self, q: Floats, v: Floats) -> Floats:
        """H' v (5,), m/s^2: centripetal of the point, and of the normal that turns with the slab."""
        out = np.zeros(ROWS)
        for i in range(ROWS):
            n, body = self.normal(q, i), SLAB if i < 2 else BOX
            arm = self.point(q, i) - q[body][:2]
            out[i] = -float(n @ arm) * v[body][2] ** 2
            if i in (2, 3):
                far, spin = self.point(q, i) - q[3:5], float(v[5])
                moving = v[:2] + v[2] * _across(arm) - v[3:5]
                out[i] += 2.0 * spin * float(_across(n) @ moving) - spin * spin * float(n @ far)
        return out

    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Gaps (m, 5), m, and energies (m, 2), J, of m states."""
        box, inertia, slab, slab_inertia = self.masses
        gaps = np.array([self.heights(x) for x in q])
        kinetic = 0.5 * (v * v) @ np.array([box, box, inertia, slab, slab, slab_inertia])
        return gaps, np.column_stack((kinetic, self.p["gravity"] * (box * q[:, 1] + slab * q[:, 4])))

    @property
    def speed(self) -> float:
        """About the fastest that a corner gets, m/s: what the height of the box over its rest is worth."""
        p = self.p
        fall = p["drop"] + p["half_width"] * abs(math.sin(p["tilt"]))
        return math.sqrt(2.0 * p["gravity"] * fall) + abs(p["speed_x"]) + abs(p["speed_y"])

    @property
    def depth(self) -> float:
        """How deep a collision gets at that speed, m."""
        return self.speed / math.sqrt(self.p["b0"])


def red_body(case: Case) -> RedBody:
    """Read a case."""
    return RedBody(p={k: float(value) for k, value in case.parameters.items()})


def under(case: Case, collisions: str) -> Case:
    """The same scene under another collision rule, for what an engine's profile follows instead of the case's own."""
    return case if case.collisions == collisions else replace(case, collisions=collisions, claims=())


def step(case: Case) -> float:
    """Time step with twenty of them in half a period of COLLISION, s."""
    return _scale.resolving_step(case.law)
