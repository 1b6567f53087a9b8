"""A recorded motion at other times than its samples, and the smooth pieces that it consists of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.splines import spline
from crossbody.cases.trajectory import Trajectory

CROSSINGS = 3
PARTS = 16  # points looked at from each sample to the next


def pieces(starts: Floats, t: Floats) -> NDArray[np.intp]:
    """Index of the piece of each time (n,): before an end, and behind it if the time stands again.

    Times are nondecreasing, as are the `starts` of pieces, s.
    """
    again = np.concatenate(([False], t[1:] == t[:-1]))
    before = np.searchsorted(starts, t, side="left") - 1
    after = np.searchsorted(starts, t, side="right") - 1
    return np.clip(np.where(again, after, before), 0, None)


def period(t: Floats, x: Floats) -> float | None:
    """Return the mean time between upward crossings of x(t) = 0, s; None below `CROSSINGS` of them."""
    i = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    if len(i) < CROSSINGS:
        return None
    crossed = t[i] - x[i] * (t[i + 1] - t[i]) / (x[i + 1] - x[i])
    return float(crossed[-1] - crossed[0]) / (len(i) - 1)


def between(run: Trajectory) -> Callable[[Floats], Trajectory]:
    """A function of time: cubic splines on every smooth piece, never across an event.

    Pieces end where an instant stands twice or where a mode changes; a run that knows neither is
    joined by straight lines, because a spline rings at an impact.
    """
    width = [run.q.shape[1], run.v.shape[1], run.gap.shape[1], run.lam.shape[1], 2]
    columns = np.concatenate([run.q, run.v, run.gap, run.lam, run.energy], axis=1)
    twice = run.t[1:] == run.t[:-1]
    cuts = np.flatnonzero(twice | (run.mode[1:] != run.mode[:-1]).any(axis=1)) + 1
    smooth = bool(len(cuts)) or bool((run.mode >= 0).any())
    pieces = list(zip([0, *cuts], [*cuts, len(run.t)], strict=True))
    starts = np.array([run.t[a] for a, _ in pieces])

    def at(times: Floats) -> Trajectory:
        times = np.asarray(times, dtype=np.float64)
        again = np.concatenate([[False], times[1:] == times[:-1]])
        left, right = (np.searchsorted(starts, times, side=side) - 1 for side in ("left", "right"))
        which = np.clip(np.where(again, right, left), 0, None)
        out = np.empty((len(times), columns.shape[1]))
        for i in distinct(which):
            a, b = pieces[i]
            stop = min(b + 1, len(run.t)) if b < len(run.t) and run.t[b] > run.t[b - 1] else b
            out[which == i] = _piece(run.t[a:stop], columns[a:stop], times[which == i], smooth)
        q, v, gap, lam, energy = np.split(out, np.cumsum(width)[:-1], axis=1)
        modes = np.array([run.mode[pieces[i][0]] for i in which], dtype=np.int8).reshape(len(times), -1)
        return replace(run, t=times, q=q, v=v, gap=gap, lam=lam, energy=energy, mode=modes, ledger=None)

    return at


def multipliers(run: Trajectory) -> Floats | None:
    """Lam (m, nc) at the samples and between them, by splines within events; None if lam is not known."""
    if np.isnan(run.lam).any():
        return None
    cuts = np.linspace(0.0, 1.0, PARTS, endpoint=False)
    inside = run.t[:-1, None] + np.diff(run.t)[:, None] * cuts
    return np.concatenate([run.lam, between(run)(distinct(inside)).lam])


def _piece(t: Floats, values: Floats, times: Floats, smooth: bool) -> Floats:
    keep = np.concatenate([[True], np.diff(t) > 0.0])
    t, values = t[keep], values[keep]
    if len(t) == 1:
        return np.repeat(values, len(times), axis=0)
    out = np.stack([np.interp(times, t, column) for column in values.T], axis=1)
    finite = np.isfinite(values).all(axis=0)
    if smooth and len(t) > 2 and finite.any():
        out[:, finite] = spline(t, values[:, finite], np.clip(times, t[0], t[-1]))
    return out
