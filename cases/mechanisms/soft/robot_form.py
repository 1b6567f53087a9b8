"""The soft contact on the delta robot as a scene: its arms, and beside them pads, block, and what carries states.

Written apart from the reference's kernels. The flange carries the fingers; its controller has feedback
linearisation with an integral, whose reference the touch sensors move along x and a path along z.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case, Force, Law, Parameter
from crossbody.cases.errors import InvalidValue
from crossbody.cases.form import Form, formed
from crossbody.cases.mechanisms.delta import controller, pose
from crossbody.cases.mechanisms.delta import form as delta
from crossbody.cases.mechanisms.delta import scene as robot
from crossbody.cases.mechanisms.delta.controller import COS, SIN, motor_torque
from crossbody.cases.mechanisms.delta.form import L1, L2, OFFSET, friction_and_servos
from crossbody.cases.mechanisms.soft.form import (
    CP,
    GAIN_D,
    GAIN_I,
    GAIN_P,
    KS,
    NAMES,
    PAD_MASS,
    PADS,
    K,
    breaks,
    fastest,
    fingers,
    sizes,
    smooth,
)
from crossbody.cases.mechanisms.soft.scene import numbers
from crossbody.cases.scene import Body, Joint, Scene, Shape, Tendon

ROBOT = {
    **robot.ROBOT,
    "p": replace(robot.ROBOT["p"], default=20.0),
    "table": Parameter(default=0.62, unit="m", doc="depth of the table"),
    "high": Parameter(default=0.58, unit="m", doc="depth of the flange at the start and at the end"),
    "low": Parameter(default=0.60, unit="m", doc="depth of the flange during the grasp"),
    "descent": Parameter(default=1.0, unit="s", doc="duration of the descent", low=0.0, open_low=True),
    "rise": Parameter(default=5.2, unit="s", doc="time at which it begins to rise", low=0.0),
    "rise_time": Parameter(default=1.0, unit="s", doc="how long it rises", low=0.0, open_low=True),
}
COORDINATES = (
    *((joint, "rad") for joint in robot.JOINTS),
    ("left pad", "m"), ("right pad", "m"), ("difference of the sensors", "N s"),
    ("block", "m"), ("block y", "m"), ("block z", "m"),
    *((f"integral of the error {axis}", "m s") for axis in "xyz"),
)  # fmt: skip
CONTACTS = (*robot.LOOPS, "left", "right", "table")
HINGES, LEFT, RIGHT, FELT, BLOCK, ERROR = 9, 9, 10, 11, 12, 15
STATES = ("difference", "error x", "error y", "error z")
SIGN, FINGERS = len(delta.ROBOT) + 6, len(delta.ROBOT) + 7
"""Where the robot's sign and the numbers of the fingers stand, behind those of friction and servos."""
PATH = FINGERS + len(NAMES)
STROKE, DESCENT, RISE, RISE_TIME, TORQUE = range(PATH, PATH + 5)
ROWS = (0, 1, 2, 3, 4, 5, 7, 8, 6)
"""Of the loops, the pads and the table: the scene has bounds of joints before those of tendons."""


def check(p: Mapping[str, float]) -> None:
    """Check the flange's path."""
    if p["rise"] < p["descent"]:
        raise InvalidValue(
            f"soft_contact: rise is {p['rise']:g} s; the flange descends until descent = "
            f"{p['descent']:g} s, so it must be at least that."
        )


def start(p: Mapping[str, float]) -> Floats:
    """Positions (18,): flange high on the axis, jaws open, block on the table."""
    pose.pose(p, np.array([0.0, 0.0, p["low"]]))
    arms = pose.pose(p, np.array([0.0, 0.0, p["high"]]))
    half = 0.5 * p["width"]
    reach = p["jaw"] + half
    return np.concatenate([arms, [-reach, reach, 0.0], [p["offset"], 0.0, p["table"] - half], np.zeros(3)])


