"""A mass on a spring whose guide has dry friction: each half swing is shorter by the same; it stops off the middle.

How far off depends on where it began; within reach of the spring's rest friction holds it for good.
"""

from __future__ import annotations

from collections.abc import Mapping

from crossbody.cases.case import Case, Parameter, Value
from crossbody.cases.files.case import case_of
from crossbody.cases.mechanisms.friction.creep import Soft
from crossbody.cases.mechanisms.friction.limits import limits
from crossbody.cases.mechanisms.friction.oscillator import creep, oscillator
from crossbody.cases.scene import Body, Joint, RowLaw, Scene

PARAMETERS = {
    "mass": Parameter(default=2.0, unit="kg", doc="of the body", low=0.0, open_low=True),
    "stiffness": Parameter(default=50.0, unit="N/m", doc="of the spring", low=0.0),
    "friction_loss": Parameter(default=1.0, unit="N", doc="bound of the guide's friction", low=0.0, open_low=True),
    "start": Parameter(default=0.17, unit="m", doc="from the spring's rest"),
    "speed": Parameter(default=0.0, unit="m/s", doc="at the start"),
    "a1": Parameter(default=100.0, unit="1/s", doc="rate at which a slip decays that friction holds", low=0.0),
    "t_end": Parameter(default=4.0, unit="s", doc="horizon", low=0.0, open_low=True),
}

VARIANTS: dict[str, dict[str, Value]] = {
    "swings": {},
    "stops": {"stiffness": 0.0, "start": 0.0, "speed": 0.8},
    "holds": {"start": 0.015, "t_end": 1.0},
}

_TITLES = {
    "swings": "a mass on a spring swings in a guide with dry friction until that holds it",
    "stops": "a body slides in a guide with dry friction and stops",
    "holds": "dry friction holds a spring that pulls",
}


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with its exact motion."""
    p = {name: float(value) for name, value in parameters.items()}
    guide = Joint(
        name="guide", body="mass", type="slide", axis=(1.0, 0.0, 0.0), stiffness=(p["stiffness"], 0.0, 0.0),
        friction_loss=p["friction_loss"], law=RowLaw(a0=0.25 * p["a1"] ** 2, a1=p["a1"]),
    )  # fmt: skip
    scene = Scene(bodies=(Body(name="mass", mass=p["mass"]),), joints=(guide,), gravity=(0.0, 0.0, 0.0))
    made = case_of(scene, name="dry_oscillator", variant=variant, q0=[p["start"]], v0=[p["speed"]], t_end=p["t_end"],
                   parameters=parameters)  # fmt: skip
    holds = p["speed"] == 0.0 and 0.0 < abs(p["stiffness"] * p["start"]) < p["friction_loss"]
    return limits(
        made, _TITLES[variant], PARAMETERS, oscillator(p), p, {("mujoco", "default"): creep(p, Soft())} if holds else {}
    )
