"""A recorded motion at other times than its samples, and the smooth pieces that it consists of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.splines import integral, straight, through
from crossbody.cases.trajectory import Trajectory

CROSSINGS = 3
PARTS = 16  # points looked at from each sample to the next
KEPT = 10_000  # samples of a piece whose cubics are kept, at most


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
    parts, smooth = _smooth(run)
    starts = np.array([run.t[a] for a, _ in parts])
    known: dict[int, Callable[[Floats], Floats]] = {}

    def piece(i: int) -> Callable[[Floats], Floats]:
        if i in known:
            return known[i]
        some = _samples(run, *parts[i])
        found = _piece(run.t[some], columns[some], smooth)
        return known.setdefault(i, found) if len(some) <= KEPT else found

    def at(times: Floats) -> Trajectory:
        times = np.asarray(times, dtype=np.float64)
        again = np.concatenate([[False], times[1:] == times[:-1]])
        left, right = (np.searchsorted(starts, times, side=side) - 1 for side in ("left", "right"))
        which = np.clip(np.where(again, right, left), 0, None)
        out = np.empty((len(times), columns.shape[1]))
        for i in distinct(which):
            out[which == i] = piece(int(i))(times[which == i])
        q, v, gap, lam, energy = np.split(out, np.cumsum(width)[:-1], axis=1)
        modes = np.array([run.mode[parts[i][0]] for i in which], dtype=np.int8).reshape(len(times), -1)
        return replace(run, t=times, q=q, v=v, gap=gap, lam=lam, energy=energy, mode=modes, ledger=None)

    return at


def integrals(run: Trajectory, values: Floats) -> Callable[[Floats], Floats]:
    """Return what gives, at times (m,), the integrals (m, k) since the start of values (n, k) at the samples.

    Of the splines of the same smooth pieces, so that steps of a sixth of a pulse leave 1e-5 of its impulse.
    """
    parts, smooth = _smooth(run)
    some = [_samples(run, *part) for part in parts]
    ends = np.array([run.t[one[-1]] for one in some])
    whole = [_integral(run.t[one], values[one], run.t[one[-1:]], smooth)[0] for one in some]
    before = np.cumsum([np.zeros(values.shape[1]), *whole], axis=0)

    def at(times: Floats) -> Floats:
        which = np.clip(np.searchsorted(ends, times), 0, len(ends) - 1)
        found = before[which]
        for i in distinct(which):
            found[which == i] += _integral(run.t[some[i]], values[some[i]], times[which == i], smooth)
        return found

    return at


def _smooth(run: Trajectory) -> tuple[list[tuple[int, int]], bool]:
    """Return samples at which smooth pieces begin and those behind their ends, and whether splines join them."""
    twice = run.t[1:] == run.t[:-1]
    cuts = np.flatnonzero(twice | (run.mode[1:] != run.mode[:-1]).any(axis=1)) + 1
    return list(zip([0, *cuts], [*cuts, len(run.t)], strict=True)), bool(len(cuts)) or bool((run.mode >= 0).any())


def _samples(run: Trajectory, first: int, behind: int) -> NDArray[np.intp]:
    """Return the samples of a piece, each instant once, with the one behind it at which its mode has changed."""
    some = np.arange(first, behind + (behind < len(run.t) and run.t[behind] > run.t[behind - 1]))
    once: NDArray[np.intp] = some[np.append(True, np.diff(run.t[some]) > 0.0)]
    return once


def multipliers(run: Trajectory) -> Floats | None:
    """Lam (m, nc) at the samples and between them, by splines within events; None if lam is not known."""
    if np.isnan(run.lam).any():
        return None
    cuts = np.linspace(0.0, 1.0, PARTS, endpoint=False)
    inside = run.t[:-1, None] + np.diff(run.t)[:, None] * cuts
    return np.concatenate([run.lam, between(run)(distinct(inside)).lam])


def _integral(t: Floats, values: Floats, times: Floats, smooth: bool) -> Floats:
    """Return integrals (m, k) from the first sample of a piece to times (m,), by a spline or trapezoids."""
    if len(t) == 1:
        return np.zeros((len(times), values.shape[1]))
    if smooth:
        return integral(t, values, times)
    sums = np.cumsum(0.5 * np.diff(t)[:, None] * (values[1:] + values[:-1]), axis=0)
    return straight(t, np.concatenate([np.zeros((1, values.shape[1])), sums]), times)


def _piece(t: Floats, values: Floats, smooth: bool) -> Callable[[Floats], Floats]:
    """Return what gives values (m, k) of a piece at times (m,), by splines of what is finite or by straight lines."""
    finite = np.isfinite(values).all(axis=0) & (smooth and len(t) > 2)
    curve = through(t, values[:, finite]) if finite.any() else None

    def at(times: Floats) -> Floats:
        if len(t) == 1:
            return np.repeat(values, len(times), axis=0)
        out = np.empty((len(times), values.shape[1]))
        out[:, ~finite] = straight(t, values[:, ~finite], times)
        if curve is not None:
            out[:, finite] = curve(np.clip(times, t[0], t[-1]))
        return out

    return at
