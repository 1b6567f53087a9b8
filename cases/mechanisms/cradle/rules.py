"""What comes out of Newton's cradle under each collision rule, by name.

Compliant chains and the memoryless machine push each other for a while: those are integrated.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.cradle.motion import Motion, delassus, pushes
from crossbody.cases.mechanisms.cradle.scene import Row

RTOL, ATOL = 1e-12, 1e-14
SHUT = 1e-11
"""A gap below this part of speed/w is closed for the memoryless law: rounding must not open what rests."""
MAX_STEPS = 200_000

Force = Callable[[Floats, Floats], Floats]
LARGEST = 20  # balls up to which chains are integrated directly
_INTEGRATED = ("linear", "hertz", "memoryless")
_ELASTIC = ("linear", "hertz")


def linear(row: Row) -> Floats:
    """Speeds behind a chain of linear springs without damping (n,), m/s; NaN if they do not part."""
    stiffness = _reduced(row.masses)
    return _speeds(row, lambda h, _rate: stiffness * np.maximum(-h, 0.0))


def hertz(row: Row) -> Floats:
    """Speeds behind a chain of elastic spheres (Hertz 1882) (n,), m/s; NaN if they do not part."""
    stiffness = 1.25 * _reduced(row.masses)
    return _speeds(row, lambda h, _rate: stiffness * np.maximum(-h, 0.0) ** 1.5)


def memoryless(row: Row) -> Floats:
    """Speeds under the memoryless law at the row's own gap, a0 and zeta (n,), m/s; NaN if they stay."""
    G = delassus(row.masses)

    def force(h: Floats, rate: Floats) -> Floats:
        shut = np.flatnonzero(h <= SHUT)
        lam = np.zeros_like(h)
        if len(shut):
            lam[shut] = pushes(G[np.ix_(shut, shut)], (2.0 * row.zeta * rate + h)[shut])
        return lam

    return _speeds(row, force)


def _reduced(masses: Floats) -> Floats:
    """Reduced mass of each pair (n - 1,), kg."""
    return masses[:-1] * masses[1:] / (masses[:-1] + masses[1:])


def _speeds(row: Row, force: Force) -> Floats:
    """Integrate until every gap is open and none closes; speeds (n,), m/s.

    The force gives those of all pairs (n - 1,) from gaps and rates in scaled units (masses stay in
    kg).
    """
    n, gap = row.n, row.gap * math.sqrt(row.a0) / row.speed

    def slope(_t: float, y: Floats) -> Floats:
        lam = force(gap + np.diff(y[:n]), np.diff(y[n:]))
        push = np.concatenate([[0.0], lam]) - np.concatenate([lam, [0.0]])
        return np.concatenate([y[n:], push / row.masses])

    y = np.concatenate([np.zeros(n), row.v0 / row.speed])
    budget = MAX_STEPS
    while budget > 0:
        wait = _flight(gap + np.diff(y[:n]), np.diff(y[n:]))
        if math.isinf(wait):
            return row.speed * y[n:]
        y[:n] += wait * y[n:]
        y, used = _pressed(slope, y, gap)
        budget -= used
    return np.full(n, np.nan)


def _flight(h: Floats, rate: Floats) -> float:
    """Time until some gap closes if nothing acts now; infinite if none will."""
    closing = rate < -SHUT
    return float(np.min(np.maximum(h[closing], 0.0) / -rate[closing], initial=math.inf))


def _pressed(slope: Callable[[float, Floats], Floats], y: Floats, gap: float) -> tuple[Floats, int]:
    """From a touch until all gaps are open again; the state there and the number of steps."""
    from scipy.integrate import DOP853  # which takes longer to import than most runs

    n = len(y) // 2
    solver = DOP853(slope, 0.0, y, math.inf, rtol=RTOL, atol=ATOL, max_step=0.1)
    for steps in range(1, MAX_STEPS + 1):
        solver.step()
        if solver.status == "failed":
            break
        if np.all(gap + np.diff(solver.y[:n]) > SHUT) or _rests(solver.y, gap):
            return solver.y.copy(), steps
    return solver.y.copy(), MAX_STEPS


def _rests(y: Floats, gap: float) -> bool:
    """Whether what still touches neither presses nor closes."""
    h, rate = gap + np.diff(y[: len(y) // 2]), np.diff(y[len(y) // 2 :])
    return bool(np.all((h > SHUT) | ((h >= -SHUT) & (np.abs(rate) <= SHUT))))


def sequential(row: Row) -> Floats:
    """Speeds behind one collision after another (n,), m/s; exact."""
    return Motion(row, "sequential").final


def simultaneous(row: Row) -> Floats:
    """Speeds if all collide at once, as if touching (n,), m/s; exact. Equal masses: (2 - n)/n, 2/n, ..."""
    return Motion(replace(row, gap=0.0), "simultaneous").final


def block(row: Row) -> Floats:
    """Speeds if the balls that strike are one body and those that are struck another (n,), m/s; exact."""
    k, m = row.lifted, row.masses
    a, b = float(m[:k].sum()), float(m[k:].sum())
    v = row.speed * a / (a + b)
    apart = row.e * row.speed
    return np.where(np.arange(row.n) < k, v - apart * b / (a + b), v + apart * a / (a + b))


RULES: dict[str, Callable[[Row], Floats]] = {
    "sequential": sequential,
    "simultaneous": simultaneous,
    "block": block,
    "linear": linear,
    "hertz": hertz,
    "memoryless": memoryless,
}


def answer(name: str, row: Row) -> Floats | None:
    """Speeds under one of `RULES` (n,), m/s; None where it has no answer."""
    if (name in _INTEGRATED and row.n > LARGEST) or (name in _ELASTIC and row.zeta > 0.0):
        return None
    return _cached(name, row.masses.tobytes(), row.lifted, row.speed, row.gap, row.a0, row.zeta)


@cache
def _cached(name: str, masses: bytes, lifted: int, speed: float, gap: float, a0: float, zeta: float) -> Floats | None:
    row = Row(masses=np.frombuffer(masses), lifted=lifted, speed=speed, gap=gap, a0=a0, zeta=zeta)
    found = RULES[name](row)
    found.setflags(write=False)
    return found if np.all(np.isfinite(found)) else None
