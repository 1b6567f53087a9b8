"""A block that stands on an edge falls back onto its base: friction keeps the edge in place until then.

About its lower edge it is an inverted pendulum of length R: with phi of R from the vertical,

    phi'' = p^2 sin phi,    cos(phi/2) = k sn(K(k) - p t, k),    p^2 = m g R / (I + m R^2),    k = cos(phi_0/2).

The horizon ends just before the block is flat (docs/explanation/contacts.md).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.special import ellipj, ellipk, ellipkinc

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case, Parameter, Value
from crossbody.cases.errors import InvalidValue
from crossbody.cases.files.case import case_of
from crossbody.cases.mechanisms.friction.blocks import CORNERS
from crossbody.cases.mechanisms.friction.limits import limits
from crossbody.cases.mechanisms.friction.motions import Motion, Rows, Stage
from crossbody.cases.mechanisms.friction.scene import MASS, NUMBERS, block_on_floor
from crossbody.cases.trajectory import Mode

EDGE = (1, 3)  # corners on which it stands


class Block(NamedTuple):
    """Half sides, half diagonal R, m; its angle to the height, tilt at the start, rad; p, 1/s; modulus k."""

    half: tuple[float, float, float]
    R: float
    angle: float
    tilt: float
    p: float
    k: float


def block(p: Mapping[str, float]) -> Block:
    """Return what the motion of a block depends on."""
    b, h = p["width"], p["height"]
    R, angle = math.hypot(b, h), math.atan2(b, h)
    tilt = p["tilt"] * angle
    rate = math.sqrt(p["gravity"] * R / ((b * b + h * h) / 3.0 + R * R))
    return Block((b, 1.5 * b, h), R, angle, tilt, rate, math.cos(0.5 * (angle - tilt)))


def flat_at(p: Mapping[str, float]) -> float:
    """Return when it is flat, s."""
    own = block(p)
    m = own.k**2
    return float((ellipk(m) - ellipkinc(math.asin(math.cos(0.5 * own.angle) / own.k), m)) / own.p)


def start(p: Mapping[str, float]) -> Floats:
    """Return q at the start: place of the centre in the plane, m, and tilt, rad."""
    own = block(p)
    phi = own.angle - own.tilt
    return np.array([-own.R * math.sin(phi), own.R * math.cos(phi), own.tilt])


def rocking(p: Mapping[str, float]) -> Motion:
    """Return the motion up to `flat_at`: q = (x, z, turn), 8 normal rows, then 16."""
    own, g = block(p), p["gravity"]
    corners = CORNERS * np.array(own.half)

    def at(s: Floats) -> Rows:
        sn, cn, dn, _ = ellipj(ellipk(own.k**2) - own.p * s, own.k**2)
        half = np.arccos(np.clip(own.k * sn, -1.0, 1.0))
        phi, rate = 2.0 * half, 2.0 * own.p * own.k * cn * dn / np.sin(half)
        turn, a = own.angle - phi, own.p**2 * np.sin(phi)
        x, z = -own.R * np.sin(phi), own.R * np.cos(phi)
        q = np.stack([x, z, turn], axis=1)
        v = np.stack([-z * rate, x * rate, -rate], axis=1)
        force = MASS * np.stack([-z * a - x * rate**2, g + x * a - z * rate**2], axis=1)
        gap, lam = np.zeros((len(s), 24)), np.zeros((len(s), 24))
        gap[:, :8] = z[:, None] - np.outer(np.sin(turn), corners[:, 0]) + np.outer(np.cos(turn), corners[:, 2])
        for k in EDGE:
            gap[:, k], lam[:, k], lam[:, 8 + 2 * k] = 0.0, 0.5 * force[:, 1], 0.5 * force[:, 0]
        return q, v, gap, lam

    def energy(q: Floats, v: Floats) -> Floats:
        inertia = MASS / 3.0 * own.R**2
        moving = 0.5 * MASS * np.sum(v[:, :2] ** 2, axis=1) + 0.5 * inertia * v[:, 2] ** 2
        return np.stack([moving, MASS * g * q[:, 1]], axis=1)

    normal = [int(Mode.STICK if k in EDGE else Mode.FREE) for k in range(8)]
    return Motion([Stage(0.0, (*normal, *(one for one in normal for _ in (0, 1))), at)], 8, energy, p["t_end"])


PARAMETERS = {
    **NUMBERS,
    "t_end": Parameter(default=0.34, unit="s", doc="horizon", low=0.0, open_low=True),
    "width": Parameter(default=0.1, unit="m", doc="half of it", low=0.0, open_low=True),
    "height": Parameter(default=0.5, unit="m", doc="half of it", low=0.0, open_low=True),
    "tilt": Parameter(
        default=0.5, doc="initial angle, relative to that at which it balances", low=0.0, high=1.0, open_low=True
    ),
}

VARIANTS: dict[str, dict[str, Value]] = {"falls": {}}


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with its exact motion, as far as it goes."""
    p = {name: float(value) for name, value in parameters.items()}
    if not p["t_end"] < (last := flat_at(p)):
        raise InvalidValue(f"rocking_block: t_end is {p['t_end']:g} s; the block is flat at {last:.6g} s.")
    made = case_of(
        block_on_floor(p, block(p).half, planar=True), name="rocking_block", variant=variant, q0=start(p),
        t_end=p["t_end"], parameters=parameters,
    )  # fmt: skip
    return limits(made, "a block on an edge falls back onto its base", PARAMETERS, rocking(p), p)
