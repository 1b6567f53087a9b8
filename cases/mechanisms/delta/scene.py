"""What the cases of the delta robot share: its numbers, names, and the closures' law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case, Coordinate, Inputs, Law, Parameter, Value
from crossbody.cases.mechanisms.delta.claims import FOLLOWING, METRICS
from crossbody.cases.mechanisms.delta.form import in_tree

ROBOT = {
    "r_base": Parameter(default=0.125, unit="m", doc="radius of the hinges on the base", low=0.0),
    "r_flange": Parameter(default=0.03, unit="m", doc="radius of the hinges on the flange", low=0.0),
    "l1": Parameter(default=0.35, unit="m", doc="length of a proximal link", low=0.0, open_low=True),
    "l2": Parameter(default=0.50, unit="m", doc="length of a distal link", low=0.0, open_low=True),
    "m1": Parameter(default=0.20, unit="kg", doc="mass of a proximal link", low=0.0),
    "m2": Parameter(default=0.20, unit="kg", doc="mass of a pair of distal rods", low=0.0),
    "m3": Parameter(default=0.30, unit="kg", doc="mass of the flange", low=0.0),
    "jm": Parameter(default=0.0, unit="kg m^2", doc="inertia of a rotor", low=0.0),
    "gravity": Parameter(default=9.81, unit="m/s^2", doc="along +z, which points down", low=0.0),
    "d1": Parameter(default=0.05, unit="N m s", doc="viscous friction on q_i1", low=0.0),
    "d2": Parameter(default=0.0125, unit="N m s", doc="viscous friction on q_i2", low=0.0),
    "d3": Parameter(default=0.0125, unit="N m s", doc="viscous friction on q_i3", low=0.0),
    "sign": Parameter(default=1.0, doc="arms 2 and 3 are at -120 and +120 degrees times this, 1 or -1"),
    "p": Parameter(default=5.0, unit="1/s", doc="double pole of the closures", low=0.0),
}
HEAVY: dict[str, Value] = {"m1": 2.5, "m2": 3.0, "m3": 4.0, "gravity": 9.8, "d1": 0.5, "d2": 0.125, "d3": 0.125}
NAMES = ("torque 1 [N m]", "torque 2 [N m]", "torque 3 [N m]", "force x [N]", "force y [N]", "force z [N]")
JOINTS = tuple(f"q{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
LOOPS = tuple(f"loop {i}{axis}" for i in (2, 3) for axis in "xyz")


def position(x: float, y: float, z: float) -> dict[str, Parameter]:
    """The flange at t = 0 as parameters, m."""
    place = {"x": x, "y": y, "z": z}
    return {k: Parameter(default=v, unit="m", doc=f"{k} of the flange at t = 0") for k, v in place.items()}


def servos(kp: float, kd: float) -> dict[str, Parameter]:
    """PD servos on the motors as parameters."""
    return {
        "kp": Parameter(default=kp, unit="N m/rad", doc="stiffness of the servos", low=0.0),
        "kd": Parameter(default=kd, unit="N m s/rad", doc="damping of the servos", low=0.0),
    }


def horizon(t_end: float) -> dict[str, Parameter]:
    """The horizon as a parameter."""
    return {"t_end": Parameter(default=t_end, unit="s", doc="horizon", low=0.0, open_low=True)}


def scene(
    name: str, variant: str, title: str, table: Mapping[str, Parameter], parameters: Mapping[str, Value],
    q0: Floats, v0: Floats, **more: Any,
) -> Case:  # fmt: skip
    """A case of the robot with its loops closed by h'' + 2 p h' + p^2 h = 0."""
    p = float(parameters["p"])
    law = Law(a0=np.full(6, p * p), a1=np.full(6, 2.0 * p), a2=np.zeros(6), unilateral=np.zeros(6, dtype=np.bool_))
    return Case(
        name=name,
        variant=variant,
        title=title,
        mechanism="delta",
        parameters=parameters,
        coordinates=tuple(Coordinate(name=joint, unit="rad") for joint in JOINTS),
        contacts=LOOPS,
        q0=q0,
        v0=v0,
        t_end=float(parameters["t_end"]),
        law=law,
        form=in_tree,
        metrics={**METRICS, **(FOLLOWING if "period" in parameters else {})},
        units={k: parameter.unit for k, parameter in table.items()},
        **more,
    )


def pulse(torque: Floats, force: Floats, start: float, length: float) -> Inputs:
    """Constant torques (3,), N m, and on top of them a force (3,), N, on the flange for a while."""
    rest, push = np.concatenate([torque, np.zeros(3)]), np.concatenate([torque, force])
    if length == 0.0:
        return Inputs(names=NAMES, times=np.zeros(1), values=rest[None])
    times, values = [start, start + length], [push, rest]
    if start > 0.0:
        times, values = [0.0, *times], [rest, *values]
    return Inputs(names=NAMES, times=np.array(times), values=np.array(values))
