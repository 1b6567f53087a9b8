"""Newton's cradle as numbers: masses, start and law of a row of balls.

Two forms share them. Sliders: q_i is the displacement of ball i from its place at the start, so
that touching neighbours have a gap of exactly 0; h_i = gap + q_(i+1) - q_i. Pendulums: q_i is the
angle of string i from the vertical, counter-clockwise; pivots stand 2 radius + gap apart, and the
gap is that between the circles.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from crossbody.cases import closed_forms as cf
from crossbody.cases.arrays import Floats
from crossbody.cases.case import Value
from crossbody.cases.errors import SceneError
from crossbody.cases.parameters import spread
from crossbody.cases.scene import Body, Joint, RowLaw, Scene, Shape, Tendon, Vector

FROZEN = ("sequential", "simultaneous")
SLOWER = 1e-4  # a0 of CONTACT over a0 of COLLISION under the frozen rules


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
        """Restitution of one collision (docs/explanation/model.md)."""
        return cf.restitution(self.zeta)

    @property
    def v0(self) -> Floats:
        """Speeds as the moving balls arrive (n,), m/s."""
        return np.where(np.arange(self.n) < self.lifted, self.speed, 0.0)


def masses(parameters: Mapping[str, Value]) -> Floats:
    """Mass of each ball (n,), kg."""
    return spread("newtons_cradle: masses", parameters["masses"], int(parameters["n"]))


def row(parameters: Mapping[str, Value], mechanism: str) -> Row:
    """The balls of a case with their speeds as they arrive; pendulums fall from `angle` to the bottom."""
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


def turning(parameters: Mapping[str, Value]) -> float:
    """Return the energy by which balls on strings turn, if they are spheres, over the rest of their kinetic energy."""
    return 0.4 * (float(parameters["radius"]) / float(parameters["length"])) ** 2


def law(balls: Row, collisions: str) -> RowLaw:
    """Return the constants of every row.

    A frozen collision takes no time, so its constants are those of COLLISION, beta = (a0, 2 zeta
    sqrt(a0)). What is captured is held with a hundredth of their frequency and no oscillation (a
    double pole): it starts at h = h' = 0, has nothing to work off, and must not make the
    equations stiff again. Resolved, one set does everything: a second one would change the
    potential of the law at the hand-over, and with it what is to be shown.
    """
    w = math.sqrt(balls.a0)
    a0, a1 = balls.a0, 2.0 * balls.zeta * w
    if collisions not in FROZEN:
        return RowLaw(a0=a0, a1=a1)
    return RowLaw(a0=SLOWER * a0, a1=2.0 * math.sqrt(SLOWER) * w, b0=a0, b1=a1)


def scene(parameters: Mapping[str, Value], mechanism: str, law: RowLaw) -> Scene:
    """Return the balls on slides along x, or on strings beside each other; tendons lie between neighbours."""
    radius, gap = float(parameters["radius"]), float(parameters["gap"])
    hung = (0.0, 0.0, -float(parameters["length"]) if mechanism == "pendulums" else 0.0)
    kinds = {"sliders": ("slide", (1.0, 0.0, 0.0)), "pendulums": ("hinge", (0.0, -1.0, 0.0))}
    kind, axis = kinds[mechanism]
    names = [f"ball {i}" for i in range(int(parameters["n"]))]
    placed = [(i * (2.0 * radius + gap), 0.0, -hung[2]) for i in range(len(names))]
    reaches = [(b[0] - a[0] - gap, gap) for a, b in pairwise(placed)]  # 2 r as places are rounded: a gap of 0 is 0
    rows = [f"balls {i} and {i + 1}" for i in range(len(reaches))]
    between = zip(rows, pairwise(names), reaches, strict=True)
    balls = zip(names, placed, masses(parameters).tolist(), strict=True)
    return Scene(
        bodies=tuple(Body(name=name, position=at, mass=mass, com=hung) for name, at, mass in balls),
        joints=tuple(Joint(name=name, body=name, type=kind, axis=axis) for name in names),
        shapes=tuple(Shape(name=name, body=name, size=(radius, 0.0, 0.0), position=hung) for name in names),
        tendons=tuple(_between(mechanism, name, pair, ends, hung, law) for name, pair, ends in between),
        gravity=(0.0, 0.0, -float(parameters["gravity"]) if mechanism == "pendulums" else 0.0),
    )  # fmt: skip


def _between(
    mechanism: str, name: str, pair: tuple[str, str], reach: tuple[float, float], point: Vector, law: RowLaw
) -> Tendon:
    """Return what lies between neighbours: a difference of coordinates, 0 of sliders that touch, or their distance.

    `reach` is the distance at which they touch and their gap at rest, m; the ball is at a point of
    its body, m.
    """
    touching, gap = reach
    if mechanism == "sliders":
        return Tendon(name=name, joints=pair, coefficients=(-1.0, 1.0), range=(-gap, math.inf), law=law)
    return Tendon(name=name, bodies=pair, positions=(point, point), range=(touching, math.inf), law=law)
