"""The delta robot as a scene: three arms of hinges whose tips two loops join, a third of the flange at each.

Gravity is along +z, which points down. Friction and servos act on the absolute angles (q1, q2,
q3) of an arm, whose rates follow from those of the tree, with phi = q1 + alpha and d the
direction of the distal link, as

    q2' = (sin gamma cos phi gamma' + cos gamma sin phi phi')/s2        s2 = hypot(d_x, d_z)
    q3' = (-sin phi gamma' + sin gamma cos gamma cos phi phi')/s2^2

so torques on them act on the tree by the transpose.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case, Force, Inputs
from crossbody.cases.control import Control
from crossbody.cases.form import Form, formed
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.mechanisms.delta.controller import MOTORS, Controller
from crossbody.cases.mechanisms.soft.form import smooth
from crossbody.cases.parameters import of_numbers
from crossbody.cases.scene import Actuator, Body, Joint, Loop, Push, Scene

THIN = 2e-15  # inertia of a rod about itself, kg m^2: MuJoCo has no less
ARMS = (1, 2, 3)
ROBOT = ("d1", "d2", "d3", "l1", "l2", "offset", "upper", "lower", "kp", "kd", "stop", "ahead")
D1, D2, D3, L1, L2, OFFSET, UPPER, LOWER, KP, KD, STOP, AHEAD = range(len(ROBOT))
"""Of the numbers that the force reads; behind them the motors' angles at both ends of a ramp."""


def friction_and_servos(t: float, r: Floats, rd: Floats, p: Floats, out: Floats) -> None:
    """Write the forces of friction and servos on the hinges of the arms (9,), N m."""
    x, xd, _ = smooth(t, 0.0, p[STOP]) if p[STOP] > 0.0 else (1.0, 0.0, 0.0)
    for i in range(3):
        q, gamma, turn, swing = r[3 * i], r[3 * i + 2], rd[3 * i] + rd[3 * i + 1], rd[3 * i + 2]
        phi = q + r[3 * i + 1]
        c, s, cg, sg = math.cos(phi), math.sin(phi), math.cos(gamma), math.sin(gamma)
        square = sg * sg + cg * cg * s * s
        b_phi, b_gamma = cg * s / math.sqrt(square), sg * c / math.sqrt(square)
        w_phi, w_gamma = sg * cg * c / square, -s / square
        t2 = -p[D2] * (b_phi * turn + b_gamma * swing)
        t3 = -p[D3] * (w_phi * turn + w_gamma * swing)
        start, end = p[AHEAD + 1 + i], p[AHEAD + 4 + i]
        y = start + (end - start) * x
        t1 = p[KP] * (y - q) + p[KD] * ((end - start) * xd - rd[3 * i]) - p[D1] * rd[3 * i]
        if p[AHEAD] != 0.0:  # the torque that holds all motors at y
            aside = p[OFFSET] + p[L1] * math.cos(y)
            below = math.sqrt(p[L2] * p[L2] - aside * aside)
            t1 -= p[UPPER] * math.cos(y) + p[LOWER] * aside * p[L1] * math.sin(y) / (p[L2] * below)
        out[3 * i + 1] = b_phi * t2 + w_phi * t3
        out[3 * i], out[3 * i + 2] = t1 + out[3 * i + 1], b_gamma * t2 + w_gamma * t3


def numbers(p: Mapping[str, float], powered: bool) -> Floats:
    """What `friction_and_servos` reads; of servos that move, of those that hold the start, or of none."""
    own = {
        **p, "offset": p["r_base"] - p["r_flange"], "kp": 0.0, "kd": 0.0, "stop": 0.0, "ahead": 0.0,
        "upper": (p["m1"] / 2 + p["m2"] + p["m3"] / 3) * p["gravity"] * p["l1"],
        "lower": (p["m2"] / 2 + p["m3"] / 3) * p["gravity"] * p["l2"],
    }  # fmt: skip
    ends = [0.0] * 6
    if powered and "kp" in p and "period" not in p:
        own |= {"kp": p["kp"], "kd": p["kd"]}
        if "ramp" in p:
            own |= {"stop": p["ramp"], "ahead": 1.0}
            ends = [p["start_angle"]] * 3 + [pose.elbow_angle(p) + p["offset"]] * 3  # of its end from the elbows' pose
        else:
            ends = pose.pose(p, np.array([p["x"], p["y"], p["z"]]))[MOTORS].tolist() * 2
    return np.array([*(own[name] for name in ROBOT), *ends])


