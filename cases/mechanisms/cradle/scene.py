"""Newton's cradle as numbers: masses, start and law of a row of balls (spec 2.2).

Two forms share them. Sliders: q_i is the displacement of ball i from its place at the start, so that touching
neighbours have a gap of exactly 0; h_i = gap + q_(i+1) - q_i. Pendulums: q_i is the angle of string i from the
vertical, counter-clockwise; pivots stand 2 radius + gap apart, and the gap is that between the circles.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from crossbody.cases import closed_forms as cf
from crossbody.cases.arrays import Floats
from crossbody.cases.case import Law, Value
from crossbody.cases.errors import SceneError
from crossbody.cases.parameters import spread

FROZEN = ("sequential", "simultaneous")
SLOWER = 1e-4
"""a0 of CONTACT over a0 of COLLISION under the frozen rules."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """The balls of a cradle, left to right.

    Attributes:
        masses (n,): kg.
        lifted: k, how many of the leftmost balls move at the start.
        speed: of these, m/s: at the start (sliders), or at the bottom (pendulums).
        gap: between neighbours at rest, m.
        a0: fast stiffness over the mass, 1/s^2.
        zeta: damping ratio of a collision.
    """

    masses: Floats
    lifted: int
    speed: float
    gap: float
    a0: float
    zeta: float

    @property
    def n(self) -> int:
        """Number of balls."""
        return len(self.masses)

    @property
    def e(self) -> float:
        """Restitution of one collision (spec 1.3)."""
        return cf.restitution(self.zeta)

    @property
    def v0(self) -> Floats:
        """Speeds as the moving balls arrive (n,), m/s."""
        return np.where(np.arange(self.n) < self.lifted, self.speed, 0.0)


def masses(parameters: Mapping[str, Value]) -> Floats:
    """Mass of each ball (n,), kg.

    Raises:
        InvalidValue: if neither one nor n are listed.
    """
    return spread("newtons_cradle: masses", parameters["masses"], int(parameters["n"]))


def row(parameters: Mapping[str, Value], mechanism: str) -> Row:
    """The balls of a case with their speeds as they arrive.

    Args:
        parameters: of the case.
        mechanism: "sliders", or "pendulums", whose balls fall from `angle` to the bottom.

    Raises:
        InvalidValue, SceneError: for masses of another count, overlapping balls, or none that could be hit.
    """
    n, lifted, gap = int(parameters["n"]), int(parameters["lifted"]), float(parameters["gap"])
    if gap < 0.0:
        raise SceneError(f"newtons_cradle: gap is {gap:g} m: neighbours overlap at the start; valid: 0 or more.")
    if lifted >= n:
        raise SceneError(f"newtons_cradle: lifted is {lifted} of n = {n} balls; valid: 1 to {n - 1}.")
    return Row(
        masses=masses(parameters), lifted=lifted, speed=_arrival(parameters, mechanism), gap=gap,
        a0=float(parameters["a0"]), zeta=float(parameters["zeta"]),
    )  # fmt: skip


def _arrival(parameters: Mapping[str, Value], mechanism: str) -> float:
    if mechanism == "sliders":
        return float(parameters["speed"])
    g, length, angle = (float(parameters[name]) for name in ("gravity", "length", "angle"))
    return 2.0 * math.sqrt(g * length) * abs(math.sin(0.5 * angle))


def law(balls: Row, collisions: str) -> Law:
    """Constants of the n - 1 rows.

    A frozen collision takes no time, so its constants are those of COLLISION, beta = (a0, 2 zeta sqrt(a0)). What is
    captured is held with a hundredth of their frequency and no oscillation (a double pole): it starts at h = h' = 0,
    has nothing to work off, and must not make the equations stiff again. Resolved, one set does everything: a second
    one would change the potential of spec 1.2 at the hand-over, and with it what is to be shown.
    """
    rows = balls.n - 1
    w = math.sqrt(balls.a0)
    fast = (balls.a0, 2.0 * balls.zeta * w)
    slow = (SLOWER * balls.a0, 2.0 * math.sqrt(SLOWER) * w)
    a, b = (slow, fast) if collisions in FROZEN else (fast, (0.0, 0.0))
    full = (np.full(rows, value) for value in (*a, *b))
    a0, a1, b0, b1 = full
    return Law(a0=a0, a1=a1, a2=np.zeros(rows), b0=b0, b1=b1, unilateral=np.ones(rows, dtype=np.bool_))
