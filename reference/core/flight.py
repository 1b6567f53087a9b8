"""Where a row touches in free flight in closed form: its gap is a parabola, and needs no search."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.guards import TOUCH, TOUCH_INSIDE
from crossbody.reference.core.layout import NEVER, NODES, Work
from crossbody.reference.core.machine import slow


@compiled
def _fall(h: float, rate: float, a: float) -> float:
    """Last time at which h + rate t + a t^2/2 falls to zero; 0 if it is below all along, infinite if it never falls."""
    square = rate * rate - 2.0 * a * h
    if square < 0.0:
        return np.inf if h > 0.0 else 0.0
    if rate < 0.0:
        return float(max(2.0 * h / (np.sqrt(square) - rate), 0.0))
    return float((rate + np.sqrt(square)) / -a) if a < 0.0 else np.inf


@compiled
def free_flight(s: Any, w: Work, i: int) -> float:
    """First touch of a FREE row in free flight, where its gap is a parabola: in closed form."""
    h, rate, end = w.gaps[0, i], w.rates[0, i], w.rates[NODES - 1, i]
    if h > s.touch and w.gaps[NODES - 1, i] > 0.0 and not rate < 0.0 < end:
        return NEVER  # most rows
    a = (end - rate) / s.hs
    if h > s.touch:
        w.kind[i] = TOUCH
        t = _fall(h, rate, a)
    else:
        w.kind[i] = TOUCH_INSIDE
        # at its turn; from rest clearly behind the threshold, so that rounding does not leave it where it was
        behind = 0.0 if rate > slow(s, w, i) else 1.5 * slow(s, w, i)
        closing = -(behind + rate) / a if a < 0.0 else np.inf
        t = max(_fall(h - s.touch, rate, a), closing)
    return float(t / s.hs) if t <= s.hs else NEVER
