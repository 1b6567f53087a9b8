"""What an engine must make of motors and of a controller, of motions in closed form: asked once of each.

A mass that is pushed by a motor whose force lags behind its control, u k ticks after the start, moves by exponentials:

    tau a' = u - a        m x'' = gain a

Its controller is asked at each tick, once, with the position and velocity of that instant.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody import engines
from crossbody.cases import Case, Inputs
from crossbody.cases.arrays import Floats
from crossbody.cases.control import Control
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Actuator, Body, Joint, Scene
from crossbody.reports.judging.asked import Found
from crossbody.reports.judging.known_engines import asked_of, run_of

MASS, GAIN, LAG, AT, FAST = 1.3, 7.0, 0.03, 0.2, -0.4
"""Of what is pushed: kg; N; s; and where it is at first, m, and how fast, m/s."""
TICK, CONTROLS, FINE = 0.02, (0.8, -0.6, 0.9, -1.0, 0.7), 40
"""Time between controls, s, the controls, and how many steps an engine with a step of its own is given in it."""
RISES, FULL, FILLS = 9.0, 0.5, 10
"""Rate at which a motor's activation changes, 1/s, the end of its range, and for how many ticks."""
STIFF, MOST, FAR = 40.0, 6.0, 0.5
"""Of a servo: N/m, the largest force, N, and how far it has to go, m."""
OF_ORDER_ONE, TIGHTLY, FIT = 0.1, 1e-6, 1e-9
"""Part of what a control does in its tick by which engines of first order may be off, and any other engine; and their
tolerance, and by which part of it instants may be off."""


@cache
def wrong(name: str) -> tuple[Found, ...]:
    """Return what, number, least and most, and of what, where an engine's answer is another one.

    Args:
        name: of one of crossbody's own engines, which is installed.
    """
    return asked_of(name, _controlled, _clamped, _filled)


