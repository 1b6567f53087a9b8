"""How fast friction turns a slip into its own direction, and what a turn makes of the multipliers."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.coulomb import factor_as_held, respond
from crossbody.reference.core.directions import lengthened
from crossbody.reference.core.friction import has_begun, has_friction
from crossbody.reference.core.layout import Model, Work

POWERS = 8  # of the matrix of turns, to know its fastest pole


@compiled
def _across(m: Model, w: Work, i: int) -> tuple[float, float]:
    """Across the direction of slip of contact i: its part along both tangential rows."""
    first = w.listed[m.tangent[i]]
    return -w.along[first + 1], w.along[first]


@compiled
def _turning_slip(s: Any, m: Model, w: Work, i: int) -> float:
    """Size of the slip velocity at the step's start by which contact i turns."""
    t = m.tangent[i]
    x, y = w.rates[0, t] - m.drift[t] - w.rest[t], w.rates[0, t + 1] - m.drift[t + 1] - w.rest[t + 1]
    x, y = lengthened(s, m, w, i, x, y)
    return float(np.sqrt(x * x + y * y))


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
    if count > 0 and s.dependent_rows > 0:
        factor_as_held(s, m, w)  # its place is used by others
    for b in range(count):
        part = turn_part(s, m, w, w.turning[b])
        for a in range(count):
            c, (x, y), total = w.listed[m.tangent[w.turning[a]]], _across(m, w, w.turning[a]), 0.0
            for k in range(s.na):
                total += (x * w.gram[c, k] + y * w.gram[c + 1, k]) * w.la[k]
            w.turns[a, b] = part * total
    return _spectral_radius(w, count)


@compiled
def turn_part(s: Any, m: Model, w: Work, i: int) -> float:
    """Fill w.la with what a turn of the slip of contact i by one radian makes of all multipliers; 1/|v_t|, or 0.

    Times the slip velocity across it is the turn. w.lam0 has the multipliers of the present instant.
    """
    size = _turning_slip(s, m, w, i) if w.slides[i] and m.tangents[i] > 1 else 0.0
    if not size > 0.0:
        return 0.0
    c, (x, y) = w.listed[m.tangent[i]], _across(m, w, i)
    force = -m.friction[i] * w.lam0[i]
    for j in range(s.na):
        w.r[j] = -force * (w.gram[j, c] * x + w.gram[j, c + 1] * y)
    respond(s, m, w, w.r, w.la)
    w.la[c] += force * x
    w.la[c + 1] += force * y
    return float(1.0 / size)