def _rod(mass: float, length: float) -> dict[str, Any]:
    """Return mass, centre and inertia of a slender uniform rod along y from the joint."""
    about = mass * length**2 / 12.0
    return {"mass": mass, "com": (0.0, 0.5 * length, 0.0), "inertia": (about, THIN, about, 0.0, 0.0, 0.0)}


def scene(p: Mapping[str, float]) -> Scene:
    """Return the arms with their motors, and a push on each third of the flange."""
    bodies, joints, offset = [], [], p["r_base"] - p["r_flange"]
    for i, R in zip(ARMS, pose.rotations(p), strict=True):
        half = 0.5 * math.atan2(R[1, 0], R[0, 0])
        turned = (math.cos(half), 0.0, 0.0, math.sin(half))
        near, far, tip = f"proximal {i}", f"distal {i}", f"tip {i}"
        bodies += [
            Body(name=near, position=tuple(offset * R[:, 1]), orientation=turned, **_rod(p["m1"], p["l1"])),
            Body(name=far, parent=near, position=(0.0, p["l1"], 0.0), **_rod(p["m2"], p["l2"])),
            Body(name=tip, parent=far, position=(0.0, p["l2"], 0.0), mass=p["m3"] / 3.0),
        ]
        joints += [
            Joint(name=f"q{i}", body=near, type="hinge", axis=(1.0, 0.0, 0.0), armature=p["jm"]),
            Joint(name=f"alpha {i}", body=far, type="hinge", axis=(1.0, 0.0, 0.0)),
            Joint(name=f"gamma {i}", body=far, type="hinge", axis=(0.0, 0.0, 1.0)),
        ]
    return Scene(
        bodies=tuple(bodies), joints=tuple(joints), gravity=(0.0, 0.0, p["gravity"]),
        loops=tuple(Loop(name=f"loop {i}", type="connect", first="tip 1", second=f"tip {i}") for i in ARMS[1:]),
        actuators=tuple(Actuator(name=f"motor {i}", joint=f"q{i}") for i in ARMS),
        pushes=tuple(Push(name=f"third {i}", body=f"tip {i}") for i in ARMS),
    )  # fmt: skip


def motion(r: Floats, rd: Floats) -> tuple[Floats, Floats]:
    """Return q and v (n, 9) of a motion of the tree; q_i3 goes on where its angle passes pi."""
    q, v = pose.from_tree(r, rd)
    q[:, 2::3] = np.unwrap(q[:, 2::3], axis=0)
    return q, v


def in_tree(case: Case, powered: bool = True, steady: bool = False) -> Form:
    """Return the arms under friction and servos, or a sampled controller."""
    p, given = of_numbers(case.parameters), case.inputs
    arms = scene(p)
    inputs = given if given is None else Inputs(
        names=arms.inputs, times=given.times,
        values=np.hstack([given.values[:, :3], np.tile(given.values[:, 3:] / 3.0, 3)]),
    )  # fmt: skip
    sampled = "period" in p and not steady
    control = Control(function=Controller(case.parameters), tick=p["period"]) if sampled else None
    return Form(
        case=formed(
            case, arms, *pose.to_tree(case.q0, case.v0), law=case.law, inputs=inputs, control=control,
            force=Force(function=friction_and_servos, numbers=numbers(p, powered), far=(1.0,) * 9, fast=(1.0,) * 9),
        ),
        to_case=motion, to_scene=pose.to_tree, bend=pose.bend, rows=tuple(range(len(case.contacts))),
    )  # fmt: skip
