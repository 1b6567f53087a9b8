"""Coordinates between samples of a run, by cubics through q and v of the samples beside (Hermite).

With x = (t - a)/h in [0, 1]

    q = (1 - x)^2 (1 + 2 x) q_a + x^2 (3 - 2 x) q_b + h x (1 - x)^2 v_a - h x^2 (1 - x) v_b

which is exact for free flight. Velocities must be the rates of the coordinates, but for the quaternions, whose rates
follow from the angular velocities.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import rates
from crossbody.cases.splines import straight


def rates_of(run: Trajectory, quaternions: Sequence[int] = ()) -> Floats | None:
    """Return the rates of all coordinates at the samples (n, nq); None where they are not known.

    Args:
        run: a motion.
        quaternions: first index in q of each.
    """
    v = rates(run.q, run.v, quaternions)
    return v if v.shape == run.q.shape and np.isfinite(run.q).all() and np.isfinite(v).all() else None


def step_of(t: Floats, instants: Floats) -> NDArray[np.intp]:
    """Return which step between samples t (n,), of at least two, each instant (m,) is in.

    At an instant that stands twice it is the later one; at the end one that has a length, if there is any.
    """
    i: NDArray[np.intp] = np.clip(np.searchsorted(t, instants, side="right") - 1, 0, len(t) - 2)
    i -= (t[i + 1] == t[i]) & (i > 0)
    return i


def coordinates(run: Trajectory, instants: Floats, quaternions: Sequence[int] = ()) -> Floats:
    """Return coordinates (m, nq) at instants (m,), s; where rates are not known by lines instead of cubics.

    Before and after a motion it rests.
    """
    t, q = run.t, run.q
    if len(t) < 2:
        return np.repeat(q, len(instants), axis=0)
    if (v := rates_of(run, quaternions)) is None:
        return straight(t, q, instants)
    i = step_of(t, instants)
    h = (t[i + 1] - t[i])[:, None]
    x = np.clip(np.divide(instants[:, None] - t[i, None], h, out=np.ones_like(h), where=h > 0.0), 0.0, 1.0)
    y = 1.0 - x
    found: Floats = y * y * (1 + 2 * x) * q[i] + x * x * (3 - 2 * x) * q[i + 1] + h * x * y * (y * v[i] - x * v[i + 1])
    return found
