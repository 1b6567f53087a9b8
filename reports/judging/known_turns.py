"""What the reference must give of a top in flight, by every method, at the ends of its steps and between.

Its coordinates are none whose rates are velocities, so that what lies between steps follows from more than their ends.
A top with the moments A, A and C, whose momentum is L in space, turns by two steady rotations, one in space and one
about its own axis,

    R(t) = exp(t [L]/A) R(0) exp(t (1 - C/A) w3 [e3])

and flies as a parabola. Between the ticks of a controller, here of one that gives no force, steps are short and of low
order; beside it, and after the first step of a third motion, implicit ones are taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

import numpy as np

from crossbody import engines
from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.control import Control
from crossbody.cases.files.case import case_of
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Actuator, Body, Joint, Scene
from crossbody.engines.equations import equations_of
from crossbody.reports.judging.asked import Found, Within, unlike
from crossbody.reports.judging.known_steps import stepped

MASS, A, C, G = 0.7, 0.02, 0.031, 9.81
"""Of a top: kg, kg m^2, and m/s^2."""
PLACE, RATES, SPIN, TURN = (0.3, -0.4, 5.0), (0.5, 0.8, -0.6), (1.1, -0.7, 2.3), (0.8, 0.36, 0.48, 0.0)
"""Where it is at first, m, its velocity, m/s and rad/s in its axes, and its attitude."""
LASTS, TICK, SAMPLES = 0.5, 2e-3, 62
"""Of a flight, and between two controls, s; and how many samples."""
RTOL, MANY = 1e-7, 100.0
"""Tolerance, and how many times it errors may be."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return which number is another than it must be, least and most, and by which steps."""
    return unlike((_flights,), "reference", "a top in flight, which ends in")


def _case(control: Control | None = None) -> Case:
    """Return a top, and beside it a cart with a motor that stands still."""
    bodies = (Body(name="top", mass=MASS, inertia=(A, A, C, 0.0, 0.0, 0.0)),
              Body(name="cart", mass=MASS, inertia=(A, A, C, 0.0, 0.0, 0.0)))  # fmt: skip
    joints = (Joint(name="float", body="top", type="free"),
              Joint(name="rail", body="cart", type="slide", axis=(1.0, 0.0, 0.0)))  # fmt: skip
    scene = Scene(bodies=bodies, joints=joints, actuators=(Actuator(name="motor", joint="rail"),), gravity=(0, 0, -G))
    q0, v0 = [*PLACE, *TURN, 0.0], [*RATES, *SPIN, 0.0]
    return case_of(scene, name="flies", q0=q0, v0=v0, t_end=LASTS, control=control)


def _flights() -> Iterator[Within]:
    t = np.linspace(0.0, LASTS, SAMPLES)
    reference, still = engines.load("reference"), Control(function=lambda t, q, v: 0.0, tick=TICK)
    free, held = _case(), _case(still)
    runs = {
        "explicit": reference.prepare(free, "compiled", rtol=RTOL, samples=t).run(),
        "short": reference.prepare(held, "compiled", rtol=RTOL, samples=t).run(),
        "implicit": stepped(equations_of(free), (free.q0, free.v0), t, RTOL, implicit=True),
    }
    for name, run in runs.items():
        for what, off in _off(run, t).items():
            yield f"reference {name} ({what})", "a top in flight", off, 0.0, MANY * RTOL


def _off(run: Trajectory, t: Floats) -> dict[str, float]:
    """Return by how much positions, m, attitudes, velocities, m/s, and spins, rad/s, are off at most."""
    if len(run.t) != len(t):
        return {f"a motion that ends {run.outcome.value}": math.nan}
    moments, axis = np.array([A, A, C]), np.array([0.0, 0.0, 1.0])
    start = matrices(np.array(TURN))
    keeps = start @ (moments * SPIN)
    found = [about(keeps / A, s) @ start @ about((1.0 - C / A) * SPIN[2] * axis, s) for s in t.tolist()]
    spins = np.array([turn.T @ keeps for turn in found]) / moments
    place, rates, falls = np.array(PLACE), np.array(RATES), np.array([0.0, 0.0, -G])
    way = place + np.outer(t, rates) + 0.5 * np.outer(t**2, falls)
    wanted = {
        "positions": (run.q[:, :3], way), "attitudes": (matrices(run.q[:, 3:7]), np.array(found)),
        "velocities": (run.v[:, :3], rates + np.outer(t, falls)), "spins": (run.v[:, 3:6], spins),
    }  # fmt: skip
    return {what: float(np.max(np.abs(mine - exact))) for what, (mine, exact) in wanted.items()}


def about(rate: Floats, t: float) -> Floats:
    """Return the rotation (3, 3) of a steady rate (3,), rad/s, after a time, by Rodrigues' formula."""
    fast = math.sqrt(float(rate @ rate))
    x, y, z = rate / fast
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    found: Floats = np.eye(3) + math.sin(fast * t) * cross + (1.0 - math.cos(fast * t)) * cross @ cross
    return found
