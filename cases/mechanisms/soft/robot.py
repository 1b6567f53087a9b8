"""The soft contact with the whole delta robot: its own parameters, coordinates and start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Parameter
from crossbody.cases.errors import InvalidValue
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.mechanisms.delta import scene as delta

ROBOT = {
    **delta.ROBOT,
    "p": replace(delta.ROBOT["p"], default=20.0),
    "table": Parameter(default=0.62, unit="m", doc="depth of the table"),
    "high": Parameter(default=0.58, unit="m", doc="depth of the flange at the start and at the end"),
    "low": Parameter(default=0.60, unit="m", doc="depth of the flange during the grasp"),
    "descent": Parameter(default=1.0, unit="s", doc="how long it comes down", low=0.0, open_low=True),
    "rise": Parameter(default=5.2, unit="s", doc="when it begins to rise", low=0.0),
    "rise_time": Parameter(default=1.0, unit="s", doc="how long it rises", low=0.0, open_low=True),
}
COORDINATES = (
    *((joint, "rad") for joint in delta.JOINTS),
    ("left pad", "m"), ("right pad", "m"), ("difference of the sensors", "N s"),
    ("block", "m"), ("block y", "m"), ("block z", "m"),
    *((f"integral of the error {axis}", "m s") for axis in "xyz"),
)  # fmt: skip
CONTACTS = (*delta.LOOPS, "left", "right", "table")


def check(p: Mapping[str, float]) -> None:
    """Check the flange's path.

    Raises:
        InvalidValue: if it rises before it has come down.
    """
    if p["rise"] < p["descent"]:
        raise InvalidValue(
            f"soft_contact: rise is {p['rise']:g} s; the flange comes down until descent = "
            f"{p['descent']:g} s, so it must be at least that."
        )


def start(p: Mapping[str, float]) -> Floats:
    """Positions (18,): flange high on the axis, jaws open, block on the table.

    Raises:
        InvalidValue: if the robot cannot reach both depths.
    """
    pose.pose(p, np.array([0.0, 0.0, p["low"]]))
    arms = pose.pose(p, np.array([0.0, 0.0, p["high"]]))
    half = 0.5 * p["width"]
    reach = p["jaw"] + half
    return np.concatenate([arms, [-reach, reach, 0.0], [p["offset"], 0.0, p["table"] - half], np.zeros(3)])
