"""The maze as a scene: rings on a hinge, a ball on two slides and a hinge, and what acts between."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from crossbody.cases.case import Case, Force
from crossbody.cases.errors import CaseUnsupported
from crossbody.cases.form import Form, formed
from crossbody.cases.gates import Gates
from crossbody.cases.mechanisms.maze import gates as at
from crossbody.cases.mechanisms.maze.gates import GUARDS, force, guards, rows, switch
from crossbody.cases.mechanisms.maze.geometry import THICKNESS, Maze, Ring, maze_of, tilted_gravity
from crossbody.cases.scene import Actuator, Body, Joint, Scene, Shape

ONLY_CONTINUOUS = "The torque is evaluated at every state here; only the reference runs a sampled controller."
CHORD = math.radians(5.0)  # longest chord of a wall, as an angle at the axis
TURNING = (0.005, 0.0001)  # torsional and rolling friction of a shape, as a file has them that says nothing
FAR, FAST = (1.0, 1e-3, 1e-3, 1.0), (1.0, 1e-1, 1e-1, 1.0)
"""Sizes of theta, x, y, phi and of their rates, for absolute tolerances: rad, m, rad/s, m/s."""


def in_plane(case: Case, powered: bool = True, steady: bool = False) -> Form:
    """Return the rings and the ball, in the case's coordinates."""
    if case.parameters["controller"] == "sampled":
        raise CaseUnsupported(ONLY_CONTINUOUS)
    p, maze = case.parameters, maze_of(case.parameters)
    own, first = at.numbers(p, maze), len(at.numbers(p, maze)) - at.DISCRETE - at.LATCHED
    gates = Gates(
        rows=rows, guards=guards, switch=switch, numbers=own, count=GUARDS,
        discrete=tuple(range(first, first + at.DISCRETE)),
        follows=(*(-1,) * at.NORMALS, at.BELOW, at.ABOVE)[: len(case.contacts)],
        lost="the ball is more than 60 degrees from the top",
    )  # fmt: skip
    inner = formed(
        case, scene(case, maze), case.q0, case.v0, law=case.law, contacts=case.contacts,
        inputs=case.inputs, gates=gates,
        force=Force(function=force, numbers=own, far=FAR, fast=FAST),
    )  # fmt: skip
    return Form(
        case=inner, to_case=lambda q, v: (q, v), to_scene=lambda q, v: (q, v), rows=tuple(range(len(case.contacts)))
    )


def scene(case: Case, maze: Maze) -> Scene:
    """Return bodies and shapes; gravity lies in the plane, the maze turns about its axis, heavy as a disc."""
    J, mass, r = case.number("maze_inertia"), case.number("ball_mass"), maze.ball
    spin, friction = 0.4 * mass * r * r, float(bool(case.parameters["rolling"]))
    rings = (*maze.rings, Ring(inner=maze.wall, outer=maze.wall + THICKNESS))  # the wall as thick as an added ring
    return Scene(
        bodies=(
            Body(name="maze", mass=2.0 * J / maze.wall**2, inertia=(0.5 * J, 0.5 * J, J, 0.0, 0.0, 0.0)),
            Body(name="ball", mass=mass, inertia=(spin, spin, spin, 0.0, 0.0, 0.0)),
        ),
        joints=(
            Joint(name="maze", body="maze", type="hinge"),
            Joint(name="x", body="ball", type="slide", axis=(1.0, 0.0, 0.0)),
            Joint(name="y", body="ball", type="slide", axis=(0.0, 1.0, 0.0)),
            Joint(name="ball", body="ball", type="hinge"),
        ),
        shapes=(
            Shape(name="ball", body="ball", size=(r, 0.0, 0.0), friction=(friction, *TURNING)),
            *(shape for i, ring in enumerate(rings) for shape in _chords(i, ring, friction)),
        ),
        actuators=(Actuator(name="torque", joint="maze"),),
        gravity=(0.0, -tilted_gravity(case.parameters), 0.0),
    )  # fmt: skip


def _chords(i: int, ring: Ring, friction: float) -> Iterator[Shape]:
    """Return capsules between points of the circle amid a wall, as thick as it, with round ends."""
    for k, (start, end) in enumerate(_arcs(ring)):
        angles = np.linspace(start, end, 1 + math.ceil((end - start) / CHORD))
        points = ring.middle * np.column_stack((np.cos(angles), np.sin(angles)))
        for n, (a, b) in enumerate(pairwise(points)):
            (x, y), length = (0.5 * (a + b)).tolist(), float(np.linalg.norm(b - a))
            along = (b - a) / length * math.sqrt(0.5)
            yield Shape(
                name=f"ring {i} wall {k} chord {n}", body="maze", type="capsule", position=(x, y, 0.0),
                size=(ring.cap, 0.5 * length, 0.0), orientation=(math.sqrt(0.5), -along[1], along[0], 0.0),
                friction=(friction, *TURNING),
            )  # fmt: skip


def _arcs(ring: Ring) -> list[tuple[float, float]]:
    """Return where a wall stands, from tip to tip, rad."""
    if ring.gaps == 0:
        return [(0.0, math.tau)]
    ends = [ring.tips(k) for k in range(ring.gaps)]
    nexts = [*(first for first, _ in ends[1:]), ends[0][0] + math.tau]
    return [(last, first) for (_, last), first in zip(ends, nexts, strict=True)]
