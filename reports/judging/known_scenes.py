"""What metrics and audits must say that ask a scene for its equations: a ball on a floor with friction, and a cart.

Of runs of scenes, beside: the kernels of every scene take longer to compile than a run of a case that has its own.

A ball of the mass m that does not turn slips at its velocity along the floor, and its normal force is m (g - a1 v_z -
a0 z). Motions are drawn at random: they obey no law, so each number is one that no other sum gives.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody.cases import Acts, Case, Mode, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Actuator, Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.engines.equations import equations_of
from crossbody.reports.judging.asked import Asked, Found, Within, unlike, unlike_by
from crossbody.reports.judging.forces_of_scene import forces_against
from crossbody.reports.judging.known_equations import EXACT, SAMPLES, SEED, said

MASS, GRAVITY, RADIUS, MU = 1.7, 9.81, 0.2, 0.37
LAW = RowLaw(a0=3e3, a1=40.0)
"""Of a ball and its floor."""
LITTLE = 1e-6
"""By which a motor is off."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return metric or audit, number, least and most, and of what, where it is another one."""
    return (
        *unlike_by((_ball, _held), "equations", "a ball, which ends in", EXACT, 0.0),
        *unlike((_forces,), "audit", "an engine, which ends in"),
    )


def ball_on_a_floor() -> Case:
    """Return a ball that does not turn, on a floor with friction."""
    slides = zip("xyz", map(tuple, np.eye(3).tolist()), strict=True)
    return case_of(Scene(
        bodies=(Body(name="ball", mass=MASS, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0), position=(0.0, 0.0, RADIUS)),),
        joints=tuple(Joint(name=name, body="ball", type="slide", axis=way) for name, way in slides),
        shapes=(Shape(name="floor", type="plane", size=(1.0, 1.0, 1.0)),
                Shape(name="ball", body="ball", size=(RADIUS, 0.0, 0.0))),
        pairs=(Pair(name="a", first="floor", second="ball", dimension=3, friction=(MU, MU, 0.0, 0.0, 0.0), law=LAW),),
        gravity=(0.0, 0.0, -GRAVITY),
    ), name="made_up")  # fmt: skip


def _motion(seed: int) -> Trajectory:
    """Return a motion at random that slips in all samples but the last, where it sticks."""
    draw = np.random.default_rng(seed)
    t = np.cumsum(draw.uniform(0.5, 1.5, SAMPLES)) / SAMPLES
    t -= t[0]
    lam = draw.uniform(-40.0, 40.0, (SAMPLES, 3))
    lam[:, 0] = np.abs(lam[:, 0])
    mode = np.tile(np.array([[Mode.SLIP]], dtype=np.int8), (SAMPLES, 3))
    mode[-1] = Mode.STICK
    return Trajectory(
        t=t, q=draw.normal(size=(SAMPLES, 3)), v=draw.normal(size=(SAMPLES, 3)), gap=draw.normal(size=(SAMPLES, 3)),
        lam=lam, energy=draw.uniform(1.0, 9.0, (SAMPLES, 2)), mode=mode,
    )  # fmt: skip


