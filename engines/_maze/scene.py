"""The maze of a case as plain numbers, with what it does to a ball and what is seen of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.maze.geometry import Ring, maze_of
from crossbody.engines._log import Observe
from crossbody.engines._maze.controller import Limits, Plant, at_bottom, balance, on_top, snatch
from crossbody.engines._maze.edges import walls
from crossbody.engines._maze.memory import BALANCE, CENTRE, SNATCH, Memory
from crossbody.engines._maze.rows import ABOVE, BELOW, INNER, OUTER, MazeRows, Place

State = tuple[float, ...]
ONLY_CONTINUOUS = "The torque is evaluated at every state here; a sampled controller runs in the reference alone."


@dataclass(frozen=True, slots=True, kw_only=True)
class Driver:
    """The controller of a case.

    Attributes:
        on: whether there is one.
        plant: what it believes of ball and maze.
        limits: of acceleration and torque.
        top: k2, k1, k0 on a ring's outer face.
        centre: the same inside ring 0.
        omega: rate of the maze while it balances, rad/s.
        wn: natural frequency of the snatch, rad/s.
    """

    on: bool
    plant: Plant
    limits: Limits
    top: tuple[float, float, float]
    centre: tuple[float, float, float]
    omega: float
    wn: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BallMaze:
    """One maze with its ball.

    Attributes:
        rings: from the centre outwards, the closed wall last.
        plant: masses, inertias, gravity.
        rows: formulas of the constraint rows.
        driver: the controller.
        damping: rolling damping on a face, N m s.
        nc: number of constraint rows.
    """

    rings: tuple[Ring, ...]
    plant: Plant
    rows: MazeRows
    driver: Driver
    damping: float
    nc: int

    def torque(self, q: State, v: State, memory: Memory) -> float:
        """Of the controller's mode on the maze, N m."""
        d = self.driver
        if memory.control == SNATCH:
            return snatch(d.plant, d.limits, q, v, memory.target, d.wn)
        if memory.control == BALANCE:
            R = self.rows.radius(memory.place, BELOW)
            return balance(d.plant, d.limits, q, v, (R, R + self.plant.r, -OUTER), d.top, d.omega)
        if memory.control == CENTRE:
            R = self.rows.radius(memory.place, ABOVE)
            return balance(d.plant, d.limits, q, v, (R, R - self.plant.r, -INNER), d.centre, 0.0)
        return 0.0

    def braking(self, v: State, memory: Memory) -> float:
        """Rolling damping: torque on the ball, N m; the maze feels the opposite."""
        on_face = memory.modes[BELOW] == 1 or memory.modes[ABOVE] == 1
        return -self.damping * (v[3] - v[0]) if on_face else 0.0

    def observer(self, places: Sequence[Place]) -> Observe:
        """Gaps and energies of states whose places are known."""
        p, far = self.plant, self.rings[-1].inner

        def gap(place: Place, q: State, v: State) -> list[float]:
            out = [far] * self.nc
            for i, formula in self.rows.at(place).items():
                out[i] = formula(q, v)[0]
            return out

        def observe(q: Floats, v: Floats) -> tuple[Floats, Floats]:
            gaps = [gap(*state) for state in zip(places, q.tolist(), v.tolist(), strict=True)]
            kinetic = 0.5 * v**2 @ np.array([p.Jm, p.mb, p.mb, p.Jb])
            return np.array(gaps), np.column_stack((kinetic, p.mb * p.g * q[:, 2]))

        return observe


def ball_maze(case: Case) -> BallMaze:
    """Read a case.

    Raises:
        InvalidValue: for a geometry that is impossible.
    """
    number, maze = case.number, maze_of(case.parameters)
    r, mb = number("ball_radius"), number("ball_mass")
    g = number("gravity") * math.sin(math.radians(number("tip")))
    plant = Plant(mb=mb, r=r, Jb=0.4 * mb * r * r, Jm=number("maze_inertia"), g=g)
    rings = walls(maze)
    rows = MazeRows(rings, r, bool(case.parameters["rolling"]))
    return BallMaze(
        rings=rings,
        plant=plant,
        rows=rows,
        driver=_driver(case, plant, rings[0].inner - r),
        damping=number("rolling_damping"),
        nc=len(case.contacts),
    )


def _driver(case: Case, plant: Plant, rho: float) -> Driver:
    """The controller; rho is the radius of the ball's path at rest in the centre, m."""
    number = case.number
    mb, Jb = (x * number("model_mass") for x in (plant.mb, plant.Jb))
    model = Plant(
        mb=mb, r=plant.r, Jb=Jb, Jm=plant.Jm * number("model_inertia"), g=plant.g * number("model_gravity")
    )  # fmt: skip
    return Driver(
        on=case.parameters["controller"] != "off",
        plant=model,
        limits=Limits(acceleration=number("a_max") or math.inf, torque=number("u_max") or math.inf),
        top=on_top(number("pole")),
        centre=at_bottom(model.natural / rho, number("centre_pole")),
        omega=number("omega"),
        wn=number("wn"),
    )
