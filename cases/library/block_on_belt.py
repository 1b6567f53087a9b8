"""A block on a spring is dragged along by a belt: it sticks once, then slides in a sine that grazes the belt's speed.

With one coefficient for sticking and sliding there is no cycle of stick and slip, and at the
instants at which the block is as fast as the belt it must not stick (docs/explanation/contacts.md).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crossbody.cases.case import Case, Inputs, Parameter, Value
from crossbody.cases.files.case import case_of
from crossbody.cases.mechanisms.friction.limits import limits
from crossbody.cases.mechanisms.friction.pairs import belt
from crossbody.cases.mechanisms.friction.scene import NUMBERS, block_on_belt

PARAMETERS = {
    **NUMBERS,
    "mu": Parameter(default=0.3, doc="coefficient of friction", low=0.0, open_low=True),
    "t_end": Parameter(default=2.0, unit="s", doc="horizon", low=0.0, open_low=True),
    "speed": Parameter(default=0.1, unit="m/s", doc="of the belt", low=0.0, open_low=True),
    "stiffness": Parameter(default=100.0, unit="N/m", doc="of the spring", low=0.0, open_low=True),
    "radius": Parameter(default=0.1, unit="m", doc="of what touches", low=0.0, open_low=True),
}

VARIANTS: dict[str, dict[str, Value]] = {"grazes": {}}


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with its exact motion."""
    p = {name: float(value) for name, value in parameters.items()}
    scene, V = block_on_belt(p), p["speed"]
    back = Inputs(names=scene.inputs, times=np.zeros(1), values=np.array([[-V]]))
    made = case_of(scene, name="block_on_belt", variant=variant, v0=[-V, 0.0], t_end=p["t_end"], inputs=back,
                   parameters=parameters)  # fmt: skip
    return limits(made, "a block on a spring sticks to a belt once", PARAMETERS, belt(p), p)
