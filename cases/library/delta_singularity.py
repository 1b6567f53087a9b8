"""Servos bring a delta robot to the pose where its elbows coincide; a push makes the flange swing there.

The motors no longer determine the flange: it is a spherical pendulum that no servo damps, while
the equations of motion keep their rank.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from crossbody.cases.case import Case, Claim, Parameter, Tier, Value
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.mechanisms.delta import scene as delta
from crossbody.cases.mechanisms.delta.claims import SINGULARITY
from crossbody.cases.parameters import of_numbers

PARAMETERS = {
    **delta.ROBOT,
    "start_angle": Parameter(default=math.pi / 4, unit="rad", doc="motor angles at t = 0"),
    "ramp": Parameter(default=4.0, unit="s", doc="time in which the servos move", low=0.0, open_low=True),
    "offset": Parameter(
        default=0.0, unit="rad", doc="their final position, relative to the pose with coincident elbows"
    ),
    **delta.servos(20.0, 2.0),
    "force": Parameter(default=1.0, unit="N", doc="push on the flange along x"),
    "start": Parameter(default=10.0, unit="s", doc="when it begins", low=0.0),
    "length": Parameter(default=0.05, unit="s", doc="how long it lasts", low=0.0, open_low=True),
    **delta.horizon(35.0),
}

VARIANTS: dict[str, dict[str, Value]] = {"light": {}, "heavy": {**delta.HEAVY, "kp": 300.0, "kd": 30.0}}


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene; the period of the swing is claimed where the servos end at the pose itself."""
    p = of_numbers(parameters)
    end = pose.elbow_angle(p) + p["offset"]
    pose.symmetric_pose(p, end)
    q0 = pose.symmetric_pose(p, p["start_angle"])
    swings = p["gravity"] > 0.0 and p["offset"] == 0.0 and p["ramp"] < p["start"] < p["t_end"]
    period = Claim(
        metric="swing_period", expected=pose.swing_period(p) if swings else 0.0, tier=Tier.A,
        source="small swings of the flange about coincident elbows",
    )  # fmt: skip
    return delta.scene(
        "delta_singularity", variant, f"a push at the pose where the elbows of a {variant} robot coincide",
        PARAMETERS, parameters, q0, np.zeros(9),
        inputs=delta.pulse(np.zeros(3), np.array([p["force"], 0.0, 0.0]), p["start"], p["length"]),
        claims=(period,) if swings else (), limits=SINGULARITY,
    )  # fmt: skip
