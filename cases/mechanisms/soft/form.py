"""The soft contact on its axis as a scene: flange, pads on it, block, and slides that carry controller and sensors.

Written apart from the reference's kernels. The pads hang on the flange, so that their dampers are
those of joints: they are counted from it, in the case from the world.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case, Force
from crossbody.cases.form import Form, formed
from crossbody.cases.mechanisms.soft.scene import numbers
from crossbody.cases.scene import Body, Joint, Scene, Shape, Tendon

Numbers = Mapping[str, float]
Motion = tuple[float, float]
BODIES = {"flange": "flange_mass", "left pad": "pad_mass", "right pad": "pad_mass", "block": "block_mass"}
PADS = tuple(BODIES)[1:3]
STATES = ("error", "left sensor", "right sensor", "shift")
"""Whose places are the integral of the error, those of both readings, and that of the fingers' shift."""
ALONG = (1.0, 0.0, 0.0)


NAMES = (
    "kp", "cp", "width", "jaw", "squeeze", "close_start", "close_end", "release",
    "release_time", "pad_mass", "k", "ks", "gain_p", "gain_d", "gain_i",
)  # fmt: skip
"""Of the numbers that a force reads of the fingers."""
KP, CP, WIDTH, JAW, SQUEEZE, START, STOP, RELEASE, TIME, PAD_MASS, K, KS, GAIN_P, GAIN_D, GAIN_I = range(len(NAMES))
_OWN = ("flange_mass", "rate_share", "probe", "probe_rate")
_MASS, _SHARE, _PROBE, _RATE = range(len(NAMES), len(NAMES) + len(_OWN))


def smooth(t: float, start: float, stop: float) -> tuple[float, float, float]:
    """Return the step u^3 (10 - 15 u + 6 u^2) between two instants, s, its rate and second derivative."""
    length = stop - start
    u = min(max((t - start) / length, 0.0), 1.0)
    rate, bend = 30.0 * (u * (1.0 - u)) ** 2, 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u * u), rate / length, bend / length**2


def jaw(p: Floats, t: float) -> Motion:
    """Return the offset of a finger from where it just touches a centred block, m, and its rate."""
    close, rate, _ = smooth(t, p[START], p[STOP])
    if p[RELEASE] != 0.0:
        opened, back, _ = smooth(t, p[RELEASE], p[RELEASE] + p[TIME])
        close, rate = close - opened, rate - back
    stroke = p[JAW] + p[SQUEEZE]
    return p[JAW] - stroke * close, -stroke * rate


def fingers(
    p: Floats, t: float, x: float, xd: float, pl: float, pld: float, pr: float, prd: float
) -> Motion:  # fmt: skip
    """Return the forces of both fingers on their pads, N, by places and rates of middle and pads."""
    w, wd = jaw(p, t)
    reach = w + 0.5 * p[WIDTH]
    return p[KP] * (x - reach - pl) + p[CP] * (xd - wd - pld), p[KP] * (x + reach - pr) + p[CP] * (xd + wd - prd)


def breaks(p: Numbers, t_end: float, more: tuple[float, ...] = ()) -> tuple[float, ...]:
    """Return where the jaws' third derivative jumps, s, and more instants before the horizon."""
    ends = {p["close_start"], p["close_end"], *more}
    if p["release"]:
        ends |= {p["release"], p["release"] + p["release_time"]}
    return tuple(sorted(t for t in ends if 0.0 < t < t_end))


def fastest(p: Numbers, flange_mass: float) -> float:
    """Return the fastest rate of both pads against the flange, the loop, the sensors and the rows, 1/s."""
    mass = 1.0 / (1.0 / p["pad_mass"] + 2.0 / flange_mass)
    pad = (p["cp"] + math.sqrt(max(p["cp"] ** 2 - 4.0 * p["kp"] * mass, 0.0))) / (2.0 * mass)
    return max(
        pad, math.sqrt(p["kp"] / mass), p["bt"] / p["block_mass"], p["ks"], p["gain_d"], p["a1"], math.sqrt(p["a0"])
    )


