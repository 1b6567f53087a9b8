"""What metrics must say that ask a case for its equations: of sliders, and of a ball over a floor with friction.

Their equations fit into a line each. Sliders with the masses m have the gaps h_i = g + q_(i+1) - q_i, so

    G = [[1/m_0 + 1/m_1, -1/m_1], [-1/m_1, 1/m_1 + 1/m_2]]

A ball of the mass m that does not turn slips at its velocity along the floor, and its normal force is m (g - a1 v_z -
a0 z). Motions are drawn at random: they obey no law, so each number is one that no other sum gives.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from crossbody import cases
from crossbody.cases import Case, Event, Ledger, Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.reports.judging.known_answers import measured
from crossbody.reports.judging.planted import Range
from crossbody.reports.measuring.truth import Truth

EXACT = 1e-9
"""Part of an answer by which sums in another order differ."""
SEED, SAMPLES = 23, 25
MASSES, GAP, A0 = (0.4, 0.3, 0.2), 1e-3, 2e6
"""Of sliders: kg, m and 1/s^2."""
MASS, GRAVITY, RADIUS, MU = 1.7, 9.81, 0.2, 0.37
LAW = RowLaw(a0=3e3, a1=40.0)
"""Of a ball and its floor."""
Found = tuple[str, float, Range, str]


@cache
def wrong() -> tuple[Found, ...]:
    """Return metric, number, least and most, and of what, where it is another one."""
    return tuple(
        (name, found, (wanted, wanted), what)
        for name, what, found, wanted in (*_sliders(), *_ball()) if not abs(found - wanted) <= EXACT * abs(wanted)
    )  # fmt: skip


def _said(names: dict[str, float], what: str, runs: tuple[Trajectory, Trajectory], case: Case) -> Iterator[Any]:
    """Yield metric, of what, what it says of the second of two motions beside the first, and what it must."""
    truth = Truth(
        tier=Tier.A, source="made up", trajectory=runs[0], at=lambda t: replace(runs[0], t=t), agreement={},
        touches=case.law.touches,
    )  # fmt: skip
    for name, wanted in names.items():
        found = measured(name, truth, runs[1], case)
        yield name, what, np.nan if found is None else found, wanted


def _sliders() -> Iterator[tuple[str, str, float, float]]:
    """Yield what rows that are switched on and off, one and both, make of energy by what their springs hold."""
    case = cases.load(
        "newtons_cradle", "sliders", n=3, gap=GAP, a0=A0, collisions="resolved", masses=",".join(map(str, MASSES))
    )
    draw, t = np.random.default_rng(SEED), np.linspace(0.0, 1.0, SAMPLES)
    q, on = np.cumsum(draw.uniform(-2.0, 0.5, (SAMPLES, 3)) * GAP, axis=1), [False, False]
    at, energy = np.sort(draw.uniform(0.1, 0.9, 4)), draw.uniform(1.0, 2.0, (SAMPLES, 2))
    rows = (0, 1, 0, 1)
    jumps, events = 0.0, []
    for when, row in zip(at.tolist(), rows, strict=True):
        h = GAP + np.diff([np.interp(when, t, one) for one in q.T])
        before, on[row] = _held(h, on), not on[row]
        jumps += _held(h, on) - before
        modes = (Mode.FREE, Mode.CONTACT) if on[row] else (Mode.CONTACT, Mode.FREE)
        events.append(Event(t=when, contact=row, before=modes[0], after=modes[1]))
    book = Ledger(contact=draw.normal(size=(SAMPLES, 2)), input=np.zeros(SAMPLES), dissipated=np.zeros(SAMPLES))
    run = Trajectory(
        t=t, q=q, v=draw.normal(size=q.shape), gap=GAP + np.diff(q, axis=1), lam=draw.normal(size=(SAMPLES, 2)),
        energy=energy, mode=np.zeros((SAMPLES, 2), dtype=np.int8), events=tuple(events), ledger=book,
    )  # fmt: skip
    most = float(energy[:, 0].max())
    yield from _said({
        "energy_switching": jumps / most,
        "energy_switching_error": abs(jumps - float(book.contact[-1].sum())) / most,
    }, "sliders that are switched", (run, run), case)  # fmt: skip
    for deep in (0, 1, 2):
        yield from _said({"violated_modes": float(deep)}, f"{deep} rows below their surfaces", *_below(case, deep, t))


def _below(case: Case, deep: int, t: Floats) -> tuple[tuple[Trajectory, Trajectory], Case]:
    """Return a motion at rest, twice, with some rows below their surfaces though nothing pushes, and its case."""
    apart = np.where(np.arange(2) < deep, -2.0, 1.0) * GAP
    q = np.tile([0.0, *np.cumsum(apart)], (len(t), 1))
    none = np.zeros((len(t), 2))
    run = Trajectory(
        t=t,
        q=q,
        v=0.0 * q,
        gap=GAP + np.diff(q, axis=1),
        lam=none,
        energy=none,
        mode=none.astype(np.int8),
        steps=len(t),
    )
    return (run, run), case


def _held(h: Floats, on: list[bool]) -> float:
    """Return a0/2 h G^-1 h of the rows that are on, J."""
    a, b, c = (1.0 / m for m in MASSES)
    if all(on):
        det = (a + b) * (b + c) - b * b
        return 0.5 * A0 * float((b + c) * h[0] ** 2 + 2.0 * b * h[0] * h[1] + (a + b) * h[1] ** 2) / det
    return 0.5 * A0 * float(h[0] ** 2 / (a + b) if on[0] else h[1] ** 2 / (b + c) if on[1] else 0.0)


def _floor() -> Case:
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


def _ball() -> Iterator[tuple[str, str, float, float]]:
    truth, run = _motion(SEED), replace(_motion(SEED + 1), t=_motion(SEED).t)
    normal, force, slip = run.lam[:, 0], run.lam[:, 1:], run.v[:, :2]
    size, speed = (np.sqrt((one**2).sum(axis=1)) for one in (force, slip))
    power, slides = (force * slip).sum(axis=1), run.mode[:, 0] == Mode.SLIP
    off = np.arccos(-power / (size * speed))[slides]
    impulses, works = (
        np.abs(_integrals(run.t, a) - _integrals(run.t, b)).max()
        for a, b in ((force, truth.lam[:, 1:]), (power, (truth.lam[:, 1:] * truth.v[:, :2]).sum(axis=1)))
    )
    energy = 0.5 * MASS * (run.v**2).sum(axis=1), MASS * GRAVITY * (run.q[:, 2] + RADIUS)
    apart = [np.abs(a - b).max() / np.abs(b).max() for a, b in zip(run.energy.T, energy, strict=True)]
    gaps = np.zeros((SAMPLES, 3))
    gaps[:, 0] = run.q[:, 2]
    yield from _said({
        "cone_violation": float((size - MU * normal).max() / (MU * normal).max()), "creep_speed": float(speed[-1]),
        "friction_angle": float(off.max()), "friction_power": float(power.max()), "friction_impulse": float(impulses),
        "friction_work": float(works), "energy_residual": float(max(apart)),
        "gap_residual": float(np.abs(run.gap - gaps).max() / np.abs(gaps).max()),
    }, "a ball that slips", (truth, run), _floor())  # fmt: skip
    some = replace(run, mode=np.where(np.arange(SAMPLES)[:, None] % 3 == 0, int(Mode.FREE), int(Mode.SLIP))
                   * np.ones(3, dtype=np.int8))  # fmt: skip
    closed = some.mode[:, 0] == Mode.SLIP
    law = MASS * (GRAVITY - LAW.a1 * run.v[:, 2] - LAW.a0 * run.q[:, 2])
    worst = max(np.abs(normal - law)[closed].max(), np.abs(size - MU * normal)[closed].max())
    yield from _said(
        {"law_residual": float(worst / np.abs(law[closed]).max())}, "a ball that slips or flies", (truth, some),
        _floor(),
    )  # fmt: skip


def _integrals(t: Floats, values: Floats) -> Floats:
    """Return the integrals of values (n, ...) from the start to each sample, by trapezoids."""
    found = [np.zeros(values.shape[1:])]
    for i in range(1, len(t)):
        found.append(found[-1] + 0.5 * (t[i] - t[i - 1]) * (values[i - 1] + values[i]))
    return np.array(found)
