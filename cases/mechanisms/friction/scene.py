"""Bodies of 1 kg on a floor with friction, as scenes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from crossbody.cases.case import Parameter
from crossbody.cases.scene import Actuator, Body, Joint, Loop, Pair, Push, RowLaw, Scene, Shape, Tendon, Vector

MASS = 1.0
NUMBERS = {
    "mu": Parameter(default=0.5, doc="coefficient of friction", low=0.0, open_low=True),
    "gravity": Parameter(default=9.81, unit="m/s^2", doc="of the field", low=0.0, open_low=True),
    "a0": Parameter(default=1e4, unit="1/s^2", doc="stiffness of the contact over the mass", low=0.0, open_low=True),
    "a1": Parameter(default=200.0, unit="1/s", doc="damping of the contact over the mass", low=0.0),
    "t_end": Parameter(default=1.0, unit="s", doc="horizon", low=0.0, open_low=True),
}
"""Parameters of every scene here."""
SLIDES = (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0)), ("z", (0.0, 0.0, 1.0)))
PLANAR = (("x", (1.0, 0.0, 0.0), "slide"), ("z", (0.0, 0.0, 1.0), "slide"), ("turn", (0.0, 1.0, 0.0), "hinge"))
LOW, HIGH = (0.4, 0.3, 0.125), (0.1, 0.1, 0.125)
"""Half sides of two blocks, m, whose heights add up without rounding: 1e-17 m would be a gap."""
GRIP, LIFTED, FINGER = 0.0625, 0.25, 0.125
"""Of fingers: half the width held, m, to which a radius adds without rounding; height, m; mass, kg."""
UNEVEN = 0.25  # how much more than half of both springs' force the left one has, which a loop passes to the right
FLOOR = Shape(name="floor", type="plane")
WEIGHT = Shape(name="box", body="weight", type="box", size=(GRIP, GRIP, LIFTED))


def law(p: Mapping[str, float]) -> RowLaw:
    """Return the law of a scene's contacts."""
    return RowLaw(a0=p["a0"], a1=p["a1"])


def pair(first: str, second: str, mu: float, own: RowLaw) -> Pair:
    """Return two shapes that slide on each other with friction."""
    return Pair(name=f"{first}:{second}", first=first, second=second, friction=(mu, mu, 0.0, 0.0, 0.0), dimension=3,
                law=own)  # fmt: skip


def field(p: Mapping[str, float], steep: float = 0.0) -> Vector:
    """Return gravity over a floor that falls along x at an angle of this tangent, m/s^2."""
    length = math.hypot(1.0, steep)
    return (p["gravity"] * steep / length, 0.0, -p["gravity"] / length)


def block(name: str, half: Vector, mass: float = MASS, height: float = 0.0) -> Body:
    """Return a homogeneous block of half sides, m, with a mass, kg, and the height of its centre, m."""
    a, b, c = (side * side for side in half)
    inertia = tuple(mass / 3.0 * part for part in (b + c, a + c, a + b))
    return Body(name=name, mass=mass, inertia=(*inertia, 0.0, 0.0, 0.0), position=(0.0, 0.0, height))


def touching_block(radius: float) -> tuple[Shape, Shape]:
    """Return the ball by which a block that never turns touches at one place, and the box that is seen."""
    sides = (2.0 * radius, 1.5 * radius, radius)
    ball = Shape(name="block", body="block", size=(radius, 0.0, 0.0))
    return ball, Shape(name="box", body="block", type="box", size=sides)


def point_on_floor(p: Mapping[str, float], radius: float) -> Scene:
    """Return a block that never turns and touches at one place: a ball on three slides, in a box for the eye."""
    return Scene(
        bodies=(Body(name="block", mass=MASS, position=(0.0, 0.0, radius)),),
        joints=tuple(Joint(name=name, body="block", type="slide", axis=axis) for name, axis in SLIDES),
        shapes=(FLOOR, *touching_block(radius)), pairs=(pair("floor", "block", p["mu"], law(p)),),
        gravity=field(p, p["slope"]),
    )  # fmt: skip


def block_on_floor(p: Mapping[str, float], half: Vector, planar: bool = False) -> Scene:
    """Return a free block, or one that stays in a plane, on a floor that falls along x."""
    free = (Joint(name="free", body="block", type="free"),)
    joints = tuple(Joint(name=name, body="block", type=kind, axis=axis) for name, axis, kind in PLANAR)
    return Scene(
        bodies=(block("block", half, height=0.0 if planar else half[2]),), joints=joints if planar else free,
        shapes=(FLOOR, Shape(name="block", body="block", type="box", size=half)),
        pairs=(pair("floor", "block", p["mu"], law(p)),), gravity=field(p, p.get("slope", 0.0)),
    )  # fmt: skip


def block_on_belt(p: Mapping[str, float]) -> Scene:
    """Return a block on a spring that touches a belt at one place, seen from the belt: the spring's far end goes back.

    That end is an activation, the integral of a control that is the belt's speed, backwards.
    """
    r, k = p["radius"], p["stiffness"]
    spring = Actuator(name="spring", joint="x", gain=(k, 0.0, 0.0), bias=(0.0, -k, 0.0), activation="integrator")
    return Scene(
        bodies=(Body(name="block", mass=MASS, position=(0.0, 0.0, r)),),
        joints=tuple(Joint(name=name, body="block", type="slide", axis=axis) for name, axis in SLIDES[::2]),
        shapes=(replace(FLOOR, name="belt"), *touching_block(r)),
        pairs=(pair("belt", "block", p["mu"], law(p)),), actuators=(spring,), gravity=field(p),
    )  # fmt: skip


