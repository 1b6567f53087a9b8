"""A block between two soft fingers: the robot feels its position and moves to it, or pushes it.

Two pads with mass, stiffness and damping close on a block that rests off the middle; touch sensors on both
sides move the reference of the flange, x_ref' = k* (y_R - y_L), in contact and out of it alike (Bortoff,
Modeling Contact and Collisions for Robotic Assembly Control, American Modelica Conference 2020).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crossbody.cases.case import Case, Parameter, Value
from crossbody.cases.errors import InvalidValue
from crossbody.cases.mechanisms.soft import robot_form
from crossbody.cases.mechanisms.soft import scene as soft
from crossbody.cases.mechanisms.soft.claims import METRICS, claims, limits
from crossbody.cases.mechanisms.soft.form import on_axis
from crossbody.cases.mechanisms.soft.robot_form import on_robot

PARAMETERS = {
    **soft.FINGERS,
    **soft.AXIS,
    **robot_form.ROBOT,
    "t_end": Parameter(default=5.0, unit="s", doc="horizon", low=0.0, open_low=True),
}

VARIANTS: dict[str, dict[str, Value]] = {"axis": {}, "delta": {"release": 4.2, "t_end": 6.5}}

_FOREIGN = {"axis": robot_form.ROBOT, "delta": soft.AXIS}
_TITLES = {
    "axis": "soft fingers close on a block that is off centre",
    "delta": "a delta robot descends, grasps a block softly, releases it and rises",
}
_COORDINATES = {"axis": soft.COORDINATES, "delta": robot_form.COORDINATES}


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with the jaws open and everything at rest."""
    p = soft.numbers(parameters)
    soft.check(p)
    _check_names(variant, parameters)
    if whole := variant == "delta":
        robot_form.check(p)
    q0 = robot_form.start(p) if whole else soft.start(p)
    claimed = claims(variant, parameters, PARAMETERS, VARIANTS[variant])
    return Case(
        name="soft_contact",
        variant=variant,
        title=_TITLES[variant],
        mechanism="soft_delta" if whole else "soft_contact",
        parameters=parameters,
        coordinates=tuple(soft.coordinate(p, name, unit) for name, unit in _COORDINATES[variant]),
        contacts=robot_form.CONTACTS if whole else ("left", "right"),
        q0=q0,
        v0=np.zeros(len(q0)),
        t_end=p["t_end"],
        form=on_robot if whole else on_axis,
        law=soft.contact_law(p, *((6, 3) if whole else ())),
        collisions="resolved",
        tight=1e-11 if whole else 1e-12,
        claims=claimed,
        metrics=METRICS,
        limits=limits(variant, claimed, p),
        units={k: parameter.unit for k, parameter in PARAMETERS.items()},
    )


def _check_names(variant: str, parameters: Mapping[str, Value]) -> None:
    """A parameter of the other variant would be ignored."""
    for name, parameter in _FOREIGN[variant].items():
        if parameters[name] != parameter.default:
            other = next(v for v in VARIANTS if v != variant)
            raise InvalidValue(f"soft_contact:{variant}: {name} has no effect here; it belongs to variant {other}.")
