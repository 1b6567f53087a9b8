"""Two fingers press a weight from both sides: friction holds it, or it slips down between them.

Both fingers push with a force F; friction bears 2 mu F. Below the weight m g it falls at g - 2 mu
F/m, above it hangs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from crossbody.cases.case import Case, Inputs, Parameter, Value
from crossbody.cases.files.case import case_of
from crossbody.cases.mechanisms.friction.limits import limits
from crossbody.cases.mechanisms.friction.pairs import held
from crossbody.cases.mechanisms.friction.scene import NUMBERS, gripper

PARAMETERS = {
    **NUMBERS,
    "mu": replace(NUMBERS["mu"], open_low=False),
    "t_end": Parameter(default=0.2, unit="s", doc="horizon", low=0.0, open_low=True),
    "press": Parameter(default=12.0, unit="N", doc="force of each finger", low=0.0, open_low=True),
    "radius": Parameter(default=0.03125, unit="m", doc="of the fingers' tips", low=0.0, open_low=True),
    "stiffness": Parameter(default=0.0, unit="N/m", doc="of springs that press instead; 0 for none", low=0.0),
}

VARIANTS: dict[str, dict[str, Value]] = {
    "hangs": {}, "slips": {"press": 8.0}, "sprung": {"press": 8.0, "stiffness": 200.0, "t_end": 0.05},
    "smooth": {"press": 8.0, "stiffness": 200.0, "t_end": 0.05, "mu": 0.0},
}  # fmt: skip

_TITLES = {
    "hangs": "two fingers hold a weight by friction",
    "slips": "a weight slips down between two fingers that press too weakly",
    "smooth": "a box falls between two fingers that move symmetrically, pressed by unequal springs",
    "sprung": "a box slips down between two fingers that move symmetrically, pressed by unequal springs",
}


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with its exact motion."""
    p = {name: float(value) for name, value in parameters.items()}
    scene = gripper(p)
    forces = np.zeros((1, len(scene.inputs)))
    if scene.inputs:
        forces[0, [0, 3]] = p["press"], -p["press"]
    made = case_of(
        scene, name="held_weight", variant=variant, t_end=p["t_end"], parameters=parameters,
        inputs=Inputs(names=scene.inputs, times=np.zeros(1), values=forces) if scene.inputs else None,
    )  # fmt: skip
    return limits(made, _TITLES[variant], PARAMETERS, held(p), p)
