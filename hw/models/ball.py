"""A ball that bounces on a floor: its height is measured."""

from __future__ import annotations

from dataclasses import replace

from crossbody import cases
from crossbody.cases import Case, Coordinate
from crossbody.cases.library.bouncing_ball import PARAMETERS
from crossbody.hw.models.contract import Model, Numbers, Segment

SCENE = ("height", "speed", "t_end")


def build(numbers: Numbers, segment: Segment) -> Case:
    """One stretch from the measured height and speed; it has no closed form and claims nothing."""
    case = cases.load("bouncing_ball", t_end=segment.t_end, **numbers)  # type: ignore[arg-type]
    return replace(
        case, name="ball", variant="replay", q0=segment.y, v0=segment.yd, closed_form=None, claims=(), limits=()
    )


MODEL = Model(
    name="ball",
    title="Ball that bounces on a floor",
    parameters={name: parameter for name, parameter in PARAMETERS.items() if name not in SCENE},
    measured=(Coordinate(name="height", unit="m"),),
    seen=(0,),
    build=build,
    falls=0,
)
