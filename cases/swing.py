"""Period of what swings."""

from __future__ import annotations

import numpy as np

from crossbody.cases.arrays import Floats

CROSSINGS = 3


def period(t: Floats, x: Floats) -> float | None:
    """Return the mean time between upward crossings of x = 0, s; None if there are fewer than `CROSSINGS`.

    Args:
        t (n,): s.
        x (n,): what swings about 0.
    """
    i = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    if len(i) < CROSSINGS:
        return None
    crossed = t[i] - x[i] * (t[i + 1] - t[i]) / (x[i + 1] - x[i])
    return float(crossed[-1] - crossed[0]) / (len(i) - 1)