def _on_a_rail(motor: Actuator, at: float, fast: float, t_end: float, control: Control | None = None) -> Case:
    body = Body(name="cart", mass=MASS, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    joint = Joint(name="rail", body="cart", type="slide", axis=(1.0, 0.0, 0.0))
    scene = Scene(bodies=(body,), joints=(joint,), actuators=(motor,), gravity=(0.0, 0.0, 0.0))
    return case_of(scene, name="driven", q0=[at], v0=[fast], t_end=t_end, control=control)


def _driven(control: Control) -> Case:
    motor = Actuator(name="motor", joint="rail", gain=(GAIN, 0.0, 0.0), activation="filter", time_constant=LAG)
    return _on_a_rail(motor, AT, FAST, TICK * len(CONTROLS), control)


def motion() -> Floats:
    """Return x, x' and a (n + 1, 3) at every tick and at the end, m, m/s and 1."""
    found, keeps = [(AT, FAST, 0.0)], math.exp(-TICK / LAG)
    for u in CONTROLS:
        x, v, a = found[-1]
        left, push = (a - u) * LAG * (1.0 - keeps), GAIN / MASS
        x += v * TICK + push * (0.5 * u * TICK**2 + (a - u) * LAG * TICK - LAG * left)
        found.append((x, v + push * (u * TICK + left), u + (a - u) * keeps))
    return np.array(found)


def _controlled(engine: engines.Engine, profile: str) -> Iterator[Found]:
    """Ask for what a controller is told at its ticks, and for what its controls have done at the end."""
    told: list[tuple[float, float, float]] = []

    def control(t: float, q: Floats, v: Floats) -> float:
        told.append((t, float(q[0]), float(v[0])))
        return CONTROLS[min(len(told), len(CONTROLS)) - 1]

    case = _driven(Control(function=control, tick=TICK))
    run = run_of(engine, profile, case, rtol=FIT, dt=TICK / FINE)
    if run is None:
        return
    name, said, wanted = f"{engine.name}:{profile}", "a controlled motor that lags", motion()
    told, ends = told[-len(CONTROLS) :], (*run.q[-1], *run.v[-1])  # an engine may try its steps before its run
    if len(told) < len(CONTROLS):
        yield f"{name} (ticks)", float(len(told)), (len(CONTROLS),) * 2, said
        return
    exact = engine.orders.get(profile, 1.0) > 1.0 or "rtol" in engine.offered(case, profile)
    push = GAIN / MASS * TICK * (TIGHTLY if exact else OF_ORDER_ONE)
    for k, (t, *state) in enumerate((*told, (float(run.t[-1]), *ends))):
        pairs = (("ticks", t, k * TICK, FIT * TICK), ("q", state[0], wanted[k, 0], push * TICK),
                 ("v", state[1], wanted[k, 1], push))  # fmt: skip
        for what, found, must, off in pairs:
            if not abs(found - must) <= off:
                yield f"{name} ({what})", found, (must - off, must + off), said


def _clamped(engine: engines.Engine, profile: str) -> Iterator[Found]:
    """Ask for a mass that a servo pulls back, by no more than it can until it is near: a parabola, then a wave."""
    near, rate = MOST / STIFF, math.sqrt(STIFF / MASS)
    late = math.sqrt(2.0 * MASS * (FAR - near) / MOST)
    arrives, left = -MOST / MASS * late, 0.25 * math.pi / rate
    motor = Actuator(
        name="servo", joint="rail", gain=(STIFF, 0.0, 0.0), bias=(0.0, -STIFF, 0.0), force_range=(-MOST, MOST)
    )  # fmt: skip
    case = _on_a_rail(motor, FAR, 0.0, late + left)
    if (run := run_of(engine, profile, case, rtol=FIT, dt=left / FINE)) is None:
        return
    cos, sin = math.cos(rate * left), math.sin(rate * left)
    wanted = near * cos + arrives / rate * sin, arrives * cos - near * rate * sin
    for what, found, must in zip("qv", (run.q[-1, 0], run.v[-1, 0]), wanted, strict=True):
        off = abs(arrives) * (late if what == "q" else 1.0)
        off *= TIGHTLY if "rtol" in engine.offered(case, profile) else OF_ORDER_ONE
        if not abs(found - must) <= off:
            yield f"{engine.name}:{profile} ({what})", float(found), (must - off, must + off), "a servo at its bound"


def _filled(engine: engines.Engine, profile: str) -> Iterator[Found]:
    """Ask for a mass whose motor's force grows until it is held at the end of its range, and falls again behind.

    Its acceleration changes at a steady rate from one of three instants to the next; controls are recorded, or a
    controller's.
    """

    def control(t: float, q: Floats, v: Floats) -> float:
        return RISES if t < half - FIT else -RISES

    motor = Actuator(
        name="motor", joint="rail", gain=(GAIN, 0.0, 0.0), activation="integrator", activation_range=(-1.0, FULL)
    )  # fmt: skip
    half = 0.5 * TICK * FILLS
    given = Inputs(names=("motor",), times=np.array([0.0, half]), values=np.array([[RISES], [-RISES]]))
    plain = _on_a_rail(motor, AT, FAST, 2.0 * half)
    x, v, a = AT, FAST, 0.0
    for lasts, rate in ((FULL / RISES, RISES), (half - FULL / RISES, 0.0), (half, -RISES)):
        push, grows = GAIN / MASS * a, GAIN / MASS * rate
        x += v * lasts + push * lasts**2 / 2.0 + grows * lasts**3 / 6.0
        v, a = v + push * lasts + grows * lasts**2 / 2.0, a + rate * lasts
    for said, case in (
        ("recorded", replace(plain, inputs=given)),
        ("a controller's", _on_a_rail(motor, AT, FAST, 2.0 * half, Control(function=control, tick=TICK))),
    ):  # fmt: skip
        if (run := run_of(engine, profile, case, rtol=FIT, dt=TICK / FINE)) is None:
            continue
        off = GAIN / MASS * half * (TIGHTLY if "rtol" in engine.offered(case, profile) else OF_ORDER_ONE)
        for what, found, must, most in (("q", run.q[-1, 0], x, off * half), ("v", run.v[-1, 0], v, off)):
            if not abs(found - must) <= most:
                told = f"a motor that is full, whose controls are {said}"
                yield f"{engine.name}:{profile} ({what})", float(found), (must - most, must + most), told
