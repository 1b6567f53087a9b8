"""A motion with samples between those of a solver that took long steps, so that its drawing is no polygon."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import rates

PIECES = 400  # into so many pieces a horizon is cut; shorter steps stay as they are


def filled(run: Trajectory, quaternions: Sequence[int] = (), pieces: int = PIECES) -> tuple[Floats, Floats]:
    """Return instants and coordinates: all samples, and in long steps those of `between`.

    Args:
        run: a motion; an instant that stands twice is never crossed.
        quaternions: first index in q of each.
        pieces: how many the horizon is cut into.

    Returns:
        t (m,) and q (m, nq).
    """
    t = run.t
    if len(t) < 2 or not _has_rates(run, quaternions):
        return t, run.q
    h = np.diff(t)
    count = np.maximum(np.ceil(h / ((t[-1] - t[0] or 1.0) / pieces)), 1.0).astype(int)
    i = np.repeat(np.arange(len(h)), count)
    x = (np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count)) / count[i]
    q = _cubics(run, quaternions, i, x)
    return np.append(t[i] + h[i] * x, t[-1]), np.concatenate([q, run.q[-1:]])


def between(run: Trajectory, instants: Floats, quaternions: Sequence[int] = ()) -> Floats:
    """Return coordinates (m, nq) at instants (m,), s, by the cubic through q and v of the samples beside (Hermite).

    With x = (t - a)/h in [0, 1]: q = (1 - x)^2 (1 + 2x) q_a + x^2 (3 - 2x) q_b + h x (1 - x)^2
    v_a - h x^2 (1 - x) v_b. It is exact for free flight; velocities must be the rates of the
    coordinates, but for the quaternions, whose rates follow from the angular velocities. Where
    velocities are not known lines take the place of cubics. Before and after a motion it rests.
    """
    t = run.t
    if len(t) < 2:
        return np.repeat(run.q, len(instants), axis=0)
    if not _has_rates(run, quaternions):
        return np.stack([np.interp(instants, t, column) for column in run.q.T], axis=1)
    i = np.clip(np.searchsorted(t, instants, side="right") - 1, 0, len(t) - 2)
    i -= (t[i + 1] == t[i]) & (i > 0)  # an instant that stands twice at the end
    h = t[i + 1] - t[i]
    x = np.divide(instants - t[i], h, out=np.ones_like(h), where=h > 0.0)
    return _cubics(run, quaternions, i, np.clip(x, 0.0, 1.0))


def _has_rates(run: Trajectory, quaternions: Sequence[int]) -> bool:
    """Whether velocities of all coordinates are known."""
    v = rates(run.q, run.v, quaternions)
    return v.shape == run.q.shape and bool(np.isfinite(run.q).all() and np.isfinite(v).all())


def _cubics(run: Trajectory, quaternions: Sequence[int], i: NDArray[np.intp], part: Floats) -> Floats:
    """Coordinates at parts of the steps that begin at samples i."""
    q, v, x = run.q, rates(run.q, run.v, quaternions), part[:, None]
    step, y = np.diff(run.t)[i, None], 1.0 - x
    found: Floats = (
        y * y * (1 + 2 * x) * q[i] + x * x * (3 - 2 * x) * q[i + 1] + step * x * y * (y * v[i] - x * v[i + 1])
    )
    return found
