"""Fewer points in a plot without losing what it shows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from tsdownsample import MinMaxLTTBDownsampler

from crossbody.cases.arrays import Floats, distinct

POINTS = 1500
BEFORE, AROUND = 5, 12  # samples that stay before an event, and in all


def keep(t: Floats, y: Floats, events: Floats, points: int = POINTS) -> NDArray[np.intp]:
    """Indices of the samples to draw: min-max and largest triangles (MinMaxLTTB), and all samples around events.

    Args:
        t: instants (n,), nondecreasing.
        y: the signal (n,).
        events: instants whose neighbouring samples all stay.
        points: how many stay besides.
    """
    if len(t) <= points:
        return np.arange(len(t))
    chosen = MinMaxLTTBDownsampler().downsample(t, np.nan_to_num(y), n_out=points).astype(np.intp)
    near = np.searchsorted(t, events)[:, None] + np.arange(-BEFORE, AROUND - BEFORE)
    kept: NDArray[np.intp] = distinct(chosen, near, [0, len(t) - 1])
    return kept[(kept >= 0) & (kept < len(t))]
