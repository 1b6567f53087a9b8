"""A mass on a spring whose guide has dry friction: each half swing is shorter by the same amount; it stops off centre.

With w^2 = k/m and reach = f/k it swings about reach on either side, each half swing shorter by
twice that, and stays where it stops within reach of the spring's rest. Without a spring it slides
on a parabola, and stays where it stops.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case, Parameter, Value
from crossbody.cases.files.case import case_of
from crossbody.cases.mechanisms.friction.creeps import OfGuide
from crossbody.cases.mechanisms.friction.limits import limits
from crossbody.cases.mechanisms.friction.motions import Motion, Rows, Stage
from crossbody.cases.scene import Body, Joint, RowLaw, Scene
from crossbody.cases.trajectory import Mode

MOST_SWINGS = 1e4  # half swings that are told one by one at most

Path = Callable[[Floats], tuple[Floats, Floats]]
"""Times since a start (n,), s -> place and velocity (n,), m and m/s."""


def _slide(x: float, v: float, way: float, p: Mapping[str, float]) -> tuple[Path, float]:
    """Return the path of a mass that slides along `way` from x at velocity v, and when it stops, s."""
    m, k, push = p["mass"], p["stiffness"], -way * p["friction_loss"]
    if k == 0.0:
        a = push / m
        return lambda s: (x + s * (v + 0.5 * a * s), v + a * s), -v / a
    w, middle = math.sqrt(k / m), push / k
    a, b = x - middle, v / w
    half = math.atan2(b, a) % math.pi if v != 0.0 else math.pi

    def path(s: Floats) -> tuple[Floats, Floats]:
        sine, cosine = np.sin(w * s), np.cos(w * s)
        return middle + a * cosine + b * sine, w * (b * cosine - a * sine)

    return path, half / w


def _half_swings(p: Mapping[str, float]) -> float:
    """Return how often the mass turns at most until it stops, or the horizon: each costs it twice the loss over k."""
    w = math.sqrt(p["stiffness"] / p["mass"])
    reach = p["stiffness"] * abs(p["start"]) + w * p["mass"] * abs(p["speed"])
    return min(p["t_end"] * w / math.pi, 0.5 * reach / p["friction_loss"])


def oscillator(p: Mapping[str, float]) -> Motion | None:
    """Return the motion from place `start` at velocity `speed`: q = (x,), one row, that of friction.

    None where it has too many swings.
    """
    if not _half_swings(p) < MOST_SWINGS:
        return None
    x, v, t, loss, stages = p["start"], p["speed"], 0.0, p["friction_loss"], list[Stage]()
    first = Mode.STICK if v == 0.0 else Mode.SLIP

    def stage(path: Path, begins: float, mode: Mode, force: float) -> Stage:
        def at(s: Floats) -> Rows:
            place, rate = path(s)
            return place[:, None], rate[:, None], np.zeros((len(s), 1)), np.full((len(s), 1), force)

        return Stage(begins, (int(mode),), at)

    while t <= p["t_end"] and (v != 0.0 or abs(p["stiffness"] * x) > loss):
        way = math.copysign(1.0, v if v != 0.0 else -x)
        path, lasts = _slide(x, v, way, p)
        stages.append(stage(path, t, Mode.SLIP, -way * loss))
        x, v, t = float(path(np.array([lasts]))[0][0]), 0.0, t + lasts
    if t <= p["t_end"]:
        rest = np.array([x])
        held = lambda s: (np.broadcast_to(rest, s.shape), np.zeros(len(s)))  # noqa: E731
        stages.append(stage(held, t, Mode.STICK, p["stiffness"] * x))

    def energy(q: Floats, v: Floats) -> Floats:
        return np.stack([0.5 * p["mass"] * v[:, 0] ** 2, 0.5 * p["stiffness"] * q[:, 0] ** 2], axis=1)

    return Motion(stages, 1, energy, p["t_end"], before=first)


PARAMETERS = {
    "mass": Parameter(default=2.0, unit="kg", doc="of the body", low=0.0, open_low=True),
    "stiffness": Parameter(default=50.0, unit="N/m", doc="of the spring", low=0.0),
    "friction_loss": Parameter(default=1.0, unit="N", doc="bound of the guide's friction", low=0.0, open_low=True),
    "start": Parameter(default=0.17, unit="m", doc="from the spring's rest"),
    "speed": Parameter(default=0.0, unit="m/s", doc="at the start"),
    "a1": Parameter(default=100.0, unit="1/s", doc="rate at which the slip of a sticking contact decays", low=0.0),
    "t_end": Parameter(default=4.0, unit="s", doc="horizon", low=0.0, open_low=True),
}

VARIANTS: dict[str, dict[str, Value]] = {
    "swings": {},
    "stops": {"stiffness": 0.0, "start": 0.0, "speed": 0.8},
    "holds": {"start": 0.015, "t_end": 1.0},
}

_TITLES = {
    "swings": "a mass on a spring swings in a guide with dry friction until it sticks",
    "stops": "a body slides in a guide with dry friction and stops",
    "holds": "dry friction holds against a spring",
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
    creeps = {("mujoco", "default"): OfGuide(p["stiffness"] / p["mass"], p["start"], p["t_end"])} if holds else {}
    return limits(made, _TITLES[variant], PARAMETERS, oscillator(p), p, creeps)
