"""What the reference must give of friction on what moves by itself and of dry friction, and metrics of its slip.

Asked beside runs of scenes. A mass m on a smooth floor moves along two rails, (.6, .8) and (-.6, .8), of which one
holds back with F. What that exerts is (F / 1.2, F / 1.6), so that along the floor it slides to rest, and presses,

    v = v0 - F t / (1.2 m) sign(v0),    lam = m g + F / 1.6 sign(v0),    t = 1.2 m |v0| / F

One that is put on a floor that moves at V along it, with the friction mu, comes up with it,

    v = mu g t V / |V|,    t = |V| / (mu g)
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody.cases import Case, Mode, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.engines.equations import equations_of
from crossbody.reference import simulate
from crossbody.reports.judging.asked import Found, Within, unlike
from crossbody.reports.judging.known_scenes import GRAVITY, LAW, MASS, MU, RADIUS, ball_on_a_floor
from crossbody.reports.measuring.friction import slipped

LOSS, FAST = 3.1, (1.7, -1.2)
"""Bound of dry friction, N, and velocities that it stops, m/s."""
BELT = np.array([-0.3, 0.4])
"""Velocity of a floor along the two rows of friction, m/s."""
NEAR, SAMPLES = 1e-6, 41
"""Part by which a number may be off; samples of each motion."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return which number is another than it must be, least and most, and of what."""
    return unlike((_dry, _belts), "reference", "friction, which ends in")


def _rail() -> Case:
    """Return a ball on a smooth floor, with coordinates along two oblique joints, one of them with dry friction."""
    return case_of(Scene(
        bodies=(Body(name="ball", mass=MASS, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0), position=(0.0, 0.0, RADIUS)),),
        joints=(Joint(name="rail", body="ball", type="slide", axis=(0.6, 0.0, 0.8), friction_loss=LOSS),
                Joint(name="free", body="ball", type="slide", axis=(-0.6, 0.0, 0.8))),
        shapes=(Shape(name="floor", type="plane", size=(1.0, 1.0, 1.0)),
                Shape(name="ball", body="ball", size=(RADIUS, 0.0, 0.0))),
        pairs=(Pair(name="a", first="floor", second="ball", law=LAW),), gravity=(0.0, 0.0, -GRAVITY),
    ), name="rail")  # fmt: skip


def _dry() -> Iterator[Within]:
    """Slide to rest, either way."""
    system, slows, way = equations_of(_rail()), LOSS / (1.2 * MASS), np.array([1.0, -1.0]) / 1.2
    dry = np.asarray(system.dry)
    for fast in FAST:
        sign, stops = math.copysign(1.0, fast), abs(fast) / slows
        t = np.linspace(0.0, 1.5 * stops, SAMPLES)
        run = simulate(system, [0.0, 0.0], fast * way, t[-1], samples=t)
        past = np.minimum(run.t, stops)[:, None]
        slides = run.mode[:, dry] == Mode.SLIP
        yield from _all("dry friction", run, {
            "v": (run.v, (fast - sign * slows * past) * way),
            "q": (run.q, (fast * past - 0.5 * sign * slows * past**2) * way),
            "lam": (run.lam[:, dry], np.where(slides, -sign * LOSS, 0.0)),
            "lam of a floor": (run.lam[:, ~dry], MASS * GRAVITY + np.where(slides, sign * LOSS / 1.6, 0.0)),
        }, stops)  # fmt: skip


def _belts() -> Iterator[Within]:
    """Put a ball on a floor that moves, and ask metrics how it slips there."""
    case = ball_on_a_floor()
    system = replace(equations_of(case), drift=np.array([0.0, *BELT]))
    speed, gains = float(np.hypot(*BELT)), MU * GRAVITY
    stops = speed / gains
    t = np.linspace(0.0, 1.5 * stops, SAMPLES)
    run = simulate(system, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], t[-1], samples=t)
    gained = np.outer(np.minimum(run.t * gains, speed), BELT / speed)
    slides = run.mode[:, 0] == Mode.SLIP
    pushed = np.where(slides[:, None], MU * MASS * GRAVITY * BELT / speed, 0.0)
    yield from _all("a floor that moves", run, {
        "v": (run.v[:, :2], gained), "lam": (run.lam[:, 1:], pushed),
        "slip": (slipped(system, case, run)[:, 1:], gained - BELT),
    }, stops)  # fmt: skip


def _all(what: str, run: Trajectory, found: dict[str, tuple[Floats, Floats]], stops: float) -> Iterator[Within]:
    """Yield the largest differences, and when it stops."""
    at = next((event.t for event in run.events if event.after == Mode.STICK), math.nan)
    yield "reference (stick)", what, at, stops, NEAR * stops
    for name, (value, wanted) in found.items():
        size = float(np.max(np.abs(wanted)))
        yield f"reference ({name})", what, float(np.max(np.abs(value - wanted))), 0.0, NEAR * size
