"""A way to a consistent set of modes on which no contact ever bears more than it can.

From multipliers that every contact can bear, those of a set are approached until a contact reaches its bound, or comes
to pull. It begins to slide, or lets go, and the way goes on from there. Where all can bear a set's multipliers the
contact that violates its mode most changes it. So active-set methods find the least of a convex function (Stark and
Parker, Comput. Statist. 10 (1995)), which dry friction alone is: with every change it falls. Rows that nearly depend on
each other, whose multipliers are huge as long as all of them stick, do not lead it astray.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.friction import bound, decided_to, is_decided, is_dry
from crossbody.reference.core.layout import FREE, SLIP, STICK, Model, Work
from crossbody.reference.core.mode_search import change, goes_on, judge, sweep
from crossbody.reference.core.mode_set import first_row, size_along

CHANGES = 12  # of modes on the way, for every contact
WHOLE = 1.0  # of the way to a set's multipliers,
LEAST = 1e-12  # and what is gone at least: a contact that bears nothing has no direction to slide in


@compiled
def _part_inside(at: float, slope: float, square: float) -> float:
    """The first root in [0, 1] of at + slope x + square x^2, which is not positive at 0 and positive at 1."""
    root = np.sqrt(max(slope * slope - 4.0 * square * at, 0.0))
    part = -2.0 * at / (slope + root) if slope > 0.0 else (root - slope) / (2.0 * square)
    return float(min(max(part, LEAST), WHOLE))


@compiled
def _part_held(m: Model, w: Work, i: int) -> float:
    """How far on the way contact i, which sticks, bears less than its bound; it bears more at the end."""
    j = w.listed[i]
    before, after = bound(m, i, w.borne[j]), bound(m, i, w.la[j])
    at, slope, square = -before * before, -2.0 * before * (after - before), -((after - before) ** 2)
    for c in range(first_row(m, w, i), first_row(m, w, i) + m.tangents[i]):
        step = w.la[c] - w.borne[c]
        at, slope, square = at + w.borne[c] ** 2, slope + 2.0 * w.borne[c] * step, square + step * step
    return _part_inside(min(at, 0.0), slope, square)


@compiled
def _first_to_yield(s: Any, m: Model, w: Work) -> tuple[int, int, float]:
    """The contact that first cannot bear its multipliers on the way, -1 for none; its mode then, and that part."""
    found, becomes, part = -1, FREE, WHOLE
    for j in range(s.na):
        i = w.idx[j]
        if not is_decided(w, i) or w.state[i] == FREE:
            continue
        if not is_dry(m, i) and -w.la[j] * w.gram[j, j] > decided_to(s):
            pulls = max(w.borne[j], 0.0) / (max(w.borne[j], 0.0) - w.la[j])
            if found < 0 or pulls < part:
                found, becomes, part = int(i), FREE, pulls
        elif w.state[i] == STICK:
            over = size_along(m, w, i, w.la) - bound(m, i, max(w.la[j], 0.0))
            if over * w.gram[j, j] > decided_to(s):
                held = _part_held(m, w, i)
                if found < 0 or held < part:
                    found, becomes, part = int(i), SLIP, held
    return found, becomes, part


@compiled
def _go(s: Any, w: Work, part: float) -> None:
    """Go a part of the way to the multipliers of the set, and take those there for its own."""
    for j in range(s.na):
        w.borne[j] += part * (w.la[j] - w.borne[j])
        w.la[j] = w.borne[j]


@compiled
def approached(s: Any, m: Model, w: Work) -> bool:
    """Whether a consistent set is found on a way on which all can bear their multipliers, from what sweeps give."""
    sweep(s, m, w)
    changes = 0
    for j in range(s.na):
        w.borne[j] = w.la[j]
        changes += CHANGES * is_decided(w, w.idx[j])
    for _ in range(changes):
        worst = judge(s, m, w)
        if worst < 0:
            return goes_on(s, m, w)
        i, becomes, part = _first_to_yield(s, m, w)
        _go(s, w, part)
        if i < 0:
            i, becomes = worst, int(w.wants[worst])
        change(m, w, i, becomes)
    return False
