"""A ball in a tilted maze of concentric rings that turns about its axis.

q = (theta, x, y, phi): angle of the maze, ball centre, angle of the ball; gravity acts along -y
(Bortoff, American Modelica Conference 2020). The torque on the maze balances the ball on a ring's
outer face, brings a gap under it, drops it to the next ring and so to the centre.

Rows, whatever the number of rings:

    0      outer face of the ring below          3      inner face of the ring above, or the wall
    1, 2   tips of the gap below, clockwise first  4, 5   tips of the gap above, clockwise first
    6      slip on row 0                         7      slip on row 3           (absent without rolling)

A row that cannot be touched where the ball is reports the wall's radius as its gap.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from crossbody.cases.case import Case, Coordinate, Law, Parameter, Value
from crossbody.cases.mechanisms.maze import geometry
from crossbody.cases.mechanisms.maze.claims import METRICS, claims, fallen, limits
from crossbody.cases.mechanisms.maze.form import in_plane


def _positive(default: float, unit: str, doc: str) -> Parameter:
    return Parameter(default=default, unit=unit, doc=doc, low=0.0, open_low=True)


PARAMETERS = {
    "tip": Parameter(default=5.0, unit="deg", doc="tilt of the maze", low=0.0, high=90.0, open_low=True),
    "gravity": _positive(9.81, "m/s^2", "gravity before the tilt"),
    "ball_radius": _positive(6.35e-3, "m", "radius of the ball"),
    "ball_mass": _positive(8.4e-3, "kg", "mass of the ball, solid"),
    **geometry.parameters(),
    "maze_inertia": _positive(1e-3, "kg m^2", "of the maze; 1e6 locks it"),
    "a0": Parameter(default=1e6, unit="1/s^2", doc="stiffness of faces and tips over the mass", low=0.0),
    "a1": Parameter(default=2000.0, unit="1/s", doc="damping of faces and tips over the mass", low=0.0),
    "a1_slip": Parameter(default=1000.0, unit="1/s", doc="rate at which slip on a face decays", low=0.0),
    "rolling": Parameter(default=True, doc="whether the ball rolls on faces; 0 for frictionless", low=0, high=1),
    "rolling_damping": Parameter(default=0.0, unit="N m s", doc=("torque on a touching ball divided by "
        "its spin"), low=0.0),
    "controller": Parameter(default="off", doc="torque on the maze", choices=("off", "continuous", "sampled")),
    "pole": _positive(5.0, "1/s", "triple pole of the balance"),
    "omega": Parameter(default=0.06, unit="rad/s", doc="rate of the maze while it balances"),
    "wn": _positive(40.0, "rad/s", "natural frequency of the snatch"),
    "centre_pole": _positive(4.0, "1/s", "third pole in the centre"),
    "a_max": Parameter(default=100.0, unit="rad/s^2", doc="bound on the acceleration of the maze; 0 for none", low=0.0),
    "u_max": Parameter(default=0.1, unit="N m", doc="bound on the torque; 0 for none", low=0.0),
    "model_gravity": _positive(1.0, "", "gravity in the controller's model over the true one"),
    "model_mass": _positive(1.0, "", "ball mass in the controller's model over the true one"),
    "model_inertia": _positive(1.0, "", "maze inertia in the controller's model over the true one"),
    "sample": _positive(1e-3, "s", "period of the sampled controller"),
    "delay": Parameter(default=1, doc="whole samples between a reading and its torque", low=0, high=100),
    "noise": Parameter(default=0.0, unit="m", doc="deviation of the readings of x and y, if sampled", low=0.0),
    "noise_speed": Parameter(default=0.0, unit="m/s", doc="deviation of the readings of x' and y'", low=0.0),
    "seed": Parameter(default=0, doc="of the noise", low=0, high=2**31),
    "ring": Parameter(default=3, doc="ring on whose face the ball starts", low=0, high=1e4),
    "side": Parameter(default="outer", doc="on top of the ring, or inside at the bottom", choices=("outer", "inner")),
    "angle": Parameter(default=0.0, unit="rad", doc="start from there towards +x"),
    "theta": Parameter(default=0.0, unit="rad", doc="initial angle of the maze"),
    "t_end": _positive(75.0, "s", "horizon"),
}  # fmt: skip

TIGHT = 1e-11
"""Tolerance of the truth: a0 times the rounding of a settled position counts before 1e-13."""
LOCKED = 1e6  # inertia of a locked maze, kg m^2: it turns by less than 1e-9 rad/s^2

VARIANTS: dict[str, dict[str, Value]] = {
    "inside": {"maze_inertia": LOCKED, "side": "inner", "angle": 1e-3, "t_end": 10.0},
    "outside": {"maze_inertia": LOCKED, "angle": 1e-3, "theta": math.pi / 3.0, "t_end": 3.5},
    "free": {"ring": 0, "side": "inner", "angle": 1.0, "theta": -math.pi / 2.0, "t_end": 10.0},
    "balanced": {"controller": "continuous", "omega": 0.0, "angle": 0.01, "t_end": 3.0},
    "solve": {"controller": "continuous"},
}

_TITLES = {
    "inside": "a ball rolls back and forth inside a locked ring",
    "outside": "a ball rolls off the top of a locked ring",
    "free": "a ball swings inside a ring and turns the maze",
    "balanced": "feedback balances the ball on top of a ring",
    "solve": "in closed loop from the outer channel to the centre",
}
_NAMES = (
    "face below", "tip below -", "tip below +", "face above", "tip above -", "tip above +",
    "slip below", "slip above",
)  # fmt: skip
NORMAL = 6  # number of normal rows; slip rows follow them
DISCRETE = ("channel", "sector below", "sector above", "controller")
"""Channel i lies outside ring i - 1; a sector is the number of a gap, or -1 on solid wall; modes
of the controller are 0 off, 1 balance, 2 snatch, 3 centre."""
_COORDINATES = (("maze", "rad"), ("x", "m"), ("y", "m"), ("ball", "rad"))


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene at rest on a face."""
    p = parameters
    maze = geometry.maze_of(p)
    x, y = geometry.start(maze, p)
    slip = 2 if p["rolling"] else 0
    claimed = claims(variant, p, maze)
    rows = NORMAL + slip
    return Case(
        name="ball_maze",
        variant=variant,
        title=_TITLES[variant],
        mechanism="maze",
        parameters=parameters,
        coordinates=tuple(Coordinate(name=name, unit=unit) for name, unit in _COORDINATES),
        contacts=_NAMES[:rows],
        q0=np.array([float(p["theta"]), x, y, 0.0]),
        v0=np.zeros(4),
        t_end=float(p["t_end"]),
        law=Law(
            a0=np.repeat([float(p["a0"]), 0.0], [NORMAL, slip]),
            a1=np.repeat([float(p["a1"]), float(p["a1_slip"])], [NORMAL, slip]),
            a2=np.zeros(rows),
            unilateral=np.arange(rows) < NORMAL,
        ),
        form=in_plane,
        claims=claimed,
        metrics=METRICS,
        limits=limits(claimed, fallen(p, maze)),
        discrete=DISCRETE,
        tight=TIGHT,
        units={k: parameter.unit for k, parameter in PARAMETERS.items()},
    )
