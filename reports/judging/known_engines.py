"""What an engine must make of its settings and of a controller, of motions in closed form: asked once of each.

A mass on a cubic spring that is always on is back after a period that is known. What is asked for a tighter tolerance
takes more steps and comes nearer: a setting that does not reach an integrator changes nothing. And a mass that is
pushed by a motor whose force lags behind its control, u k ticks after the start, moves by exponentials:

    tau a' = u - a        m x'' = gain a

Its controller is asked at each tick, once, with the position and velocity of that instant.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np

from crossbody import cases, engines
from crossbody.cases import Case, CaseUnsupported, Inputs, Outcome, Trajectory, Value
from crossbody.cases.arrays import Floats
from crossbody.cases.case import Law
from crossbody.cases.control import Control
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Actuator, Body, Joint, Scene
from crossbody.reports.judging.asked import Found, rows_of
from crossbody.reports.judging.known_steps import period

SPRING = (5.0, 20.0, 1.0)
"""a0, 1/s^2, and a2, 1/(m s)^2, of a cubic spring, and from where it is let go, m."""
LOOSE, TIGHT = 1e-5, 1e-12
MORE, OFF = 1.3, 10.0
"""Of these tolerances: by what factor steps become more at least, of any order up to 60, and how many times the tighter
one each step may add to the error."""
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
OF_METHODS, FEW = ("method", "scheme"), 7
"""Settings of integrators whose choices are methods, and steps of a run that must not get far."""
OTHERS = ("as_is",)  # profiles of files alone


@cache
def wrong(name: str) -> tuple[Found, ...]:
    """Return what, number, least and most, and of what, where an engine's answer is another one.

    Args:
        name: of one of crossbody's own engines, which is installed.
    """
    own = engines.load(name)

    def failed(why: str) -> Found:
        return name, math.nan, (0.0, 0.0), f"a motion in closed form, which ends in {why}"

    asks = (_tolerances, _settings, _controlled, _clamped, _filled)
    profiles = [profile for profile in own.profiles if profile not in OTHERS]
    return tuple(found for profile in profiles for ask in asks for found in rows_of(partial(ask, own, profile), failed))


def _run(engine: engines.Engine, profile: str, case: Case, **asked: Value) -> Trajectory | None:
    """Return a motion with those of the settings that a profile has; None of a case that it cannot do, or with none."""
    try:
        offered = engine.offered(case, profile)
        given = {key: value for key, value in asked.items() if key in offered}
        return engine.prepare(case, profile, **given).run() if given else None
    except CaseUnsupported:
        return None


def _spring() -> Case:
    """Return a mass on a cubic spring, up to where it is back."""
    a0, a2, q0 = SPRING
    row = Law(a0=np.array([a0]), a1=np.zeros(1), a2=np.array([a2]), unilateral=np.zeros(1, dtype=bool))
    return replace(
        cases.load("bouncing_ball", "linear"), law=row, q0=np.array([q0]), v0=np.zeros(1), t_end=period(a0, a2, q0),
        closed_form=None, claims=(), limits=(), chaos=None, consistent=False,
    )  # fmt: skip


def _tolerances(engine: engines.Engine, profile: str) -> Iterator[Found]:
    """Ask for the spring's way back at two tolerances; where a profile has none, or no such spring, for nothing."""
    loose, tight = (_run(engine, profile, _spring(), rtol=rtol) for rtol in (LOOSE, TIGHT))
    if loose is None or tight is None:
        return
    name, told = f"{engine.name}:{profile}", f"a cubic spring at rtol = {TIGHT:g}"
    if not tight.steps >= MORE * loose.steps:
        yield f"{name} (steps)", float(tight.steps), (MORE * loose.steps, math.inf), told
    back = float(np.hypot(tight.q[-1, 0] / SPRING[2] - 1.0, tight.v[-1, 0] / SPRING[2]))
    if not back <= (most := OFF * TIGHT * tight.steps):
        yield name, back, (0.0, most), told


def _settings(engine: engines.Engine, profile: str) -> Iterator[Found]:
    """Ask for a run of few steps, which must end there, and for those of other methods, which must be others."""
    name = f"{engine.name}:{profile}"
    for case in (_spring(), cases.load("bouncing_ball", "linear")):
        if (run := _run(engine, profile, case, max_steps=FEW)) is None:
            continue
        if run.outcome is not Outcome.STEP_LIMIT or not run.steps <= FEW + 1:
            yield f"{name} (max_steps)", float(run.steps), (0.0, FEW + 1), f"a run of {FEW} steps"
        for setting in set(OF_METHODS) & set(engine.offered(case, profile)):
            choices = engine.offered(case, profile)[setting].choices
            runs = [_run(engine, profile, case, rtol=LOOSE, **{setting: choice}) for choice in choices]
            different = len({(one.steps, float(one.q[-1, 0])) for one in runs if one is not None})
            if different < len(choices):
                yield f"{name} ({setting})", float(different), (len(choices), math.inf), "methods that differ"
        return


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
    run = _run(engine, profile, case, rtol=FIT, dt=TICK / FINE)
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
    if (run := _run(engine, profile, case, rtol=FIT, dt=left / FINE)) is None:
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
        if (run := _run(engine, profile, case, rtol=FIT, dt=TICK / FINE)) is None:
            continue
        off = GAIN / MASS * half * (TIGHTLY if "rtol" in engine.offered(case, profile) else OF_ORDER_ONE)
        for what, found, must, most in (("q", run.q[-1, 0], x, off * half), ("v", run.v[-1, 0], v, off)):
            if not abs(found - must) <= most:
                told = f"a motor that is full, whose controls are {said}"
                yield f"{engine.name}:{profile} ({what})", float(found), (must - most, must + most), told
