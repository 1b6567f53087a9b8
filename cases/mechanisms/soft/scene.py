"""What both variants of the soft contact share: parameters, law, and what must hold before anything runs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Coordinate, Law, Parameter, Value
from crossbody.cases.errors import InvalidValue, SceneError
from crossbody.cases.parameters import of_numbers

FINGERS = {
    "kstar": Parameter(default=20.0, unit="cm/(s N)", doc="gain of the tactile loop: x_ref' = k* (y_R - y_L)", low=0.0),
    "ks": Parameter(default=100.0, unit="rad/s", doc="bandwidth of the touch sensors", low=0.0, open_low=True),
    "offset": Parameter(default=8e-3, unit="m", doc="initial offset of the block from the middle of the fingers"),
    "block_mass": Parameter(default=0.1, unit="kg", doc="mass of the block", low=0.0, open_low=True),
    "width": Parameter(default=0.04, unit="m", doc="width of the block", low=0.0, open_low=True),
    "bt": Parameter(default=20.0, unit="N s/m", doc="viscous friction of the block on the table", low=0.0),
    "kp": Parameter(default=2e4, unit="N/m", doc="stiffness of a pad", low=0.0, open_low=True),
    "cp": Parameter(default=30.0, unit="N s/m", doc="damping of a pad", low=0.0),
    "pad_mass": Parameter(default=0.01, unit="kg", doc="mass of a pad", low=0.0, open_low=True),
    "a0": Parameter(default=1e4, unit="1/s^2", doc="stiffness of the contacts' law", low=0.0),
    "a1": Parameter(default=200.0, unit="1/s", doc="damping of the contacts' law", low=0.0),
    "gain_p": Parameter(default=147.0, unit="1/s^2", doc="proportional gain of the flange's loop", low=0.0),
    "gain_d": Parameter(default=21.0, unit="1/s", doc="derivative gain of the flange's loop", low=0.0),
    "gain_i": Parameter(default=343.0, unit="1/s^3", doc="integral gain of the flange's loop", low=0.0),
    "jaw": Parameter(default=12e-3, unit="m", doc="free space on each side of a centred block", low=0.0),
    "squeeze": Parameter(default=1e-4, unit="m", doc="interference on each side once closed", low=0.0),
    "close_start": Parameter(default=1.0, unit="s", doc="time at which the jaws begin to close", low=0.0),
    "close_end": Parameter(default=3.0, unit="s", doc="when they are closed", low=0.0, open_low=True),
    "release": Parameter(default=0.0, unit="s", doc="time at which they begin to open; 0 for never", low=0.0),
    "release_time": Parameter(default=1.0, unit="s", doc="how long they open", low=0.0, open_low=True),
}
AXIS = {
    "flange_mass": Parameter(default=0.7, unit="kg", doc="mass of the flange", low=0.0, open_low=True),
    "rate_share": Parameter(
        default=1.0, doc="share of x_ref' in the derivative term; 0 for the measured velocity alone", low=0.0, high=1.0
    ),
    "probe": Parameter(default=0.0, unit="m/s", doc="amplitude of a sinusoidal velocity of both fingers"),
    "probe_rate": Parameter(default=0.0, unit="rad/s", doc="its angular frequency", low=0.0),
}


COORDINATES = (
    ("flange", "m"), ("left pad", "m"), ("right pad", "m"), ("block", "m"), ("integral of the error", "m s"),
    ("left sensor", "N s"), ("right sensor", "N s"), ("shift of the fingers", "m s"),
)  # fmt: skip


_FELT = 0.05
"""Part of the squeeze's force from which on a sensor feels: errors of 1e-12 m in a pad are 2e-8 N."""


def coordinate(p: Mapping[str, float], name: str, unit: str) -> Coordinate:
    """A coordinate of either variant: sensors carry momenta; the jaws set the pace."""
    if unit == "N s":
        force = _FELT * p["kp"] * p["squeeze"]
        return Coordinate(name=name, unit=unit, size=force / p["ks"], rate=force)
    closing = (p["jaw"] + p["squeeze"]) / (p["close_end"] - p["close_start"]) if unit == "m" else 0.0
    return Coordinate(name=name, unit=unit, rate=closing)


def numbers(parameters: Mapping[str, Value]) -> dict[str, float]:
    """The parameters as numbers, with k in (m/s)/N beside k* in cm/(s N)."""
    found = of_numbers(parameters)
    return found | {"k": 0.01 * found["kstar"]}


def check(p: Mapping[str, float]) -> None:
    """Check what single bounds cannot."""
    if not p["close_end"] > p["close_start"]:
        raise InvalidValue(
            f"soft_contact: close_end is {p['close_end']:g} s; the jaws begin to close at "
            f"{p['close_start']:g} s, so it must be later."
        )
    if p["release"] and p["release"] < p["close_end"]:
        raise InvalidValue(
            f"soft_contact: release is {p['release']:g} s; valid: 0 for never, or from close_end = "
            f"{p['close_end']:g} s on."
        )
    if abs(p["offset"]) > p["jaw"]:
        raise SceneError(
            f"soft_contact: a finger starts {abs(p['offset']) - p['jaw']:g} m inside the block; "
            f"|offset| must be at most jaw = {p['jaw']:g} m."
        )


def contact_law(p: Mapping[str, float], loops: int = 0, rows: int = 2) -> Law:
    """The law of the contacts, behind closed loops with a double pole p if there are any."""
    a0 = np.concatenate([np.full(loops, p.get("p", 0.0) ** 2), np.full(rows, p["a0"])])
    a1 = np.concatenate([np.full(loops, 2.0 * p.get("p", 0.0)), np.full(rows, p["a1"])])
    return Law(a0=a0, a1=a1, a2=np.zeros(loops + rows), unilateral=np.arange(loops + rows) >= loops)


def start(p: Mapping[str, float]) -> Floats:
    """Positions (8,) on the axis: flange at 0, jaws open."""
    reach = p["jaw"] + 0.5 * p["width"]
    return np.array([0.0, -reach, reach, p["offset"], 0.0, 0.0, 0.0, 0.0])