def two_blocks(p: Mapping[str, float]) -> Scene:
    """Return a block on a floor and one on it, each pushed along x at its centre."""
    low, high = LOW, HIGH
    return Scene(
        bodies=(block("low", low, p["low_mass"], low[2]), block("high", high, p["high_mass"], 2.0 * low[2] + high[2])),
        joints=tuple(Joint(name=name, body=name, type="free") for name in ("low", "high")),
        shapes=(
            FLOOR, Shape(name="low", body="low", type="box", size=low),
            Shape(name="top", body="low", type="plane", position=(0.0, 0.0, low[2])),
            Shape(name="high", body="high", type="box", size=high),
        ),
        pairs=(pair("floor", "low", p["mu"], law(p)), pair("top", "high", p["high_mu"], law(p))),
        pushes=(Push(name="on low", body="low"), Push(name="on high", body="high")), gravity=field(p),
    )  # fmt: skip


def sphere_on_floor(p: Mapping[str, float]) -> Scene:
    """Return a homogeneous sphere on a level floor."""
    r = p["radius"]
    return Scene(
        bodies=(Body(name="sphere", mass=MASS, inertia=(0.4 * MASS * r * r,) * 3 + (0.0,) * 3, position=(0, 0, r)),),
        joints=(Joint(name="free", body="sphere", type="free"),),
        shapes=(FLOOR, Shape(name="sphere", body="sphere", size=(r, 0.0, 0.0))),
        pairs=(pair("floor", "sphere", p["mu"], law(p)),), gravity=field(p),
    )  # fmt: skip


def tossed_cube(p: Mapping[str, float]) -> Scene:
    """Return a free cube over a level table."""
    half = (0.5 * p["side"],) * 3
    body = Body(
        name="cube", mass=p["mass"], com=(p["off"], 0.0, 0.0), inertia=(p["inertia"],) * 3 + (0.0,) * 3,
        position=(0.0, 0.0, half[2]),
    )  # fmt: skip
    return Scene(
        bodies=(body,), joints=(Joint(name="free", body="cube", type="free"),),
        shapes=(replace(FLOOR, name="table"), Shape(name="cube", body="cube", type="box", size=half)),
        pairs=(pair("table", "cube", p["mu"], law(p)),), gravity=field(p),
    )  # fmt: skip


def gripper(p: Mapping[str, float]) -> Scene:
    """Return a weight between two fingers that press along x: pushed on its sides, which are planes, or by springs."""
    r, sides = p["radius"], (("left", -1.0), ("right", 1.0))
    fingers = [Body(name=name, mass=FINGER, position=(way * (GRIP + r), 0.0, LIFTED)) for name, way in sides]
    planes = [
        Shape(name=f"side {name}", body="weight", type="plane", position=(way * GRIP, 0.0, 0.0),
              orientation=(0.5, 0.5, 0.5 * way, 0.5 * way))
        for name, way in sides
    ]  # fmt: skip
    scene = Scene(
        bodies=(Body(name="weight", mass=MASS, position=(0.0, 0.0, LIFTED)), *fingers),
        joints=(
            *(Joint(name=name, body="weight", type="slide", axis=axis) for name, axis in SLIDES[::2]),
            *(Joint(name=name, body=name, type="slide", axis=(1.0, 0.0, 0.0)) for name, _ in sides),
        ),
        shapes=(WEIGHT, *planes, *(Shape(name=name, body=name, size=(r, 0.0, 0.0)) for name, _ in sides)),
        pairs=tuple(pair(f"side {name}", name, p["mu"], law(p)) for name, _ in sides),
        pushes=tuple(Push(name=f"on {name}", body=name) for name, _ in sides), gravity=field(p),
    )  # fmt: skip
    return _sprung(scene, p) if p["stiffness"] > 0.0 else scene


def _sprung(scene: Scene, p: Mapping[str, float]) -> Scene:
    """Return a gripper of a box, whose fingers mirror each other: unequal springs press, that of the right a tendon."""
    k, (x, z, left, right) = p["stiffness"], scene.joints
    more, less = ((0.5 + way * UNEVEN) * 2.0 * p["press"] / k for way in (1.0, -1.0))
    return replace(
        scene, pushes=(),
        joints=(x, z, replace(left, stiffness=(k, 0.0, 0.0), rest=(more,)), right),
        shapes=(WEIGHT, *scene.shapes[3:]),
        pairs=(
            pair("left", "box", p["mu"], law(p)), pair("box", "right", p["mu"], law(p)),
            pair("left", "right", 0.0, law(p)),  # which never meet
        ),
        tendons=(Tendon(name="spring", joints=("right",), coefficients=(-1.0,), stiffness=(k, 0.0, 0.0),
                        rest=(less, less)),),
        loops=(Loop(name="mirror", type="joint", first="right", second="left", polynomial=(0.0, -1.0, 0.0, 0.0, 0.0),
                    law=law(p)),),
    )  # fmt: skip
