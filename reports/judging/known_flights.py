"""What an engine must make of a top in flight, in closed form: of positions, attitudes and velocities in their axes.

A body with the moments A, A and C about its axes flies as a parabola, and turns about them with w,

    (w1, w2) turns by (C - A)/A w3 t,    w3 and R diag(A, A, C) w stay

so that each coordinate and each velocity of a body that floats has a number of its own: one taken for another, or in
other axes, comes out otherwise. Once it floats alone, and once far above a floor with friction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

import numpy as np

from crossbody import engines
from crossbody.cases import Case
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.reports.judging.asked import Found
from crossbody.reports.judging.known_contacts import DEAR, EXACT, ran
from crossbody.reports.judging.known_drives import FIT
from crossbody.reports.judging.known_engines import asked_of

MASS, A, C, G = 0.7, 0.02, 0.031, 9.81
"""Of a top: kg, kg m^2, and m/s^2."""
PLACE, RATES, SPIN, TURN = (0.3, -0.4, 5.0), (0.5, 0.8, -0.6), (1.1, -0.7, 2.3), (0.8, 0.36, 0.48, 0.0)
"""Where it is at first, m, its velocity, m/s and rad/s in its axes, and its attitude."""
LASTS, STEP, STEPS_OFF = 0.25, 1e-3, 3.0
"""Time of flight, and step of an engine that has one, s; and by how many of these first order is off."""


@cache
def wrong(name: str) -> tuple[Found, ...]:
    """Return what, number, least and most, and of what, where an engine's answer is another one.

    Args:
        name: of one of crossbody's own engines, which is installed.
    """
    return asked_of(name, _floats, _flies)


def _top(floor: bool) -> Case:
    plane, ball = (
        Shape(name="floor", type="plane", size=(1.0, 1.0, 1.0)),
        Shape(name="top", body="top", size=(0.1,) * 3),
    )
    rubs = Pair(name="a", first="floor", second="top", dimension=3, friction=(0.5, 0.5, 0.0, 0.0, 0.0))
    scene = Scene(
        bodies=(Body(name="top", mass=MASS, inertia=(A, A, C, 0.0, 0.0, 0.0)),),
        joints=(Joint(name="float", body="top", type="free"),), gravity=(0.0, 0.0, -G),
        shapes=(plane, ball) if floor else (), pairs=(rubs,) if floor else (),
    )  # fmt: skip
    return case_of(scene, name="flies", q0=[*PLACE, *TURN], v0=[*RATES, *SPIN], t_end=LASTS)


def _floats(engine: engines.Engine, profile: str) -> Iterator[Found]:
    return _turns(engine, profile, _top(floor=False))


def _flies(engine: engines.Engine, profile: str) -> Iterator[Found]:
    if profile not in DEAR:
        yield from _turns(engine, profile, _top(floor=True))


def _turns(engine: engines.Engine, profile: str, case: Case) -> Iterator[Found]:
    if (found := ran(engine, profile, case, dt=STEP, rtol=FIT)) is None:
        return
    q, v = found[0].q[-1], found[0].v[-1]
    exact = engine.orders.get(profile, 1.0) > 1.0 or "rtol" in engine.offered(case, profile)
    off = EXACT if exact else STEPS_OFF * STEP * G
    turned = (C - A) / A * SPIN[2] * LASTS
    c, s = math.cos(turned), math.sin(turned)
    spin = (c * SPIN[0] - s * SPIN[1], s * SPIN[0] + c * SPIN[1], SPIN[2])
    falls = (RATES[0], RATES[1], RATES[2] - G * LASTS)
    middle = [0.5 * (a + b) for a, b in zip(RATES, falls, strict=True)]
    moments = np.array([A, A, C])
    keeps = _matrix(np.array(TURN)) @ (moments * SPIN)
    pairs = (
        ("q", q[:3], [a + LASTS * b for a, b in zip(PLACE, middle, strict=True)], 1.0), ("v", v[:3], falls, 1.0),
        ("w", v[3:], spin, 1.0), ("momentum", _matrix(q[3:]) @ (moments * v[3:]), keeps, C),
    )  # fmt: skip
    for what, found_, must, size in pairs:
        for k, (one, wanted) in enumerate(zip(np.array(found_).tolist(), np.array(must).tolist(), strict=True)):
            if not abs(one - wanted) <= off * size:
                most = off * size
                yield f"{engine.name}:{profile} ({what}{k + 1})", one, (wanted - most, wanted + most), "a top in flight"


def _matrix(q: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) of a quaternion."""
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])  # fmt: skip
