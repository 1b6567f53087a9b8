"""Small mechanisms with numbers at random that do not feel each other, for scenes of several."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from friction_scenes import box_body, pair

from crossbody.cases import Case, from_scene
from crossbody.cases.scene import Actuator, Body, Joint, Loop, Pair, RowLaw, Scene, Shape, Tendon

GRAVITY = (1.5, -0.7, -9.0)  # no plane is level, no axis along it


@dataclass(frozen=True)
class Piece:
    """Parts of a scene by group, and a start."""

    parts: dict[str, tuple[Any, ...]]
    q0: list[float]
    v0: list[float] = field(default_factory=list)


def _law(rng: np.random.Generator) -> RowLaw:
    return RowLaw(a0=float(10.0 ** rng.uniform(2.5, 4.0)), a1=float(rng.uniform(5.0, 60.0)))


def _floor(name: str, at: float) -> Shape:
    return Shape(name=f"{name} floor", type="plane", position=(at, 0.0, 0.0))


def ball(rng: np.random.Generator, name: str, at: float, rough: bool) -> Piece:
    """Thrown on a floor, with spin and friction."""
    r = float(rng.uniform(0.05, 0.2))
    body = Body(name=name, mass=float(rng.uniform(0.5, 2.0)), inertia=(*[0.4 * r * r] * 3, 0.0, 0.0, 0.0))
    shapes = (_floor(name, at), Shape(name=name, body=name, type="sphere", size=(r, 0.0, 0.0)))
    parts = {
        "bodies": (body,), "joints": (Joint(name=name, body=name, type="free"),), "shapes": shapes,
        "pairs": (pair(f"{name} floor", name, rough * float(rng.uniform(0.1, 0.6)), _law(rng)),),
    }  # fmt: skip
    return Piece(parts, [at, 0.3, r + 0.05, 1.0, 0.0, 0.0, 0.0], rng.normal(size=6).tolist())


def sledge(rng: np.random.Generator, name: str, at: float, rough: bool) -> Piece:
    """A box that slides flat on a floor with friction, until it holds or for ever."""
    body, floor = box_body(name, (0.2, 0.15, 0.02)), _floor(name, at)
    joints = tuple(
        Joint(name=f"{name} {axis}", body=name, type="slide", axis=tuple(np.eye(3)[k])) for k, axis in enumerate("xyz")
    )
    shape = Shape(name=name, body=name, type="sphere", size=(0.02, 0.0, 0.0))
    parts = {
        "bodies": (body,), "joints": joints, "shapes": (floor, shape),
        "pairs": (pair(floor.name, name, rough * float(rng.uniform(0.2, 0.8)), _law(rng)),),
    }  # fmt: skip
    return Piece(parts, [at, 0.0, 0.02], [*rng.normal(size=2), 0.0])


def door(rng: np.random.Generator, name: str, at: float, rough: bool) -> Piece:
    """On a spring and a damper against a stop, driven by a servo, with dry friction or without."""
    body = Body(name=name, position=(at, 0.0, 0.5), mass=1.0, com=tuple(rng.normal(size=3) * 0.2),
                inertia=(0.1, 0.2, 0.15, 0.01, 0.02, -0.01))  # fmt: skip
    hinge = Joint(
        name=name, body=name, type="hinge", axis=tuple(rng.normal(size=3)), range=(-0.1, 0.3), law=_law(rng),
        stiffness=(float(rng.uniform(1.0, 5.0)), 0.3, 0.2), damping=(0.1, 0.05, 0.02), armature=0.02,
        rest=(float(rng.normal()) * 0.3,), friction_loss=rough * float(rng.choice([0.0, 0.2])),
    )  # fmt: skip
    servo = Actuator(name=name, joint=name, gear=(1.5,), gain=(1.0, 0.0, 0.0), bias=(0.4, -0.5, -0.1))
    return Piece({"bodies": (body,), "joints": (hinge,), "actuators": (servo,)}, [0.2], [float(rng.normal())])


def swing(rng: np.random.Generator, name: str, at: float, rough: bool) -> Piece:
    """A body on a ball joint at the end of a slide, held by a rope that comes taut and is pulled by a spring."""
    cart = Body(name=f"{name} cart", position=(at, 0.0, 1.0), mass=float(rng.uniform(0.5, 2.0)))
    body = Body(name=name, parent=cart.name, position=(0.0, 0.1, 0.0), mass=1.0, com=(0.05, 0.1, -0.3),
                inertia=(0.05, 0.07, 0.03, 0.0, 0.01, 0.0))  # fmt: skip
    joints = (
        Joint(name=cart.name, body=cart.name, type="slide", axis=(1.0, 0.3, 0.0), stiffness=(30.0, 0.0, 0.0)),
        Joint(name=name, body=name, type="ball", damping=(0.05, 0.0, 0.0)),
    )
    rope = Tendon(name=name, bodies=(name, ""), positions=((0.0, 0.0, -0.5), (at, 0.4, 0.2)), range=(0.0, 0.7),
                  stiffness=(1.0, 0.0, 0.0), rest=(0.2, 0.2), law=_law(rng))  # fmt: skip
    parts = {"bodies": (cart, body), "joints": joints, "tendons": (rope,)}
    return Piece(parts, [0.1, 1.0, 0.0, 0.0, 0.0], rng.normal(size=4).tolist())


def gears(rng: np.random.Generator, name: str, at: float, rough: bool) -> Piece:
    """Two hinges that follow each other, the second above a floor."""
    names = (f"{name} 1", f"{name} 2")
    bodies = tuple(
        Body(name=one, position=(at, 0.0, 0.6), mass=1.0, com=(0.2, 0.0, 0.0), inertia=(0.05, 0.1, 0.1, 0.0, 0.0, 0.0))
        for one in names
    )
    joints = tuple(Joint(name=one, body=one, type="hinge", axis=(0.0, 1.0, 0.0)) for one in names)
    shapes = (_floor(name, at), Shape(name=name, body=names[1], position=(0.4, 0.0, 0.0), size=(0.1, 0.0, 0.0)))
    loop = Loop(name=name, type="joint", first=names[0], second=names[1], polynomial=(0.0, 0.7, 0.0, 0.0, 0.0),
                law=RowLaw(a0=1e3, a1=60.0))  # fmt: skip
    parts = {
        "bodies": bodies, "joints": joints, "shapes": shapes, "loops": (loop,),
        "pairs": (Pair(name=f"{name} meets", first=f"{name} floor", second=name, law=_law(rng)),),
    }  # fmt: skip
    return Piece(parts, [0.7 * 0.9, 0.9], [0.0, 0.0])


KINDS: tuple[Callable[[np.random.Generator, str, float, bool], Piece], ...] = (ball, sledge, door, swing, gears)


def drawn(seed: int, count: int, rough: bool) -> list[Piece]:
    """So many pieces of kinds at random, with friction or all without, in places of their own."""
    rng = np.random.default_rng(seed)
    return [
        (make := KINDS[k])(rng, f"{make.__name__} {i}", 4.0 * i, rough)
        for i, k in enumerate(rng.integers(len(KINDS), size=count))
    ]


def case_of(pieces: Sequence[Piece], t_end: float) -> Case:
    """Pieces in one scene, in their order."""
    groups = ("bodies", "joints", "shapes", "pairs", "tendons", "loops", "actuators")
    parts = {group: tuple(part for piece in pieces for part in piece.parts.get(group, ())) for group in groups}
    q0, v0 = ([x for piece in pieces for x in getattr(piece, name)] for name in ("q0", "v0"))
    return from_scene(Scene(gravity=GRAVITY, **parts), q0=q0, v0=v0, t_end=t_end)