def sizes(p: Numbers) -> tuple[float, float, float]:
    """Return how far the fingers close, m, in what time, s, and with what force, N."""
    return p["jaw"] + p["squeeze"], p["close_end"] - p["close_start"], p["kp"] * max(p["squeeze"], 1e-3 * p["jaw"])


def _force(t: float, q: Floats, v: Floats, p: Floats, out: Floats) -> None:
    """Write what acts on flange, pads, block and states, beside the dampers of joints."""
    u, shift, pld, prd = p[_PROBE] * np.sin(p[_RATE] * t), p[KS] * p[PAD_MASS], v[0] + v[1], v[0] + v[2]
    left, right = fingers(p, t, q[0] + v[7], v[0] + u, q[0] + q[1], pld, q[0] + q[2], prd)
    yl, yr = v[5] - shift * pld, v[6] + shift * prd
    moved = p[K] * (yr - yl)
    asked = p[GAIN_I] * q[4] + p[GAIN_P] * v[4] + p[GAIN_D] * (p[_SHARE] * moved - v[0])
    out[0], out[1], out[2], out[3] = p[_MASS] * asked, left + p[CP] * v[1], right + p[CP] * v[2], 0.0
    out[4], out[5], out[6], out[7] = moved - v[0], p[KS] * (left - yl), p[KS] * (-right - yr), u


def _scene(p: Numbers) -> Scene:
    """Return the slides; a tendon is what lies between a pad and the block."""
    half = 0.5 * p["width"]
    names = (*BODIES, *STATES)
    masses = [p[BODIES[name]] if name in BODIES else 1.0 for name in names]
    damping = {**dict.fromkeys(PADS, p["cp"]), "block": p["bt"]}
    balls = (("left pad", -half), ("right pad", half), ("block", 0.0))
    sides = zip(("left", "right"), PADS, (-1.0, 1.0), strict=True)
    return Scene(
        bodies=tuple(
            Body(name=name, parent="flange" if name in PADS else "", mass=mass, inertia=(mass,) * 3 + (0.0,) * 3)
            for name, mass in zip(names, masses, strict=True)
        ),
        joints=tuple(
            Joint(name=name, body=name, type="slide", axis=ALONG, damping=(damping.get(name, 0.0), 0.0, 0.0))
            for name in names
        ),
        shapes=tuple(
            Shape(name=name, body=name, size=(half, 0.0, 0.0), position=(middle, 0.0, 0.0)) for name, middle in balls
        ),
        tendons=tuple(
            Tendon(name=side, joints=("flange", pad, "block"), coefficients=(sign, sign, -sign), range=(half, math.inf))
            for side, pad, sign in sides
        ),
        gravity=(0.0, 0.0, 0.0),
    )  # fmt: skip


def on_axis(case: Case, powered: bool = True, steady: bool = False) -> Form:
    """Return the slides under their forces."""
    p = numbers(case.parameters)
    far, time, force = sizes(p)
    to_case, to_scene = np.eye(len(case.q0)), np.eye(len(case.q0))
    to_case[1:3, 0], to_scene[1:3, 0] = 1.0, -1.0
    acting = Force(
        function=_force, numbers=np.array([p[name] for name in (*NAMES, *_OWN)]),
        breaks=breaks(p, case.t_end), rate=fastest(p, p["flange_mass"]), states=STATES,
        far=(far,) * 4 + (far * time, force * time, force * time, far * time),
        fast=(far / time,) * 4 + (far, force, force, far),
    )  # fmt: skip
    return Form(
        case=formed(case, _scene(p), to_scene @ case.q0, to_scene @ case.v0, law=case.law, force=acting),
        to_case=lambda q, v: (q @ to_case.T, v @ to_case.T), rows=(0, 1),
        to_scene=lambda q, v: (q @ to_scene.T, v @ to_scene.T),
    )  # fmt: skip
