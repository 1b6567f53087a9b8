"""The flange of a delta robot follows a circle under sampled control with delay and encoder quantisation.

Every `period` the controller reads the motor angles, rounded to the encoder's counts, and sets
the torques that take effect `delay` samples later.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from crossbody.cases.case import Case, Claim, Parameter, Tier, Value
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.mechanisms.delta import scene as delta
from crossbody.cases.mechanisms.delta.claims import on_the_circle, tracking
from crossbody.cases.parameters import of_numbers

PARAMETERS = {
    **delta.ROBOT,
    **delta.position(0.0, 0.0, 0.6),
    "radius": Parameter(default=0.05, unit="m", doc="radius of the circle", low=0.0, open_low=True),
    "frequency": Parameter(default=1.0, unit="Hz", doc="turns a second", low=0.0, open_low=True),
    "fade": Parameter(default=0.5, unit="s", doc="time in which the radius grows", low=0.0, open_low=True),
    "controller": Parameter(
        default="linearising", doc="on the flange, or PD on the motors", choices=("linearising", "pd")
    ),
    "mass_matrix": Parameter(
        default="exact", doc="mass seen by the motors; approximate leaves out the reflected constraint force",
        choices=("exact", "approximate"),
    ),
    "kp": Parameter(default=147.0, doc="1/s^2, or N m/rad for pd"),
    "kd": Parameter(default=21.0, doc="1/s, or N m s/rad for pd"),
    "ki": Parameter(default=343.0, doc="1/s^3; not used by pd"),
    "clamp": Parameter(default=1.0, unit="m s", doc="bound on the integral of the error", low=0.0, open_low=True),
    "period": Parameter(default=0.88e-3, unit="s", doc="sample time", low=0.0, open_low=True),
    "delay": Parameter(default=1, doc="whole samples between a reading and its torque", low=0, high=1000),
    "bits": Parameter(default=18, doc="counts per motor turn are 2^bits", low=1, high=52),
    "limit": Parameter(default=0.0, unit="N m", doc="bound on each torque; 0 for none", low=0.0),
    **delta.horizon(1.0),
}  # fmt: skip

VARIANTS: dict[str, dict[str, Value]] = {
    "circle": {},
    "pd": {"controller": "pd", "kp": 1.0, "kd": 0.25, "ki": 0.0, "limit": 2.4, "t_end": 0.5},
}

_TITLES = {
    "circle": "a light robot follows a circle with the encoder of the rig",
    "pd": "early PD control of the motors with gravity compensation and bounded torques",
}


SETTLED = 4.0  # horizon from which on the last third of a run shows the circle alone, s


def _lag(p: Mapping[str, float]) -> float:
    """Radius by which sampling and delay miss a steady circle, m: |s A/(s^3 + kd s^2 + kp s + ki)| at s = i w.

    The acceleration R w^2 is commanded delay + 1/2 periods late, and damped by a rate that is
    half a period old: two errors A at right angles to each other.
    """
    w = 2.0 * math.pi * p["frequency"]
    acceleration = p["radius"] * w * w
    late, old = w * (p["delay"] + 0.5) * p["period"], 0.5 * p["kd"] * p["period"]
    s = 1j * w
    return acceleration * math.hypot(late, old) * w / abs(s**3 + p["kd"] * s**2 + p["kp"] * s + p["ki"])


def _claims(variant: str, parameters: Mapping[str, Value]) -> tuple[Claim, ...]:
    """What sampling and delay leave of the error on the default circle."""
    preset = {k: VARIANTS[variant].get(k, parameter.default) for k, parameter in PARAMETERS.items()}
    shown = float(parameters["t_end"]) >= float(preset["t_end"])
    if variant == "pd" or not shown or dict(parameters) != preset | {"t_end": parameters["t_end"]}:
        return ()
    source = "the lag of sampling and delay; about 0.1 mm as published"
    return (Claim(metric="tracking_error", expected=_lag(of_numbers(parameters)), tier=Tier.A, source=source),)


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene: at rest in the middle of the circle."""
    p, claims = of_numbers(parameters), _claims(variant, parameters)
    settled, grown = p["t_end"] >= SETTLED, min(p["t_end"] / p["fade"], 1.0) ** 3
    q0 = pose.pose(p, np.array([p["x"], p["y"], p["z"]]))
    return delta.scene(
        "delta_tracking", variant, _TITLES[variant], PARAMETERS, parameters, q0, np.zeros(9),
        claims=claims, controls=delta.NAMES,
        limits=(*tracking(grown), *(on_the_circle(claim.expected, settled) for claim in claims)),
    )  # fmt: skip
