"""A block lies on a block on a floor; one is pushed: both rest, move together, or slide on each other.

Which of these it is follows from the push, the masses and both coefficients of friction. The pushes act at
the centres and tip nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from crossbody.cases.case import Case, Inputs, Limit, Parameter, Value
from crossbody.cases.errors import InvalidValue
from crossbody.cases.files.case import case_of
from crossbody.cases.mechanisms.friction.limits import limits
from crossbody.cases.mechanisms.friction.pairs import stack
from crossbody.cases.mechanisms.friction.scene import NUMBERS, two_blocks

PARAMETERS = {
    **NUMBERS,
    "mu": Parameter(default=0.2, doc="coefficient of friction with the floor", low=0.0, open_low=True),
    "t_end": Parameter(default=0.2, unit="s", doc="horizon", low=0.0, open_low=True),
    "high_mu": Parameter(default=0.3, doc="coefficient of friction of the blocks", low=0.0, open_low=True),
    "low_mass": Parameter(default=2.0, unit="kg", doc="of the lower block", low=0.0, open_low=True),
    "high_mass": Parameter(default=1.0, unit="kg", doc="of the upper block", low=0.0, open_low=True),
    "push_low": Parameter(default=0.0, unit="N", doc="on the lower block, along x", low=0.0),
    "push_high": Parameter(default=0.0, unit="N", doc="on the upper block, along x", low=0.0),
}

VARIANTS: dict[str, dict[str, Value]] = {
    "together": {"push_low": 9.0},
    "apart": {"push_low": 17.0},
    "top_slides": {"mu": 0.3, "high_mu": 0.5, "push_high": 7.0},
    "top_drags": {"mu": 0.1, "high_mu": 0.5, "push_high": 7.0},
}

_TITLES = {
    "together": "the lower of two blocks is pushed, and both move together",
    "apart": "the lower of two blocks is pushed away under the upper one",
    "top_slides": "the upper of two blocks is pushed, and the lower one rests",
    "top_drags": "the upper of two blocks is pushed and drags the lower one",
}


_LIMITS = (
    Limit(
        metric="event_gap", value=2.0, engine="mujoco", profile="default",
        why="a row of MuJoCo is in contact while it pushes, which may begin and end below its surface",
    ),
)  # fmt: skip


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with its exact motion."""
    p = {name: float(value) for name, value in parameters.items()}
    if p["push_low"] and p["push_high"]:
        raise InvalidValue("stacked_blocks: push_low and push_high are both given; valid: one of them.")
    scene, forces = two_blocks(p), np.zeros((1, 6))
    forces[0, [0, 3]] = p["push_low"], p["push_high"]
    made = case_of(
        scene, name="stacked_blocks", variant=variant, t_end=p["t_end"], parameters=parameters,
        inputs=Inputs(names=scene.inputs, times=np.zeros(1), values=forces),
    )  # fmt: skip
    return limits(replace(made, limits=_LIMITS), _TITLES[variant], PARAMETERS, stack(p), p)
