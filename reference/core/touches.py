"""What touches with friction give out beyond what they took in: the law moves gaps whatever friction does to loads.

A touch lasts from a closed gap to an open one. Three things are no gain of friction's: what a start in penetration
hands out, what a load does above the surface before it lets go, and what the tolerance leaves open.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import is_active
from crossbody.reference.core.friction import has_friction, is_dry
from crossbody.reference.core.layout import FREE, Model, Work
from crossbody.reference.kinds import Bytes


@compiled
def _begin(s: Any, w: Work, i: int, gap: float) -> None:
    """Note what the account of row i is where it touches, with what a penetration there will hand out."""
    w.touch_work[i] = w.z[i] + 0.5 * max(w.lam0[i], 0.0) * max(-gap, 0.0)
    w.touch_open[i] = s.energy_added
    w.deepest[i], w.taken_in[i] = 0.0, 0.0


@compiled
def _end(s: Any, w: Work, i: int, gap: float) -> None:
    """Count the touch of row i that ends at a gap, if it gave out more than it took in.

    Without friction a spring takes in, down to a depth, as many times what it hands out above the surface as the square
    of that is larger.
    """
    gain = w.z[i] - w.touch_work[i]
    above = w.taken_in[i] * (gap / w.deepest[i]) ** 2 if gap > 0.0 and w.deepest[i] < 0.0 else 0.0
    if gain > above + s.energy_added - w.touch_open[i]:
        s.touches_that_gained += 1
        s.energy_gained += gain
    w.touch_work[i] = np.inf


@compiled
def follow(s: Any, m: Model, w: Work, mode: Bytes) -> None:
    """Follow the work of contacts with friction through their touches; at the end of a step, or where modes settled."""
    for i in range(s.nc):
        if not has_friction(m, i) or is_dry(m, i):
            continue
        gap, touches = w.gaps[0, i], w.touch_work[i] < np.inf
        if is_active(mode[i]):
            if not touches:
                _begin(s, w, i, gap)
            if gap < w.deepest[i]:
                w.deepest[i], w.taken_in[i] = gap, max(w.touch_work[i] - w.z[i], 0.0)
        elif touches and mode[i] == FREE:
            _end(s, w, i, gap)
