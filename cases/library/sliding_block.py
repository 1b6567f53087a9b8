"""A block on a slope with friction: it sticks, slides and stops, turns, or slides downhill askew.

x points downhill; q of a block that touches at one place is where it is on the slope. `flat` is a free box
on its four lower corners.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from crossbody.cases.case import Case, Parameter, Prediction, Value
from crossbody.cases.files.case import case_of
from crossbody.cases.mechanisms.friction import blocks
from crossbody.cases.mechanisms.friction.creeps import HOLDS, STICTION, OfMixing, OfPoint, OfRegularised
from crossbody.cases.mechanisms.friction.limits import limits
from crossbody.cases.mechanisms.friction.scene import NUMBERS, block_on_floor, field, point_on_floor

PARAMETERS = {
    **NUMBERS,
    "slope": Parameter(default=0.4, doc="tangent of the floor's angle", low=0.0),
    "speed": Parameter(default=1.0, unit="m/s", doc="at the start", low=0.0),
    "angle": Parameter(default=0.0, unit="deg", doc="of the velocity, from downhill", low=-180.0, high=180.0),
    "radius": Parameter(default=0.1, unit="m", doc="of the box; also its half height", low=0.0, open_low=True),
}

VARIANTS: dict[str, dict[str, Value]] = {
    "stops": {"t_end": 1.5},
    "rests": {"speed": 0.0},
    "turns": {"mu": 0.3, "angle": 180.0},
    "askew": {"angle": 150.0, "t_end": 0.3},
    "flat": {"mu": 0.3, "slope": 0.0, "t_end": 0.6},
}

_TITLES = {
    "stops": "a block slides down a slope and stops",
    "rests": "a block is placed on a slope, and sticks",
    "turns": "a block slides up a slope, turns and slides back",
    "askew": "a block slides across a slope, turns downhill and stops",
    "flat": "a box slides on four corners and stops with all of them at once",
}


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with its exact motion."""
    p = {name: float(value) for name, value in parameters.items()}
    half = (2.0 * p["radius"], 1.5 * p["radius"], p["radius"])
    flat, th = variant == "flat", math.radians(p["angle"])
    way = p["speed"] * np.array([math.cos(th), math.sin(th)])
    if p["angle"] in (0.0, 180.0, -180.0):
        way[1] = 0.0
    made = case_of(
        block_on_floor(p, half) if flat else point_on_floor(p, p["radius"]), name="sliding_block",
        variant=variant, v0=np.concatenate([way, np.zeros(4 if flat else 1)]), t_end=p["t_end"],
        parameters=parameters,
    )  # fmt: skip
    holds = p["speed"] == 0.0 and not flat and p["mu"] > p["slope"] > 0.0
    down, _, press = field(p, p["slope"])
    creeps: dict[tuple[str, str], Prediction] = {
        ("mujoco", "default"): OfPoint(p["mu"], down / -press, -press, p["t_end"]),
        ("dart", "matched"): OfMixing(down),
        ("drake", "default"): OfRegularised(down / -press / p["mu"], "lagged", STICTION),
        ("drake", "matched"): OfRegularised(down / -press / p["mu"], "tamsi", HOLDS),
    } if holds else {}  # fmt: skip
    return limits(made, _TITLES[variant], PARAMETERS, blocks.box(p, half) if flat else blocks.point(p), p, creeps)
