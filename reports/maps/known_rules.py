"""What rules of Newton's cradle must make of a row of balls, each written out here in another way.

Chains of springs are integrated by Runge-Kutta 4 at steps of their own, in one piece from the touch to the end; what
strikes once and is over is a sum. Lengths and times of a chain are in scaled units, of which no speed at its end knows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise

import numpy as np

from crossbody.cases.mechanisms.cradle.rules import RULES
from crossbody.cases.mechanisms.cradle.scene import Row
from crossbody.reports.judging.asked import Found, Within, unlike

MASSES, SPEED, A0 = (0.4, 0.3, 0.17, 0.2), 1.7, 4e4
"""Of the balls, kg; of the first of them, m/s; and of their contacts, 1/s^2."""
DAMPED = 0.2
STEP, LASTS = 0.02, 9.0
"""Of a chain, in scaled time, and until it has parted."""
EXACT, STEPPED = 1e-9, 1e-5
"""Part of the speed by which a sum may be off, and steps of a chain whose forces have a kink."""
Force = Callable[[float], float]


@cache
def wrong() -> tuple[Found, ...]:
    """Return what, number, least and most, and of what, where it is another one."""
    return unlike((_chains, _in_turn, _together, _damped), "rule of a cradle", "balls that end in")


def _row(count: int, gap: float = 0.0, zeta: float = 0.0) -> Row:
    return Row(masses=np.array(MASSES[:count]), lifted=1, speed=SPEED, gap=gap, a0=A0, zeta=zeta)


def _said(rule: str, row: Row, wanted: list[float], off: float) -> Iterator[Within]:
    for k, (found, must) in enumerate(zip(RULES[rule](row).tolist(), wanted, strict=True)):
        yield f"speed of ball {k}", f"a row by the rule {rule}", found, must, off * SPEED


def _chain(masses: tuple[float, ...], force: Force) -> list[float]:
    """Return the speeds behind a chain that touches, m/s, each pair's force as its reduced mass has it."""
    n = len(masses)
    stiff = [a * b / (a + b) for a, b in pairwise(masses)]

    def slope(y: list[float]) -> list[float]:
        push = [0.0, *(k * force(max(y[i] - y[i + 1], 0.0)) for i, k in enumerate(stiff)), 0.0]
        return [*y[n:], *((push[i] - push[i + 1]) / masses[i] for i in range(n))]

    y = [0.0] * n + [1.0] + [0.0] * (n - 1)
    for _ in range(round(LASTS / STEP)):
        first = slope(y)
        second = slope([a + 0.5 * STEP * b for a, b in zip(y, first, strict=True)])
        third = slope([a + 0.5 * STEP * b for a, b in zip(y, second, strict=True)])
        last = slope([a + STEP * b for a, b in zip(y, third, strict=True)])
        parts = zip(y, first, second, third, last, strict=True)
        y = [a + STEP * (b + 2.0 * c + 2.0 * d + e) / 6.0 for a, b, c, d, e in parts]
    return [SPEED * v for v in y[n:]]


def _chains() -> Iterator[Within]:
    yield from _said("linear", _row(4), _chain(MASSES, lambda depth: depth), STEPPED)
    yield from _said("hertz", _row(4), _chain(MASSES, lambda depth: depth * math.sqrt(depth)), STEPPED)


def _struck(v: list[float], k: int, e: float) -> list[float]:
    """Return speeds behind a collision of ball k and its right neighbour."""
    a, b = MASSES[k], MASSES[k + 1]
    apart = (1.0 + e) * (v[k] - v[k + 1]) / (a + b)
    return [*v[:k], v[k] - b * apart, v[k + 1] + a * apart, *v[k + 2 :]]


def _in_turn() -> Iterator[Within]:
    """Yield what comes out of one collision after another, until none closes."""
    v = [SPEED, 0.0, 0.0, 0.0]
    while closing := [k for k in range(3) if v[k] > v[k + 1]]:
        v = _struck(v, closing[0], 1.0)
    yield from _said("sequential", _row(4, 1e-3), v, EXACT)


def _together() -> Iterator[Within]:
    """Yield speeds where all contacts keep their speeds, or the first ball meets the others as one body."""
    m, rest = MASSES[0], sum(MASSES[1:])
    away = 2.0 * m * SPEED / (m + rest)
    yield from _said("block", _row(4), [away - SPEED, *[away] * 3], EXACT)
    # The contact that strikes turns its speed round, and those that rest stay at rest: the same as one body.
    yield from _said("simultaneous", _row(4), [away - SPEED, *[away] * 3], EXACT)


def _damped() -> Iterator[Within]:
    """Yield what two balls make of a contact that lets go when it pulls: a wave that decays."""
    e = math.exp(-DAMPED / math.sqrt(1.0 - DAMPED**2) * math.acos(2.0 * DAMPED**2 - 1.0))
    for rule in ("sequential", "memoryless"):
        yield from _said(rule, _row(2, 1e-3, DAMPED), _struck([SPEED, 0.0], 0, e), EXACT)
