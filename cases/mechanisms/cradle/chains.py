"""Balls on a line that push each other for a while, by direct integration: compliant chains and the memoryless law.

    linear        F = mu a0 d                        springs; mu is the reduced mass of the pair
    Hertz         F = k d^(3/2)                      k such that the first pair alone would get as deep as with springs
    memoryless    h'' + a1 h' + a0 h >= 0, lam >= 0, lam . (...) = 0 over all h <= 0 (docs/explanation/model.md)

d = max(0, -h). Units of the integration: 1/w for time, speed/w for length, w = sqrt(a0). When every gap
is open and opening nothing acts any more: the speeds there are final, no instant has to be located.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import DOP853

from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.cradle.impact import delassus, pushes
from crossbody.cases.mechanisms.cradle.scene import Row

RTOL, ATOL = 1e-12, 1e-14
SHUT = 1e-11
"""A gap below this part of speed/w is closed for the memoryless law: rounding must not open what rests."""
MAX_STEPS = 200_000

Force = Callable[[Floats, Floats], Floats]


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

    Args:
        row: the balls.
        force: forces of all pairs (n - 1,) from gaps and rates in scaled units (masses stay in kg).
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