def _ball() -> Iterator[Asked]:
    truth, run = _motion(SEED), replace(_motion(SEED + 1), t=_motion(SEED).t)
    normal, force, slip = run.lam[:, 0], run.lam[:, 1:], run.v[:, :2]
    size, speed = (np.sqrt((one**2).sum(axis=1)) for one in (force, slip))
    power, slides = (force * slip).sum(axis=1), run.mode[:, 0] == Mode.SLIP
    off = np.arccos(-power / (size * speed))[slides]
    impulses, works = (
        _integrals(run.t, a) - _integrals(run.t, b)
        for a, b in ((force, truth.lam[:, 1:]), (power, (truth.lam[:, 1:] * truth.v[:, :2]).sum(axis=1)))
    )
    impulse = float(np.sqrt((impulses**2).sum(axis=1)).max())
    energy = 0.5 * MASS * (run.v**2).sum(axis=1), MASS * GRAVITY * (run.q[:, 2] + RADIUS)
    apart = [np.abs(a - b).max() / np.abs(b).max() for a, b in zip(run.energy.T, energy, strict=True)]
    gaps = np.zeros((SAMPLES, 3))
    gaps[:, 0] = run.q[:, 2]
    yield from said({
        "cone_violation": float((size - MU * normal).max() / (MU * normal).max()), "creep_speed": float(speed[-1]),
        "friction_angle": float(off.max()), "friction_power": float(power.max()), "friction_impulse": impulse,
        "friction_work": float(np.abs(works).max()), "energy_residual": float(max(apart)),
        "gap_residual": float(np.abs(run.gap - gaps).max() / np.abs(gaps).max()),
    }, "a ball that slips", (truth, run), ball_on_a_floor())  # fmt: skip
    some = replace(run, mode=np.where(np.arange(SAMPLES)[:, None] % 3 == 0, int(Mode.FREE), int(Mode.SLIP))
                   * np.ones(3, dtype=np.int8))  # fmt: skip
    closed = some.mode[:, 0] == Mode.SLIP
    law = MASS * (GRAVITY - LAW.a1 * run.v[:, 2] - LAW.a0 * run.q[:, 2])
    worst = max(np.abs(normal - law)[closed].max(), np.abs(size - MU * normal)[closed].max())
    yield from said(
        {"law_residual": float(worst / np.abs(law[closed]).max())}, "a ball that slips or flies", (truth, some),
        ball_on_a_floor(),
    )  # fmt: skip


def _held() -> Iterator[Asked]:
    """Ask for impulse and work of friction that is told as means over steps."""
    truth = replace(_motion(SEED), acts=Acts.BEHIND)
    run = replace(_motion(SEED + 1), t=truth.t, acts=Acts.BEFORE)
    impulses, works = np.zeros((SAMPLES, 2)), np.zeros(SAMPLES)
    for i in range(1, SAMPLES):
        impulses[i], works[i] = impulses[i - 1], works[i - 1]
        for sign, motion, k in ((1.0, run, i), (-1.0, truth, i - 1)):
            pushed = sign * (truth.t[i] - truth.t[i - 1]) * motion.lam[k, 1:]
            impulses[i] += pushed
            works[i] += pushed @ (motion.v[i - 1, :2] + motion.v[i, :2]) / 2.0
    longest = float(np.sqrt((impulses**2).sum(axis=1)).max())
    yield from said(
        {"friction_impulse": longest, "friction_work": float(np.abs(works).max())},
        "a ball that slips in steps", (truth, run), ball_on_a_floor(),
    )  # fmt: skip


def _integrals(t: Floats, values: Floats) -> Floats:
    """Return the integrals of values (n, ...) from the start to each sample, by trapezoids."""
    found = [np.zeros(values.shape[1:])]
    for i in range(1, len(t)):
        found.append(found[-1] + 0.5 * (t[i] - t[i - 1]) * (values[i - 1] + values[i]))
    return np.array(found)


def _cart(gain: float = 3.0, most: float = 5.0, damping: float = 0.4) -> Case:
    body = Body(name="cart", mass=2.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    rail = Joint(name="rail", body="cart", type="slide", axis=(1.0, 0.0, 0.0), damping=(damping, 0.1, 0.2))
    motor = Actuator(
        name="motor", joint="rail", gain=(gain, 0.0, 0.0), bias=(0.0, -2.0, -0.1), force_range=(-4.0, most)
    )  # fmt: skip
    return case_of(Scene(bodies=(body,), joints=(rail,), actuators=(motor,)), name="cart", t_end=1.0)


def _forces() -> Iterator[Within]:
    """Yield how many rows say that equations have other forces than a scene."""
    case = _cart()
    more = 1.0 + LITTLE
    for what, other, told in (
        ("its own", case, 0), ("another gain", _cart(gain=3.0 * more), 1), ("another range", _cart(most=5.0 * more), 1),
        ("another damper", _cart(damping=0.4 * more), 1),
    ):  # fmt: skip
        found = sum(not row.ok for row in forces_against(case, equations_of(other)))
        yield "forces", f"a cart with {what}", float(found), float(told), 0.0
