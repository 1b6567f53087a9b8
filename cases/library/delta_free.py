"""A delta robot released at rest, lightly damped: it falls through the pose where its elbows come together.

Past it small differences grow: without friction the motion is compared only as far as two integrators agree.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crossbody.cases.case import Case, Chaos, Value
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.mechanisms.delta import scene as delta
from crossbody.cases.mechanisms.delta.claims import FREE
from crossbody.cases.parameters import of_numbers

PARAMETERS = {**delta.ROBOT, **delta.position(0.05, 0.02, 0.5), **delta.horizon(2.5)}

VARIANTS: dict[str, dict[str, Value]] = {
    "light": {},
    "heavy": dict(delta.HEAVY),
    "undamped": {"d1": 0.0, "d2": 0.0, "d3": 0.0, "t_end": 5.0},
}

_TITLES = {
    "light": "a light robot released at rest",
    "heavy": "a heavy robot released at rest",
    "undamped": "a robot without friction released at rest",
}


FALLS = 2.5
"""What the limits count on: within so many seconds a fall makes differences grow 2,000 times at most, s."""
CHAOS = Chaos(until=2.0, why="the robot folds through coincident elbows repeatedly, without damping")
FOLDS_ON = Chaos(until=FALLS, why="differences grow every time the robot folds through coincident elbows")


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene: closed, at rest, no torque."""
    p = of_numbers(parameters)
    q0 = pose.pose(p, np.array([p["x"], p["y"], p["z"]]))
    longer = FOLDS_ON if p["t_end"] > FALLS else None
    return delta.scene(
        "delta_free", variant, _TITLES[variant], PARAMETERS, parameters, q0, np.zeros(9), limits=FREE,
        chaos=CHAOS if variant == "undamped" else longer,
    )  # fmt: skip
