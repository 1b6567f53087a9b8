"""A short push on the flange of a delta robot that its motors hold against gravity.

Constant torques hold the pose; a rectangular pulse J/length acts for a while. A length of 0 is
the Dirac impulse that short pulses tend to at first order.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crossbody.cases.case import Case, Parameter, Value
from crossbody.cases.errors import InvalidValue
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.mechanisms.delta import scene as delta
from crossbody.cases.mechanisms.delta.claims import IMPULSE
from crossbody.cases.parameters import of_numbers

PARAMETERS = {
    **delta.ROBOT,
    **delta.position(0.0, 0.0, 0.6),
    "jx": Parameter(default=0.06, unit="N s", doc="impulse on the flange along x"),
    "jy": Parameter(default=0.02, unit="N s", doc="impulse on the flange along y"),
    "jz": Parameter(default=-0.04, unit="N s", doc="impulse on the flange along z"),
    "start": Parameter(default=0.1, unit="s", doc="when the pulse begins", low=0.0),
    "length": Parameter(default=0.02, unit="s", doc="how long it lasts; 0 for a Dirac impulse at t = 0", low=0.0),
    **delta.servos(0.0, 0.0),
    **delta.horizon(5.0),
}

VARIANTS: dict[str, dict[str, Value]] = {
    "light": {},
    "heavy": {**delta.HEAVY, "jx": 0.8, "jy": 0.3, "jz": -0.5},
    "servos": {"kp": 20.0, "kd": 1.0, "jx": 0.4, "jy": 0.1, "jz": -0.2},
    "dirac": {"start": 0.0, "length": 0.0},
}

_TITLES = {
    "light": "a push on the flange of a light robot under constant torques",
    "heavy": "a push on the flange of a heavy robot under constant torques",
    "servos": "a strong push on the flange while servos hold the motors",
    "dirac": "the same impulse, instantaneous",
}


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene at rest in the pose of the flange, or just behind the impulse."""
    p = of_numbers(parameters)
    q0 = pose.pose(p, np.array([p["x"], p["y"], p["z"]]))
    impulse, length = np.array([p["jx"], p["jy"], p["jz"]]), p["length"]
    if length == 0.0 and p["start"] > 0.0:
        raise InvalidValue(
            f"delta_impulse: an instantaneous impulse (length 0) acts at start = 0; start is {p['start']}."
        )
    v0 = np.zeros(9) if length else pose.kicked(p, q0, impulse)
    force = impulse / length if length else impulse
    return delta.scene(
        "delta_impulse", variant, _TITLES[variant], PARAMETERS, parameters, q0, v0,
        inputs=delta.pulse(pose.holding_torque(p, q0), force, p["start"], length), limits=IMPULSE,
    )  # fmt: skip
