"""What metrics must say that ask a case for its equations: of sliders, which fit into a line.

Sliders with the masses m have the gaps h_i = g + q_(i+1) - q_i, so

    G = [[1/m_0 + 1/m_1, -1/m_1], [-1/m_1, 1/m_1 + 1/m_2]]

Motions are drawn at random: they obey no law, so each number is one that no other sum gives.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody import cases
from crossbody.cases import Case, Event, Ledger, Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.judging.asked import Asked, Found, unlike_by
from crossbody.reports.judging.known_answers import measured
from crossbody.reports.measuring.truth import Truth

EXACT = 1e-9
"""Part of an answer by which sums in another order differ."""
SEED, SAMPLES = 23, 25
MASSES, GAP, A0 = (0.4, 0.3, 0.2), 1e-3, 2e6
"""Of sliders: kg, m and 1/s^2."""
ZETA = 0.03
"""Damping ratio of sliders whose law is asked for."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return metric, number, least and most, and of what, where it is another one."""
    return unlike_by((_sliders, _residuals), "equations", "sliders, which end in", EXACT, 0.0)


def said(names: dict[str, float], what: str, runs: tuple[Trajectory, Trajectory], case: Case) -> Iterator[Asked]:
    """Yield metric, of what, what it says of the second of two motions beside the first, and what it must."""
    truth = Truth(
        tier=Tier.A, source="made up", trajectory=runs[0], at=lambda t: replace(runs[0], t=t), agreement={},
        touches=case.law.touches,
    )  # fmt: skip
    for name, wanted in names.items():
        found = measured(name, truth, runs[1], case)
        yield name, what, np.nan if found is None else found, wanted


def _case(**more: float) -> Case:
    masses = ",".join(map(str, MASSES))
    return cases.load("newtons_cradle", "sliders", n=3, gap=GAP, a0=A0, collisions="resolved", masses=masses, **more)


def _sliders() -> Iterator[Asked]:
    """Yield what rows that are switched on and off, one and both, make of energy by what their springs hold."""
    case = _case()
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
    yield from said({
        "energy_switching": jumps / most,
        "energy_switching_error": abs(jumps - float(book.contact[-1].sum())) / most,
    }, "sliders that are switched", (run, run), case)  # fmt: skip
    for deep in (0, 1, 2):
        yield from said({"violated_modes": float(deep)}, f"{deep} rows below their surfaces", *_below(case, deep, t))


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


def _residuals() -> Iterator[Asked]:
    """Yield how far energies, gaps and multipliers of a motion are from those of its states, both rows in contact."""
    case, draw = _case(zeta=ZETA), np.random.default_rng(SEED)
    q, v, lam = (
        draw.normal(scale=GAP, size=(SAMPLES, 3)),
        draw.normal(size=(SAMPLES, 3)),
        draw.normal(size=(SAMPLES, 2)),
    )
    gap, energy = draw.normal(scale=GAP, size=(SAMPLES, 2)), draw.uniform(1.0, 2.0, (SAMPLES, 2))
    run = Trajectory(
        t=np.linspace(0.0, 1.0, SAMPLES), q=q, v=v, gap=gap, lam=lam, energy=energy,
        mode=np.full((SAMPLES, 2), int(Mode.CONTACT), dtype=np.int8),
    )  # fmt: skip
    h, kinetic = GAP + np.diff(q, axis=1), 0.5 * (v**2 @ np.array(MASSES))
    law = _through_masses(-(case.law.a1 * np.diff(v, axis=1) + A0 * h))
    yield from said({
        "energy_residual": float(max(np.abs(energy[:, 0] - kinetic).max() / kinetic.max(), energy[:, 1].max())),
        "gap_residual": float(np.abs(gap - h).max() / np.abs(h).max()),
        "law_residual": float(np.abs(lam - law).max() / np.abs(law).max()),
    }, "sliders in contact", (run, run), case)  # fmt: skip


def _through_masses(push: Floats) -> Floats:
    """Return G^-1 x of each x (n, 2)."""
    a, b, c = (1.0 / m for m in MASSES)
    det = (a + b) * (b + c) - b * b
    return np.stack([(b + c) * push[:, 0] + b * push[:, 1], b * push[:, 0] + (a + b) * push[:, 1]], axis=1) / det


def _held(h: Floats, on: list[bool]) -> float:
    """Return a0/2 h G^-1 h of the rows that are on, J."""
    a, b, c = (1.0 / m for m in MASSES)
    if all(on):
        return 0.5 * A0 * float(h @ _through_masses(h[None])[0])
    return 0.5 * A0 * float(h[0] ** 2 / (a + b) if on[0] else h[1] ** 2 / (b + c) if on[1] else 0.0)
