"""How fast friction turns a slip into its own direction, and what a turn makes of the multipliers."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.coulomb import factor_as_held, respond
from crossbody.reference.core.directions import bend
from crossbody.reference.core.friction import has_begun, has_friction
from crossbody.reference.core.layout import Model, Work

TURN = 1e-5  # rad, of a direction by differences
POWERS = 8  # of the matrix of turns, to know its fastest pole


@compiled
def _bend(s: Any, m: Model, w: Work, i: int) -> bool:
    """Fill w.bent with how the direction of contact i turns with its slip velocity, at the step's start; if it does."""
    t = m.tangent[i]
    if not w.slides[i] or m.tangents[i] == 1:
        return False
    x, y = w.rates[0, t] - m.drift[t] - w.rest[t], w.rates[0, t + 1] - m.drift[t + 1] - w.rest[t + 1]
    w.bent[t], w.bent[t + 1] = bend(s, m, w, i, x, y)
    return bool(w.bent[t] != 0.0 or w.bent[t + 1] != 0.0)


@compiled
def _spectral_radius(w: Work, count: int) -> float:
    """Return the size of the largest eigenvalue of w.turns by the power method, from what turns itself most."""
    x, y, size = w.turn_by, w.trial, 0.0
    for a in range(count):
        x[a] = 0.0
        size = max(size, abs(w.turns[a, a]))
    for a in range(count):
        if abs(w.turns[a, a]) == size:
            x[a] = 1.0
            break
    for _ in range(POWERS if size > 0.0 else 0):
        total = 0.0
        for a in range(count):
            y[a] = 0.0
            for b in range(count):
                y[a] += w.turns[a, b] * x[b]
            total += y[a] * y[a]
        size = np.sqrt(total)
        for a in range(count):
            x[a] = y[a] / size if size > 0.0 else 0.0
    return float(size)


@compiled
def turning_rate(s: Any, m: Model, w: Work, begun: bool) -> float:
    """Fastest rate, 1/s, at which friction turns slips into their own directions, those that have `begun` or all.

    From the last evaluation and what stands at the step's start. It grows without bound as a slip dies out, by
    mu lam_n / |v_t| over the mass there; near a jam a turn also changes how contacts press on each other, by far more.
    """
    count = 0
    for i in range(s.nc):
        if has_friction(m, i) and w.slides[i] and m.tangents[i] > 1 and (not begun or has_begun(w, i)):
            w.turning[count] = i
            count += 1
            _bend(s, m, w, i)
    if count > 0 and s.short > 0:
        factor_as_held(s, m, w)  # its place is used by others
    for b in range(count):
        turns = turn_part(s, m, w, w.turning[b])
        for a in range(count):
            t = m.tangent[w.turning[a]]
            c, total = w.listed[t], 0.0
            for k in range(s.na if turns else 0):
                total += (w.bent[t] * w.gram[c, k] + w.bent[t + 1] * w.gram[c + 1, k]) * w.la[k]
            w.turns[a, b] = total
    return _spectral_radius(w, count)


@compiled
def turn_part(s: Any, m: Model, w: Work, i: int) -> bool:
    """Fill w.la with what a turn of contact i by one radian makes of all multipliers; whether its slip turns it at all.

    By how much it does stands in w.bent. w.lam0 has the multipliers of the present instant.
    """
    if not _bend(s, m, w, i):
        return False
    if s.short > 0:
        _turn_dependent(s, m, w, w.listed[m.tangent[i]])
        return True
    c = w.listed[m.tangent[i]]
    x, y = -w.along[c + 1], w.along[c]
    force = -m.friction[i] * w.lam0[i]
    for j in range(s.na):
        w.r[j] = -force * (w.gram[j, c] * x + w.gram[j, c + 1] * y)
    respond(s, m, w, w.r, w.la)
    w.la[c] += force * x
    w.la[c + 1] += force * y
    return True


@compiled
def _turn_dependent(s: Any, m: Model, w: Work, c: int) -> None:
    """Fill w.la with what a turn of the direction in places c and c + 1 does, by differences of what was last solved.

    A load that is shared among rows that depend on each other is shared in other parts once a direction has turned.
    """
    x, y = w.along[c], w.along[c + 1]
    for side in range(2):
        turn = TURN if side == 0 else -TURN
        w.along[c], w.along[c + 1] = x - turn * y, y + turn * x
        factor_as_held(s, m, w)
        respond(s, m, w, w.pushed, w.la)
        for j in range(s.na):
            w.turn_by[j] = w.la[j] if side == 0 else (w.turn_by[j] - w.la[j]) / (2.0 * TURN)
    w.along[c], w.along[c + 1] = x, y
    factor_as_held(s, m, w)
    for j in range(s.na):
        w.la[j] = w.turn_by[j]
