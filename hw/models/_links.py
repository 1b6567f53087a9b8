"""A pendulum of links: hinges with viscous and smoothed dry friction, absolute angles from the upright vertical."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from crossbody.cases import Case, Coordinate, Inputs, Law, Parameter, Value
from crossbody.hw.models._contract import Model, Numbers, Segment
from crossbody.reference.systems import link_chain

POLE = 25.0
"""Double pole of the joints' law, 1/s: faster than any swing, and far from stiff."""

_KINDS = {
    "m": ("kg", "mass", 1e-6, 1e4), "a": ("m", "pivot to centre of mass", 0.0, 1e3),
    "L": ("m", "pivot to next pivot", 0.0, 1e3), "I": ("kg m^2", "inertia about the centre of mass", 1e-12, 1e6),
    "k": ("N m s", "viscous friction of the joint", 0.0, 1e3), "s": ("N m", "dry friction of the joint", 0.0, 1e3),
}  # fmt: skip


def links(name: str, title: str, values: Mapping[str, float], count: int, restart: float) -> Model:
    """The model of a chain.

    Args:
        name: of the model.
        title: it in words.
        values: defaults by name (gravity, m1, a1, ...); what is not named is 0, or the slip rate 0.01 rad/s.
        count: number of links.
        restart: usual time between restarts, s.
    """
    own = link_chain.names(count)
    table = {
        "gravity": Parameter(default=values["gravity"], unit="m/s^2", doc="down", low=0.0, high=100.0),
        "slip": Parameter(default=0.01, unit="rad/s", doc="rate over which dry friction is smoothed", low=1e-6),
        **{key: _parameter(key, values.get(key, 0.0)) for key in own[2:]},
    }
    angles = tuple(Coordinate(name=f"th{i + 1}", unit="rad") for i in range(count))

    def build(numbers: Numbers, segment: Segment) -> Case:
        return scene(name, title, count, numbers, segment)

    return Model(
        name=name, title=title, parameters=table, measured=angles, seen=tuple(range(2, 3 * count, 3)),
        inputs=tuple(f"torque {i + 1}" for i in range(count)), build=build, restart=restart,
        places=MappingProxyType({key: i for i, key in enumerate(own)}),
    )  # fmt: skip


def _parameter(key: str, value: float) -> Parameter:
    unit, doc, low, high = _KINDS[key[0]]
    return Parameter(default=value, unit=unit, doc=f"{doc}, link {key[1:]}", low=low, high=high)


def scene(name: str, title: str, count: int, numbers: Numbers, segment: Segment) -> Case:
    """One stretch as a case: a closed chain at the measured angles and rates."""
    parameters: dict[str, Value] = {"links": count, **numbers}
    q0, v0 = link_chain.place(parameters, segment.y, segment.yd)
    rows = 2 * count
    inputs = None
    if len(segment.times):
        names = tuple(f"torque {i + 1} [N m]" for i in range(count))
        inputs = Inputs(names=names, times=segment.times, values=segment.inputs)
    return Case(
        name=name, variant="replay", title=title, mechanism="link_chain", parameters=parameters,
        coordinates=tuple(
            Coordinate(name=f"{axis}{i + 1}", unit=unit)
            for i in range(count) for axis, unit in (("x", "m"), ("z", "m"), ("th", "rad"))
        ),
        contacts=tuple(f"joint {i + 1}{axis}" for i in range(count) for axis in "xz"), q0=q0, v0=v0,
        t_end=segment.t_end, inputs=inputs,
        law=Law(
            a0=np.full(rows, POLE**2), a1=np.full(rows, 2.0 * POLE), a2=np.zeros(rows),
            unilateral=np.zeros(rows, np.bool_),
        ),
    )  # fmt: skip
