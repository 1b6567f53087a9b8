"""Directions in which contacts slide: those of their slips, or of reference where these vanish."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.friction import has_friction, small_slip
from crossbody.reference.core.layout import Model, Work


@compiled
def lengthened(s: Any, m: Model, w: Work, i: int, x: float, y: float) -> tuple[float, float]:
    """Return the slip velocity (x, y) of contact i, one that is small or points back lengthened along its reference.

    So its direction changes steadily to that of reference where it vanishes, and is never more than a right angle off
    it: a jump would end every step. Clear of zero and ahead it is left as it is.
    """
    t = m.tangent[i]
    p, r = w.way[t], w.way[t + 1]
    aside = y * p - x * r
    ahead = max(x * p + y * r, _least_ahead(s, w, i, aside))
    return ahead * p - aside * r, ahead * r + aside * p


@compiled
def _least_ahead(s: Any, w: Work, i: int, aside: float) -> float:
    """The least that the slip of contact i counts along its reference, by what it is across it."""
    small = small_slip(s, w, i)
    part = 1.0 - (aside / small) ** 2 if abs(aside) < small else 0.0
    return float(small * part * part)


@compiled
def bend(s: Any, m: Model, w: Work, i: int, x: float, y: float) -> tuple[float, float]:
    """Return by how many radians the direction of the slip velocity (x, y) of contact i turns with x, and with y."""
    t, small = m.tangent[i], small_slip(s, w, i)
    p, r = w.way[t], w.way[t + 1]
    ahead, aside, least = x * p + y * r, y * p - x * r, _least_ahead(s, w, i, y * p - x * r)
    along, across = -aside, ahead
    if ahead <= least:  # it is lengthened: what it is along its reference does not count
        falls = -4.0 * (1.0 - (aside / small) ** 2) * aside / small if abs(aside) < small else 0.0
        along, across, ahead = 0.0, least - aside * falls, least
    size2 = ahead * ahead + aside * aside
    if not size2 > 0.0:
        return 0.0, 0.0
    return (along * p - across * r) / size2, (along * r + across * p) / size2


@compiled
def take_directions(s: Any, m: Model, w: Work, turning: bool) -> None:
    """Leave in w.along the direction in which every sliding contact slides, or that of reference."""
    for j in range(s.na):
        i = w.idx[j]
        if not has_friction(m, i) or not w.slides[i]:
            continue
        t, c = m.tangent[i], w.listed[m.tangent[i]]
        w.along[c] = w.way[t]
        if m.tangents[i] > 1:
            x, y = lengthened(s, m, w, i, w.hda[c] - w.rest[t], w.hda[c + 1] - w.rest[t + 1])
            size = np.sqrt(x * x + y * y)
            follows = turning and size > 0.0
            w.along[c], w.along[c + 1] = (x / size, y / size) if follows else (w.way[t], w.way[t + 1])
