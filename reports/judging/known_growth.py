"""How errors grow, of motions in closed form, in any unit of time: by them limits become wider."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from crossbody.cases.defaults import shortest
from crossbody.reports.judging.asked import Found
from crossbody.reports.judging.truth import grown

SAME = 1e-9
SHORT, BRIEF = 1e-6, 0.1
"""By how much instants may be off, s, and the horizon below which it is as much of that less, s."""
HORIZONS, RATES, OFF = (1e-3, 0.7, 90.0), (0.3, 2.0, 9.0), 3e-5
"""Horizons, s, growth rates over them, and by what a start is off."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return what growth is, least and most, and of what, where it is another one than the closed form's."""
    return tuple(
        ("growth", found, ((1.0 - SAME) * wanted, (1.0 + SAME) * wanted), said)
        for found, wanted, said in _asked() if not abs(found - wanted) <= SAME * wanted
    )  # fmt: skip


def _asked() -> Iterator[tuple[float, float, str]]:
    for end in HORIZONS:
        yield shortest(end), SHORT * min(1.0, end / BRIEF), f"what instants of {end:g} s may be off by"
        t = np.linspace(0.0, end, 50)
        yield float(grown(t, OFF * t, OFF)[-1]), 1.0, f"free flight for {end:g} s"
        yield float(grown(t, OFF * t * (end - t), OFF)[-1]), float(np.max(t * (end - t))) / end, "what comes back"
        for rate in np.divide(RATES, end):
            found = grown(t, OFF * np.sinh(rate * t) / rate, OFF)
            for k in (10, -1):
                wanted = float(np.sinh(rate * t[k]) / (rate * end))
                yield float(found[k]), wanted, f"a balance that falls with {rate:g} /s for {end:g} s"
