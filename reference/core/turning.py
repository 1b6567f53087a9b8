"""How fast friction turns a slip into its own direction, and what a turn makes of the multipliers."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.coulomb import respond
from crossbody.reference.core.directions import lengthened
from crossbody.reference.core.friction import has_begun, has_friction
from crossbody.reference.core.layout import Model, Work


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
def turning_rate(s: Any, m: Model, w: Work, begun: bool) -> float:
    """Fastest rate, 1/s, at which friction turns a slip into its own direction: mu lam_n / |v_t| over the mass there.

    From the last evaluation and what stands at the step's start. It grows without bound as a slip dies out.
    """
    fastest = 0.0
    for i in range(s.nc):
        if has_friction(m, i) and w.slides[i] and m.tangents[i] > 1 and (not begun or has_begun(w, i)):
            c, (x, y), size = w.listed[m.tangent[i]], _across(m, w, i), _turning_slip(s, m, w, i)
            light = x * x * w.gram[c, c] + 2.0 * x * y * w.gram[c, c + 1] + y * y * w.gram[c + 1, c + 1]
            if size > 0.0:
                fastest = max(fastest, m.friction[i] * w.lam0[i] * light / size)
    return float(fastest)


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