def _tip(i: int, r: Floats, rd: Floats, p: Floats, at: Floats, rate: Floats, others: Floats) -> None:
    """Add a third of an arm's tip (3,), m, and of its velocity; write its angles q2 and q3."""
    q, gamma, qd, gammad = r[3 * i], r[3 * i + 2], rd[3 * i], rd[3 * i + 2]
    phi, phid, l1, l2 = q + r[3 * i + 1], qd + rd[3 * i + 1], p[L1], p[L2]
    c, s, cg, sg = math.cos(phi), math.sin(phi), math.cos(gamma), math.sin(gamma)
    x, y, z = -sg, cg * c, cg * s
    xd, yd, zd = -cg * gammad, -sg * c * gammad - cg * s * phid, -sg * s * gammad + cg * c * phid
    others[2 * i], others[2 * i + 1] = math.atan2(math.hypot(x, z), y), math.atan2(x, z)
    cs, sn = COS[i], p[SIGN] * SIN[i]
    along, up = p[OFFSET] + l1 * math.cos(q) + l2 * y, l1 * math.sin(q) + l2 * z
    alongd, upd = l2 * yd - l1 * math.sin(q) * qd, l2 * zd + l1 * math.cos(q) * qd
    at[0], at[1], at[2] = at[0] + (cs * l2 * x - sn * along) / 3, at[1] + (sn * l2 * x + cs * along) / 3, at[2] + up / 3
    rate[0] += (cs * l2 * xd - sn * alongd) / 3
    rate[1] += (sn * l2 * xd + cs * alongd) / 3
    rate[2] += upd / 3


def _pull(r: Floats, force: float, p: Floats, out: Floats) -> None:
    """Add a force on the flange along x, N, a third at each tip."""
    for i in range(3):
        phi, gamma = r[3 * i] + r[3 * i + 1], r[3 * i + 2]
        c, s, cg, sg = math.cos(phi), math.sin(phi), math.cos(gamma), math.sin(gamma)
        x, y = COS[i] * force / 3.0, -p[SIGN] * SIN[i] * force / 3.0
        outer = -p[L2] * cg * s * y
        out[3 * i] += outer - p[L1] * math.sin(r[3 * i]) * y
        out[3 * i + 1] += outer
        out[3 * i + 2] -= p[L2] * (cg * x + sg * c * y)


def _force(t: float, q: Floats, v: Floats, p: Floats, out: Floats) -> None:
    """Write what acts on arms, pads, block and states, beside the dampers of joints."""
    z, zd, others, u, f = np.zeros(3), np.zeros(3), np.zeros(6), np.zeros(3), p[FINGERS:PATH]
    for i in range(3):
        _tip(i, q, v, p, z, zd, others)
    left, right = fingers(f, t, z[0], zd[0], q[LEFT], v[LEFT], q[RIGHT], v[RIGHT])
    felt = v[FELT] + f[KS] * f[PAD_MASS] * (v[LEFT] + v[RIGHT])
    _, down, slowing = smooth(t, 0.0, p[DESCENT])
    _, up, falling = smooth(t, p[RISE], p[RISE] + p[RISE_TIME])
    error = np.array([f[K] * felt - zd[0], -zd[1], p[STROKE] * (down - up) - zd[2]])
    asked = f[GAIN_I] * q[ERROR:] + f[GAIN_P] * v[ERROR:] + f[GAIN_D] * error
    asked[2] += p[STROKE] * (slowing - falling)
    y = np.array([q[0], q[3], q[6]])
    motor_torque(y, others, asked, p[TORQUE:], u)
    friction_and_servos(t, q[:HINGES], v[:HINGES], p, out[:HINGES])
    for i in range(3):
        out[3 * i] += u[i]
        out[ERROR + i], out[BLOCK + i] = error[i], 0.0
    _pull(q, -left - right, p, out)
    out[LEFT], out[RIGHT], out[FELT] = left + f[CP] * v[LEFT], right + f[CP] * v[RIGHT], -f[KS] * (left + right + felt)


