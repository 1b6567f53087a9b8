"""Newton's cradle as engines need it: geometry of its gaps, its size, and the law of what collides (spec 2.2).

Written from the geometry, not from the reference's kernels. Both forms measure the gap of neighbours i and i + 1.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from crossbody.cases import Case, Law
from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.cradle.scene import masses
from crossbody.engines import _scale


def one_set(law: Law) -> Law:
    """The constants of a row just entered as its only ones: those of COLLISION where it has two sets."""
    quick = law.b0 > 0.0
    return Law(
        a0=np.where(quick, law.b0, law.a0), a1=np.where(quick, law.b1, law.a1), a2=np.where(quick, 0.0, law.a2),
        unilateral=law.unilateral,
    )  # fmt: skip


def in_real_time(case: Case, fsm: str) -> Case:
    """The same scene with every contact integrated in real time, all together, under the machine `fsm`."""
    return replace(case, law=one_set(case.law), fsm=fsm, collisions="resolved", closed_form=None, claims=())


@dataclass(frozen=True, kw_only=True)
class Chain(ABC):
    """A row of balls.

    Attributes:
        masses (n,): kg, left to right.
        radius: m.
        gap: between neighbours at rest, m.
        gravity: m/s^2.
        speed: about the fastest that a ball gets, m/s.
    """

    masses: Floats
    radius: float
    gap: float
    gravity: float
    speed: float

    @property
    def n(self) -> int:
        """Number of balls."""
        return len(self.masses)

    @property
    def spacing(self) -> float:
        """Distance of neighbours at rest, m."""
        return 2.0 * self.radius + self.gap

    @abstractmethod
    def heights(self, q: Floats) -> Floats:
        """Gaps (..., n - 1), m, of positions (..., n)."""

    @abstractmethod
    def slopes(self, q: Floats) -> tuple[Floats, Floats]:
        """Derivatives of every gap by the coordinates of its left and of its right ball (n - 1,)."""

    @abstractmethod
    def drift(self, q: Floats, v: Floats) -> Floats:
        """H' v (n - 1,), m/s^2."""

    @abstractmethod
    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Gaps (m, n - 1), m, and energies (m, 2), J, of m states."""

    @abstractmethod
    def sizes(self, law: Law) -> tuple[float, float]:
        """How deep contacts give, and how fast balls move, in units of q and v."""

    def jacobian(self, q: Floats) -> Floats:
        """H (n - 1, n)."""
        H, i = np.zeros((self.n - 1, self.n)), np.arange(self.n - 1)
        H[i, i], H[i, i + 1] = self.slopes(q)
        return H

    def depth(self, law: Law) -> float:
        """How deep two balls get at the largest speed, m; their radius without a law."""
        stiffness = float(np.max(law.a0, initial=0.0))
        return self.speed / math.sqrt(stiffness) if stiffness > 0.0 else self.radius

    def step(self, law: Law) -> float:
        """Time step with twenty of them in a contact, s."""
        return _scale.resolving_step(one_set(law))


@dataclass(frozen=True, kw_only=True)
class Sliders(Chain):
    """Balls on a line: q_i is the displacement of ball i, m."""

    def heights(self, q: Floats) -> Floats:
        """See `Chain`."""
        h: Floats = self.gap + np.diff(q, axis=-1)
        return h

    def slopes(self, q: Floats) -> tuple[Floats, Floats]:
        """See `Chain`."""
        one = np.ones(self.n - 1)
        return -one, one

    def drift(self, q: Floats, v: Floats) -> Floats:
        """See `Chain`."""
        return np.zeros(self.n - 1)

    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """See `Chain`."""
        kinetic = 0.5 * (v * v) @ self.masses
        return self.heights(q), np.column_stack((kinetic, np.zeros(len(q))))

    def sizes(self, law: Law) -> tuple[float, float]:
        """See `Chain`."""
        return self.depth(law), self.speed


@dataclass(frozen=True, kw_only=True)
class Pendulums(Chain):
    """Point masses on strings of length L, m, side by side: q_i is the angle of string i, counter-clockwise, rad.

    Centres c_i = (i D + L sin q_i, -L cos q_i); h = |c_(i+1) - c_i| - 2 r. With equal angles d = (D, 0) exactly, so
    that balls that hang side by side touch exactly.
    """

    length: float

    def _apart(self, sin: Floats, cos: Floats) -> tuple[Floats, Floats, Floats]:
        """Vector (x, z) from each ball to its right neighbour, and its length (..., n - 1), m."""
        L = self.length
        x = self.spacing + L * (sin[..., 1:] - sin[..., :-1])
        z = L * (cos[..., :-1] - cos[..., 1:])
        return x, z, np.sqrt(x * x + z * z)

    def heights(self, q: Floats) -> Floats:
        """See `Chain`."""
        h: Floats = self._apart(np.sin(q), np.cos(q))[2] - 2.0 * self.radius
        return h

    def slopes(self, q: Floats) -> tuple[Floats, Floats]:
        """See `Chain`: the normal times L (cos q, sin q)."""
        sin, cos = np.sin(q), np.cos(q)
        x, z, far = self._apart(sin, cos)
        x, z = self.length * x / far, self.length * z / far
        return -(x * cos[:-1] + z * sin[:-1]), x * cos[1:] + z * sin[1:]

    def drift(self, q: Floats, v: Floats) -> Floats:
        """See `Chain`: with s = d', h'' at v' = 0 is (|s|^2 - (n.s)^2)/|d| + n.s'."""
        sin, cos = self.length * np.sin(q), self.length * np.cos(q)
        x, z, far = self._apart(sin / self.length, cos / self.length)
        x, z, v2 = x / far, z / far, v * v
        sx, sz, ax, az = cos * v, sin * v, sin * v2, cos * v2
        sx, sz = sx[1:] - sx[:-1], sz[1:] - sz[:-1]
        along = x * sx + z * sz
        total: Floats = (sx * sx + sz * sz - along * along) / far + z * (az[1:] - az[:-1]) - x * (ax[1:] - ax[:-1])
        return total

    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """See `Chain`."""
        L = self.length
        kinetic = 0.5 * L * L * (v * v) @ self.masses
        potential = self.gravity * L * (2.0 * np.sin(0.5 * q) ** 2) @ self.masses
        return self.heights(q), np.column_stack((kinetic, potential))

    def sizes(self, law: Law) -> tuple[float, float]:
        """See `Chain`."""
        return self.depth(law) / self.length, self.speed / self.length


def sliders(case: Case) -> Sliders:
    """Read a case of sliders."""
    return Sliders(
        masses=masses(case.parameters), radius=case.number("radius"), gap=case.number("gap"), gravity=0.0,
        speed=float(np.abs(case.v0).max()) or 1.0,
    )  # fmt: skip


def pendulums(case: Case) -> Pendulums:
    """Read a case of pendulums."""
    g, L = case.number("gravity"), case.number("length")
    fall = 2.0 * g * L * (1.0 - float(np.cos(case.q0).min()))
    return Pendulums(
        masses=masses(case.parameters), radius=case.number("radius"), gap=case.number("gap"), gravity=g, length=L,
        speed=math.sqrt(fall + (L * float(np.abs(case.v0).max())) ** 2) or 1.0,
    )  # fmt: skip
