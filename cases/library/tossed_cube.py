"""A cube is tossed onto a table: its eight corners touch with friction, slide, stick and lift again.

By default that of ContactNets (Pfrommer et al. 2020): 0.1048 m, 0.37 kg, coefficient of friction
0.18. A row is hit with the restitution of its law's constants, and pushes for some milliseconds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from crossbody.cases.case import Case, Parameter, Value
from crossbody.cases.files.case import case_of
from crossbody.cases.library.rolling_sphere import turned
from crossbody.cases.mechanisms.friction.limits import limits
from crossbody.cases.mechanisms.friction.scene import NUMBERS, tossed_cube

PARAMETERS = {
    **NUMBERS,
    "mu": Parameter(default=0.18, doc="coefficient of friction", low=0.0, open_low=True),
    "a0": replace(NUMBERS["a0"], default=1e5),
    "a1": replace(NUMBERS["a1"], default=640.0),
    "t_end": Parameter(default=0.6, unit="s", doc="horizon", low=0.0, open_low=True),
    "side": Parameter(default=0.1048, unit="m", doc="of the cube", low=0.0, open_low=True),
    "mass": Parameter(default=0.37, unit="kg", doc="of the cube", low=0.0, open_low=True),
    "inertia": Parameter(default=0.00081, unit="kg m^2", doc="moment of inertia", low=0.0, open_low=True),
    "off": Parameter(default=0.0, unit="m", doc="offset of the centre of mass from the middle, along x of the cube"),
    "height": Parameter(default=0.15, unit="m", doc="height of the middle at the start", low=0.0, open_low=True),
}

VARIANTS: dict[str, dict[str, Value]] = {"slides": {}, "tumbles": {"mu": 0.6}, "loaded": {"off": 0.02, "t_end": 0.3}}

_TITLES = {
    "slides": "a cube is tossed onto a table and slides on it",
    "tumbles": "a cube is tossed onto a table and rolls over its edges",
    "loaded": "a cube with an off-centre mass is tossed onto a table",
}
TURNED = np.array([[0.4, -0.3, 0.2]])  # rotation vector at the start, rad
THROWN = (0.8, -0.3, 0.0, 3.0, 2.0, -1.0)  # velocities at the start, m/s and rad/s


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene; its motion has no closed form."""
    p = {name: float(value) for name, value in parameters.items()}
    made = case_of(
        tossed_cube(p), name="tossed_cube", variant=variant, t_end=p["t_end"], parameters=parameters,
        q0=[0.0, 0.0, p["height"], *turned(TURNED)[0]], v0=THROWN,
    )  # fmt: skip
    return limits(made, _TITLES[variant], PARAMETERS, None, p)