def _scene(p: Mapping[str, float]) -> Scene:
    """Return the arms and what slides beside them; a tendon is what lies between a pad and the block."""
    arms, half = delta.scene(p), 0.5 * p["width"]
    masses = {**dict.fromkeys(PADS, p["pad_mass"]), "difference": 1.0, "block": p["block_mass"]}
    masses |= dict.fromkeys(STATES[1:], 1.0)
    damping = {**dict.fromkeys(PADS, p["cp"]), "block": p["bt"], "block y": p["bt"]}
    slides = [(name, name, (1.0, 0.0, 0.0)) for name in masses]
    slides[4:4] = [("block y", "block", (0.0, 1.0, 0.0)), ("block z", "block", (0.0, 0.0, 1.0))]
    lowest = {"block z": (-math.inf, p["table"] - half)}
    balls = (("left pad", -half), ("right pad", half), ("block", 0.0))
    return arms.replace(
        bodies=(*arms.bodies, *(Body(name=name, mass=mass, inertia=(mass,) * 3 + (0.0,) * 3)
                                for name, mass in masses.items())),
        joints=(*arms.joints, *(
            Joint(name=name, body=body, type="slide", axis=axis, damping=(damping.get(name, 0.0), 0.0, 0.0),
                  range=lowest.get(name, (-math.inf, math.inf)))
            for name, body, axis in slides
        )),
        shapes=(
            Shape(name="table", type="plane", position=(0.0, 0.0, p["table"]), orientation=(0.0, 1.0, 0.0, 0.0)),
            *(Shape(name=name, body=name, size=(half, 0.0, 0.0), position=(at, 0.0, 0.0)) for name, at in balls),
        ),
        tendons=tuple(
            Tendon(name=side, joints=(pad, "block"), coefficients=(sign, -sign), range=(half, math.inf))
            for side, pad, sign in zip(("left", "right"), PADS, (-1.0, 1.0), strict=True)
        ),
        actuators=(), pushes=(),
    )  # fmt: skip


def on_robot(case: Case, powered: bool = True, steady: bool = False) -> Form:
    """Return the arms, and what slides beside them, under their forces."""
    p = numbers(case.parameters)
    (far, time, force), order = sizes(p), np.argsort(ROWS)
    path = [p["low"] - p["high"], p["descent"], p["rise"], p["rise_time"]]
    acting = Force(
        function=_force,
        numbers=np.concatenate([
            delta.numbers(p, False), [p["sign"]], [p[name] for name in NAMES], path, controller.numbers(p),
        ]),
        breaks=breaks(p, case.t_end, (p["descent"], p["rise"], p["rise"] + p["rise_time"])),
        rate=fastest(p, p["m3"]), states=STATES,
        far=(1.0,) * HINGES + (far, far, force * time, *(far,) * 3, *(far * time,) * 3),
        fast=(1.0 / time,) * HINGES + (far / time, far / time, force, *(far / time,) * 3, *(far,) * 3),
    )  # fmt: skip
    laws = {part.name: getattr(case.law, part.name)[order] for part in fields(Law)}
    start = to_scene(case.q0, case.v0)
    return Form(
        case=formed(case, _scene(p), *start, law=Law(**laws), force=acting),
        to_case=to_case, to_scene=to_scene, bend=_bend, rows=ROWS,
    )  # fmt: skip


def to_case(q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Return the case's states (n, 18) of the scene's."""
    angles, rates = delta.motion(q[:, :HINGES], v[:, :HINGES])
    return np.concatenate([angles, q[..., HINGES:]], axis=-1), np.concatenate([rates, v[..., HINGES:]], axis=-1)


def to_scene(q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Return the scene's states (..., 18) of the case's."""
    hinges, rates = pose.to_tree(q[..., :HINGES], v[..., :HINGES])
    return np.concatenate([hinges, q[..., HINGES:]], axis=-1), np.concatenate([rates, v[..., HINGES:]], axis=-1)


def _bend(q: Floats, v: Floats) -> Floats:
    return np.concatenate([pose.bend(q[:HINGES], v[:HINGES]), np.zeros(len(v) - HINGES)])
