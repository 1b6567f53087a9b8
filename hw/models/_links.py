"""A pendulum of links: viscous and smoothed dry friction in hinges, absolute angles from the upright."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from crossbody.cases import Case, Coordinate, Inputs, Law, Parameter, Value
from crossbody.cases.arrays import Floats
from crossbody.cases.case import Force
from crossbody.cases.form import Form, formed
from crossbody.cases.scene import Actuator, Body, Joint, Scene
from crossbody.hw.models.contract import Model, Numbers, Segment
from crossbody.reference.systems import link_chain

POLE = 25.0  # double pole of the joints' law, 1/s: faster than any swing, and far from stiff

_KINDS = {
    "m": ("kg", "mass", 1e-6, 1e4), "a": ("m", "pivot to centre of mass", 0.0, 1e3),
    "L": ("m", "pivot to next pivot", 0.0, 1e3), "I": ("kg m^2", "inertia about the centre of mass", 1e-12, 1e6),
    "k": ("N m s", "viscous friction of the joint", 0.0, 1e3), "s": ("N m", "dry friction of the joint", 0.0, 1e3),
}  # fmt: skip


def links(name: str, title: str, values: Mapping[str, float], count: int, restart: float) -> Model:
    """The model of a chain of so many links, with the usual time between restarts, s.

    Values not named (gravity, m1, a1, ...) are 0, the slip rate 0.01 rad/s.
    """
    own = link_chain.names(count)
    table = {
        "gravity": Parameter(default=values["gravity"], unit="m/s^2", doc="down", low=0.0, high=100.0),
        "slip": Parameter(default=0.01, unit="rad/s", doc="rate within which dry friction is smoothed", low=1e-6),
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
        form=on_hinges,
    )  # fmt: skip


def on_hinges(case: Case, powered: bool = True, steady: bool = False) -> Form:
    """Return a chain of hinges, r_0 = pi - th_0 and r_i = th_(i-1) - th_i: its links hang straight at zero.

    Hinges turn clockwise, seen with x to the right and z up, so that what turns a link forward
    turns its hinge back.
    """
    n, given = int(case.parameters["links"]), case.inputs
    dry = np.array([case.number(f"s{i + 1}") for i in range(n)])
    friction = Force(function=_dry_friction, numbers=np.append(dry, case.number("slip")))

    def to_case(r: Floats, rd: Floats) -> tuple[Floats, Floats]:
        return link_chain.place(case.parameters, np.pi - np.cumsum(r, axis=-1), -np.cumsum(rd, axis=-1))

    def to_scene(q: Floats, v: Floats) -> tuple[Floats, Floats]:
        return np.diff(-q[..., 2::3], prepend=-np.pi), np.diff(-v[..., 2::3], prepend=0.0)

    hung = _hung(case)
    inputs = given if given is None else Inputs(names=hung.inputs, times=given.times, values=given.values)
    return Form(
        case=formed(case, hung, *to_scene(case.q0, case.v0), inputs=inputs, force=friction if dry.any() else None),
        to_case=to_case, to_scene=to_scene, rows=(-1,) * len(case.contacts),
    )  # fmt: skip


def _dry_friction(_t: float, _r: Floats, rd: Floats, p: Floats, out: Floats) -> None:
    """Brake every hinge; the rate over which that is smoothed stands last."""
    for i in range(len(rd)):
        out[i] = -p[i] * rd[i] / np.sqrt(rd[i] * rd[i] + p[-1] * p[-1])


def _hung(case: Case) -> Scene:
    """Return the links on hinges, each with a motor and viscous friction."""
    names = [f"link {i + 1}" for i in range(int(case.parameters["links"]))]
    m, a, lengths, inertias, k = ([case.number(f"{key}{i + 1}") for i in range(len(names))] for key in "maLIk")
    links = zip(names, ["", *names], [0.0, *lengths], m, a, inertias, strict=False)
    return Scene(
        bodies=tuple(
            Body(name=name, parent=parent, position=(0.0, 0.0, -reach), mass=mass, com=(0.0, 0.0, -centre),
                 inertia=(inertia,) * 3 + (0.0,) * 3)
            for name, parent, reach, mass, centre, inertia in links
        ),
        joints=tuple(
            Joint(name=name, body=name, type="hinge", axis=(0.0, 1.0, 0.0), damping=(one, 0.0, 0.0))
            for name, one in zip(names, k, strict=True)
        ),
        actuators=tuple(Actuator(name=f"torque of {name}", joint=name, gear=(-1.0,)) for name in names),
        gravity=(0.0, 0.0, -case.number("gravity")),
    )  # fmt: skip
