"""A ball in a tilted maze of rings: the angle of the maze and the position of the ball are measured."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from crossbody import cases
from crossbody.cases import Case, Coordinate, Inputs, SceneError
from crossbody.cases.library.ball_maze import PARAMETERS
from crossbody.cases.mechanisms.maze.geometry import maze_of
from crossbody.hw.models.contract import Model, Numbers, Segment

SCENE = ("ring", "side", "angle", "theta", "t_end", "controller", "seed", "noise", "noise_speed")


def build(numbers: Numbers, segment: Segment) -> Case:
    """One stretch under recorded torques on the maze, with the ball on the face that is nearest at the start.

    The turn of the ball is not measured: it starts at 0, and its rate is that of rolling on that
    face without slip.
    """
    theta, x, y = segment.y.tolist()
    turning, xd, yd = segment.yd.tolist()
    rho = math.hypot(x, y)
    ring, side, R = _nearest(numbers, rho)
    s = 1.0 if side == "inner" else -1.0
    case = cases.load(
        "ball_maze", variant="free", t_end=segment.t_end, ring=ring, side=side, angle=math.atan2(x, -s * y),
        theta=theta, **numbers,
    )  # fmt: skip
    spin = (R * turning - (x * yd - y * xd) / rho) / (s * float(numbers["ball_radius"])) if numbers["rolling"] else 0.0
    driven = bool(len(segment.times))
    return replace(
        case, name="maze", variant="replay", q0=np.array([theta, x, y, 0.0]), v0=np.append(segment.yd, spin),
        inputs=Inputs(names=("torque [N m]",), times=segment.times, values=segment.inputs) if driven else None,
        claims=(), limits=(),
    )  # fmt: skip


def _nearest(numbers: Numbers, rho: float) -> tuple[int, str, float]:
    """Ring, side and radius of the face that a ball at this radius is nearest to."""
    maze = maze_of(numbers)
    faces = [
        (abs(abs(R - rho) - maze.ball), i, side, R)
        for i, ring in enumerate(maze.rings) for side, R in (("inner", ring.inner), ("outer", ring.outer))
        if (rho < R) == (side == "inner")
    ]  # fmt: skip
    if not faces:
        raise SceneError(f"maze: no ring has a face beside a ball {rho:g} m from the axis.")
    _, ring, side, R = min(faces)
    return ring, side, R


MODEL = Model(
    name="maze",
    title="Ball in a tilted maze of rings",
    parameters={name: parameter for name, parameter in PARAMETERS.items() if name not in SCENE},
    measured=(
        Coordinate(name="theta", unit="rad"), Coordinate(name="x", unit="m"), Coordinate(name="y", unit="m"),
    ),
    seen=(0, 1, 2),
    inputs=("torque",),
    build=build,
)  # fmt: skip
