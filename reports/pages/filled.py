"""A motion with samples between those of a solver that took long steps, so that its drawing is no polygon."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crossbody.cases import Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.measuring.cubics import coordinates, rates_of

PIECES = 400  # into so many pieces a horizon is cut; shorter steps stay as they are


def filled(run: Trajectory, quaternions: Sequence[int] = (), pieces: int = PIECES) -> tuple[Floats, Floats]:
    """Return instants and coordinates: all samples, and in long steps the cubics between, where rates are known.

    Args:
        run: a motion; an instant that stands twice is never crossed.
        quaternions: first index in q of each.
        pieces: how many the horizon is cut into.

    Returns:
        t (m,) and q (m, nq).
    """
    t = run.t
    if len(t) < 2 or rates_of(run, quaternions) is None:
        return t, run.q
    h = np.diff(t)
    count = np.maximum(np.ceil(h / ((t[-1] - t[0] or 1.0) / pieces)), 1.0).astype(int)
    i = np.repeat(np.arange(len(h)), count)
    x = (np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count)) / count[i]
    instants = np.append(t[i] + h[i] * x, t[-1])
    return instants, coordinates(run, instants, quaternions)
