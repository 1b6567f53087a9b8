"""A box falls on a slab on two feet: one corner is caught and softened, then released by the impact of the other.

Five constraints between two bodies in a plane, two sets of constants (Bortoff, American Modelica
Conference 2020): the left corner collides, is handed over to slow CONTACT constants, and is
released while the right one collides.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from crossbody.cases import closed_forms as cf
from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case, Claim, Coordinate, Parameter, Tier, Value
from crossbody.cases.errors import SceneError
from crossbody.cases.mechanisms.red_body.claims import METRICS, limits
from crossbody.cases.mechanisms.red_body.order import STAGES, Fall, inequalities
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.cases.scene_contacts import law_of

_LONGER = 1.1  # part by which gravity may make the blow of the right corner longer than its closed form
PARAMETERS = {
    "mass": Parameter(default=1.0, unit="kg", doc="mass of the box, uniform", low=0.0, open_low=True),
    "half_width": Parameter(default=0.1, unit="m", doc="half the width of the box", low=0.0, open_low=True),
    "half_height": Parameter(default=0.15, unit="m", doc="half the height of the box", low=0.0, open_low=True),
    "slab_mass": Parameter(default=4.0, unit="kg", doc="mass of the slab, uniform", low=0.0, open_low=True),
    "slab_half_length": Parameter(default=0.4, unit="m", doc="half the length of the slab", low=0.0, open_low=True),
    "slab_half_height": Parameter(default=0.03, unit="m", doc="half the thickness of the slab", low=0.0, open_low=True),
    "foot": Parameter(default=0.3, unit="m", doc="distance of a foot from the slab's middle", low=0.0, open_low=True),
    "wall": Parameter(default=0.5, unit="m", doc="position of the wall right of the box"),
    "gravity": Parameter(default=9.81, unit="m/s^2", doc="downwards", low=0.0, open_low=True),
    "drop": Parameter(default=0.01, unit="m", doc="height of the lower corner above the slab at t = 0", low=0.0),
    "tilt": Parameter(
        default=0.2, unit="rad", doc="angle of the box at t = 0; above 0 its left corner is the lower one",
        low=-1.5, high=1.5,
    ),
    "x": Parameter(default=0.0, unit="m", doc="position of the box over the slab's middle at t = 0"),
    "speed_x": Parameter(default=0.0, unit="m/s", doc="sideways speed of the box at t = 0"),
    "speed_y": Parameter(default=0.0, unit="m/s", doc="upward speed of the box at t = 0"),
    "spin": Parameter(default=0.0, unit="rad/s", doc="angular velocity of the box at t = 0"),
    "slab_height": Parameter(default=0.0, unit="m", doc="height of the slab above its rest position at t = 0"),
    "slab_tilt": Parameter(default=0.0, unit="rad", doc="angle of the slab at t = 0", low=-0.5, high=0.5),
    "a0": Parameter(default=1.0, unit="1/s^2", doc="stiffness of CONTACT", low=0.0),
    "a1": Parameter(default=1.0, unit="1/s", doc="damping of CONTACT", low=0.0),
    "b0": Parameter(default=1e6, unit="1/s^2", doc="stiffness of COLLISION", low=0.0, open_low=True),
    "zeta3": Parameter(default=2.0, doc="damping ratio of COLLISION at the left corner", low=0.0),
    "zeta4": Parameter(default=0.05, doc="damping ratio of COLLISION at the right corner", low=0.0),
    "zeta5": Parameter(default=0.5, doc="damping ratio of COLLISION at the wall", low=0.0),
    "t_end": Parameter(default=0.12, unit="s", doc="horizon", low=0.0, open_low=True),
}  # fmt: skip

# In real time first: there every engine has something to follow, and the pulses of lam can be seen.
VARIANTS: dict[str, dict[str, Value]] = {"resolved": {}, "frozen": {}}
_RULES = {"resolved": "resolved", "frozen": "sequential"}
_TITLES = {
    "resolved": "a corner is caught and softened, then released by the impact of the other: collisions in real time",
    "frozen": "a corner is caught and softened, then released by the impact of the other: instantaneous collisions",
}
COORDINATES = tuple(
    Coordinate(name=name, unit=unit)
    for name, unit in (
        ("x", "m"), ("y", "m"), ("angle", "rad"), ("slab x", "m"), ("slab y", "m"), ("slab angle", "rad"),
    )
)  # fmt: skip
WAYS = (("x", "slide", (1.0, 0.0, 0.0)), ("y", "slide", (0.0, 0.0, 1.0)), ("angle", "hinge", (0.0, -1.0, 0.0)))
"""Joints of either body, which turns from x towards z."""
CONTACTS = ("left foot", "right foot", "left corner", "right corner", "wall")


def start(p: Mapping[str, float]) -> tuple[Floats, Floats]:
    """Positions and velocities (6,) at t = 0."""
    a, b, d, th = p["half_width"], p["half_height"], p["slab_half_height"], p["tilt"]
    y = 2.0 * d + p["drop"] + a * abs(math.sin(th)) + b * math.cos(th)
    q = np.array([p["x"], y, th, 0.0, d + p["slab_height"], p["slab_tilt"]])
    for name, side in (("left", -1.0), ("right", 1.0)):
        _check_corner(p, q, name, side)
    reach = p["wall"] - p["x"] - a * math.cos(th) + b * math.sin(th)
    if reach < 0.0:
        raise SceneError(f"red_body: the box starts {-reach:.3g} m inside the wall; valid: wall + {-reach:.3g} m.")
    return q, np.array([p["speed_x"], p["speed_y"], p["spin"], 0.0, 0.0, 0.0])


def _check_corner(p: Mapping[str, float], q: Floats, name: str, side: float) -> None:
    c, s = math.cos(q[2]), math.sin(q[2])
    along, down = side * p["half_width"], -p["half_height"]
    x, y = q[0] + c * along - s * down - q[3], q[1] + s * along + c * down - q[4]
    c, s = math.cos(q[5]), math.sin(q[5])
    gap, place = c * y - s * x - p["slab_half_height"], c * x + s * y
    if gap < -1e-12:
        raise SceneError(f"red_body: the {name} corner starts {-gap:.3g} m inside the slab; valid: a larger drop.")
    if abs(place) > p["slab_half_length"]:
        raise SceneError(
            f"red_body: the {name} corner starts {abs(place):.3g} m from the slab's middle; "
            f"valid: up to slab_half_length = {p['slab_half_length']:g} m."
        )


def laws(p: Mapping[str, float]) -> list[RowLaw]:
    """Slow constants for all five rows; fast ones for corners and wall, none for the feet, which stay."""
    slow, w = RowLaw(a0=p["a0"], a1=p["a1"]), math.sqrt(p["b0"])
    quick = [replace(slow, b0=p["b0"], b1=2.0 * p[zeta] * w) for zeta in ("zeta3", "zeta4", "zeta5")]
    return [slow, slow, *quick]


def scene(p: Mapping[str, float]) -> Scene:
    """Return two uniform boxes that move in the plane of x and z, each on two slides and a hinge.

    Feet and corners are points over planes: the floor, the slab's upper face, a wall across x.
    """
    a, b, d, foot = (p[name] for name in ("half_width", "half_height", "slab_half_height", "foot"))
    sizes = {"box": (p["mass"], a, b), "slab": (p["slab_mass"], p["slab_half_length"], d)}
    points = (("slab", -foot, -d), ("slab", foot, -d), ("box", -a, -b), ("box", a, -b), ("box", a, b))
    under = ("floor", "floor", "upper face", "upper face", "wall face")
    return Scene(
        bodies=tuple(_body(name, *size) for name, size in sizes.items()),
        joints=tuple(
            Joint(name=f"{body} {name}", body=body, type=kind, axis=axis) for body in sizes for name, kind, axis in WAYS
        ),
        shapes=(
            Shape(name="floor", type="plane"),
            Shape(name="upper face", body="slab", type="plane", position=(0.0, 0.0, d)),
            Shape(name="wall face", type="plane", position=(p["wall"], 0.0, 0.0), orientation=(1.0, 0.0, -1.0, 0.0)),
            *(Shape(name=name, body=body, position=(x, 0.0, z))
              for name, (body, x, z) in zip(CONTACTS, points, strict=True)),
        ),
        pairs=tuple(
            Pair(name=name, first=surface, second=name, law=law)
            for name, surface, law in zip(CONTACTS, under, laws(p), strict=True)
        ),
        gravity=(0.0, 0.0, -p["gravity"]),
    )  # fmt: skip


def _body(name: str, mass: float, half: float, half_height: float) -> Body:
    """Return a uniform box; only its moment of inertia about y ever acts."""
    turning = mass * (half**2 + half_height**2) / 3.0
    return Body(name=name, mass=mass, inertia=(turning, turning, turning, 0.0, 0.0, 0.0))


def _still(p: Mapping[str, float]) -> bool:
    """Whether the slab starts at rest on its feet, and stays there until the box has struck twice."""
    half = math.hypot(p["half_width"], p["half_height"])
    return p["slab_height"] == p["slab_tilt"] == 0.0 and abs(p["x"]) + abs(p["speed_x"]) * p["t_end"] + half < p["foot"]


def _order_claims(p: Mapping[str, float], frozen: bool) -> Iterator[Claim]:
    """The order of modes of the presentation, and the numbers that follow from it."""
    fall = Fall(p)
    blow = 0.0 if frozen else _LONGER * cf.contact_time(p["b0"], 2.0 * p["zeta4"] * math.sqrt(p["b0"]))
    if fall.touch + fall.rotation + blow >= p["t_end"]:
        return
    source = "sequence of modes of the presentation; its inequalities hold"
    yield Claim(metric="mode_order", expected=float(len(STAGES)), tier=Tier.B, source=source)
    if frozen and fall.touch + fall.rotation + fall.aloft < p["t_end"]:
        return  # a third collision may come
    if frozen:
        impulse, source = (
            fall.caught + fall.struck,
            "the impulse that stops the left corner, and (1 + e) v / G44 of the right one",
        )
        yield Claim(metric="collision_impulse", expected=impulse, tier=Tier.A, source=source)
        return
    if p["zeta3"] >= 0.5:
        pushed = fall.press(fall.tilt, p["spin"]) + 2.0 * p["zeta3"] * math.sqrt(p["b0"]) * fall.speed
        source = "(g + b1 v) / G33 at the first touch"
        yield Claim(metric="peak_lam3", expected=pushed / fall.delassus(fall.tilt), tier=Tier.A, source=source)


def _still_claims(p: Mapping[str, float]) -> Iterator[Claim]:
    """What holds while the slab stands still, whatever the box does."""
    yield Claim(
        metric="foot_lam", expected=0.5 * p["slab_mass"] * p["gravity"], tier=Tier.A,
        source="half the slab's weight, whenever the box is in the air",
    )  # fmt: skip
    if p["wall"] > p["x"] + abs(p["speed_x"]) * p["t_end"] + math.hypot(p["half_width"], p["half_height"]):
        yield Claim(metric="wall_lam", expected=0.0, tier=Tier.A, source="nothing pushes the box sideways")


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene, with the order of modes claimed where the inequalities behind it hold."""
    p = {k: float(value) for k, value in parameters.items()}
    q0, v0 = start(p)
    frozen, still, made = variant == "frozen", _still(p), scene(p)
    broken = inequalities(p, frozen) if still else ()
    claims = (*_still_claims(p), *(() if broken else _order_claims(p, frozen))) if still else ()
    note = f" (the order is not claimed: {'; '.join(broken)})" if broken else ""
    return Case(
        name="red_body",
        variant=variant,
        title=_TITLES[variant] + note,
        mechanism="red_body",
        parameters=parameters,
        coordinates=COORDINATES,
        contacts=CONTACTS,
        q0=q0,
        v0=v0,
        t_end=p["t_end"],
        law=law_of(made),
        scene=made,
        collisions=_RULES[variant],
        claims=claims,
        metrics=METRICS,
        limits=limits(variant, claims),
        units={k: parameter.unit for k, parameter in PARAMETERS.items()},
    )
