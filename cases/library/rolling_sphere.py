"""A homogeneous sphere is thrown along a floor: it slides, and then rolls.

The slip of its lowest point falls at 7 mu g/2 along itself, so that a sphere with a spin goes on
a parabola until it rolls, and straight from there (docs/explanation/contacts.md).
"""

from __future__ import annotations

from collections.abc import Mapping

from crossbody.cases.case import Case, Parameter, Value
from crossbody.cases.files.case import case_of
from crossbody.cases.mechanisms.friction.limits import limits
from crossbody.cases.mechanisms.friction.scene import NUMBERS, sphere_on_floor
from crossbody.cases.mechanisms.friction.spheres import sphere

PARAMETERS = {
    **NUMBERS,
    "mu": Parameter(default=0.2, doc="coefficient of friction", low=0.0, open_low=True),
    "speed": Parameter(default=2.0, unit="m/s", doc="along x at the start"),
    "spin_x": Parameter(default=0.0, unit="rad/s", doc="about x at the start"),
    "spin_y": Parameter(default=0.0, unit="rad/s", doc="about y at the start"),
    "spin_z": Parameter(default=0.0, unit="rad/s", doc="about the vertical at the start"),
    "radius": Parameter(default=0.1, unit="m", doc="of the sphere", low=0.0, open_low=True),
}

VARIANTS: dict[str, dict[str, Value]] = {
    "straight": {},
    "side_spin": {"spin_x": 3.0, "spin_y": -5.0, "spin_z": 4.0},
}

_TITLES = {
    "straight": "a sphere slides until it rolls",
    "side_spin": "a sphere with side spin goes on a parabola until it rolls",
}


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with its exact motion."""
    p = {name: float(value) for name, value in parameters.items()}
    made = case_of(
        sphere_on_floor(p), name="rolling_sphere", variant=variant, t_end=p["t_end"], parameters=parameters,
        v0=[p["speed"], 0.0, 0.0, p["spin_x"], p["spin_y"], p["spin_z"]],
    )  # fmt: skip
    return limits(made, _TITLES[variant], PARAMETERS, sphere(p), p)
