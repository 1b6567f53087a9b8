"""A motion with samples between those of a solver that took long steps, so that its drawing is no polygon."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crossbody.cases import Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import rates

PIECES = 400  # into so many pieces a horizon is cut; shorter steps stay as they are


def filled(run: Trajectory, quaternions: Sequence[int] = (), pieces: int = PIECES) -> tuple[Floats, Floats]:
    """Instants and coordinates: all samples, and in long steps the cubic through q and v at both ends (Hermite).

    With x = (t - a)/h in [0, 1]: q = (1 - x)^2 (1 + 2x) q_a + x^2 (3 - 2x) q_b + h x (1 - x)^2
    v_a - h x^2 (1 - x) v_b. It is exact for free flight; velocities must be the rates of the
    coordinates, but for the quaternions, whose rates follow from the angular velocities.

    Args:
        run: a motion; an instant that stands twice is never crossed.
        quaternions: first index in q of each.
        pieces: how many the horizon is cut into.

    Returns:
        t (m,) and q (m, nq).
    """
    t, q, v = run.t, run.q, rates(run.q, run.v, quaternions)
    if len(t) < 2 or q.shape != v.shape or not (np.isfinite(q).all() and np.isfinite(v).all()):
        return t, q
    h = np.diff(t)
    count = np.maximum(np.ceil(h / ((t[-1] - t[0] or 1.0) / pieces)), 1.0).astype(int)
    i = np.repeat(np.arange(len(h)), count)
    x = ((np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count)) / count[i])[:, None]
    step, y = h[i, None], 1.0 - x
    between = y * y * (1 + 2 * x) * q[i] + x * x * (3 - 2 * x) * q[i + 1] + step * x * y * (y * v[i] - x * v[i + 1])
    return np.append(t[i] + step[:, 0] * x[:, 0], t[-1]), np.concatenate([between, q[-1:]])
