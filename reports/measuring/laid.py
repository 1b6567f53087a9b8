"""Which touches of a run are laid on the truth's: those that bring the motions nearer.

An impact that comes late by dt leaves twice the speed of the rebound times dt between two motions that are the same
but for that: the clock of the run is stretched until it stands at the truth's. But all else that moves is off then by
its own speed times dt. Of a box that slides, and comes upon its floor a nanometre below in the first step of an engine
and in the first microseconds of the truth, that is all that it is off by. So at every touch a clock either stands at
the truth's or goes as time does, and from one to the next it is straight. Clocks by which positions or velocities are
anywhere farther from the truth than they are somewhere at equal times are none; time itself is always one. Of the
others that one is taken whose largest errors of both, as parts of those at equal times, are least in sum; and of those
the one whose arcs are nearest in sum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.between import pieces
from crossbody.reports.measuring.apart import errors
from crossbody.reports.measuring.impulse import away
from crossbody.reports.measuring.scale import scale_of, scale_of_rates
from crossbody.reports.measuring.truth import Truth, dense, taken

APART = 0.5
"""Part of what velocities are measured by from which on an error says that a sample is on the other side of an impact:
one that is larger is no farther."""
BOUNDS = 25
"""So many bounds on errors of positions are tried, at most, for how small those of velocities can be below them."""
ROUNDING = 1e-12
"""Part of the horizon by which two instants differ that are one but for rounding."""
TOLD = 1e-9
"""Errors below this part of what they are measured by are what runs at the tolerance of limits are off by anyhow."""


@dataclass(frozen=True, slots=True)
class Laid:
    """Which touches a clock is laid on.

    Attributes:
        at (k,): instants of touches in the truth, s, rising; the first is its start.
        on (k,): whether the clock stands at the truth's there.
    """

    at: Floats
    on: NDArray[np.bool_]

    def of(self, there: Floats) -> NDArray[np.bool_]:
        """Return whether touches of a truth at instants (m,), s, are laid: each as the nearest one that is told of."""
        behind = np.clip(np.searchsorted(self.at, there), 1, max(len(self.at) - 1, 1))
        after = np.minimum(behind, len(self.at) - 1)
        nearest = np.where(there - self.at[behind - 1] < self.at[after] - there, behind - 1, after)
        return self.on[nearest]


def straight(t: Floats, here: Floats, there: Floats) -> Floats:
    """Return the clock (n,) that shows `there` (k,) at a run's instants `here` (k,), and goes as time does behind.

    Where both are the same it shows t itself: a rounding more, and the last sample would be behind the truth's end.
    """
    shown = np.interp(t, here, there) + np.maximum(t - here[-1], 0.0)
    return np.where(np.interp(t, here, there - here) == 0.0, t, shown)


def nearest(truth: Truth, run: Trajectory, case: Case, here: Floats, there: Floats) -> Laid:
    """Return which touches bring a run nearest to a truth.

    Args:
        truth: what the run is laid beside.
        run: with samples.
        case: by which errors are measured.
        here: instants (k,) of the start and of touches in the run, s, rising.
        there: those of the truth.
    """
    laid = np.ones(len(here), dtype=bool)
    if np.max(np.abs(here - there)) > ROUNDING * case.t_end and len(run.t):
        largest = _largest(truth, run, case, here, there)
        plain = np.maximum(largest[:, 1, 1].max(axis=0), TOLD)
        if np.isfinite(plain).all():
            laid = _least(np.maximum(largest, TOLD) / plain)
    return Laid(at=there, on=laid)


def _largest(truth: Truth, run: Trajectory, case: Case, here: Floats, there: Floats) -> Floats:
    """Return the largest errors of positions and velocities on arcs (k, 2, 2, 2).

    Of each arc by whether the touch before it is left out, and the one behind it; infinite where time would not rise.
    Samples count that are known by all of these clocks: none is nearer because less of it is compared.
    """
    found, arcs, lasts = np.empty((len(here), 2, 2, 2)), pieces(here, run.t), np.append(np.diff(here), np.inf) > 0.0
    ways = {
        (i, j): (left, np.append(right[1:], np.inf))
        for i, left in enumerate((there, here)) for j, right in enumerate((there, here))
    }  # fmt: skip
    shown = {way: _shown(run.t, arcs, here, *ends) for way, ends in ways.items()}
    known = np.max(list(shown.values()), axis=0) <= min(float(truth.trajectory.t[-1]), truth.trusted)
    exact, run = truth.at(straight(run.t, here, there)[known]), taken(run, known)
    near = {way: dense(truth.trajectory)(t[known]) for way, t in shown.items()}
    for way, (left, right) in ways.items():
        found[:, *way] = _errors(truth, run, _moved(exact, near[0, 0], near[way]), case, here)
        found[(left > right) | ((left == right) & lasts), *way] = np.inf  # touches at one instant have no time between
    # Before the first touch and behind the last one both clocks are the same; steps that reach into them are not.
    found[0] = found[0].min(axis=0)
    found[-1] = found[-1].min(axis=1, keepdims=True)
    return found


def _moved(exact: Trajectory, here: Trajectory, there: Trajectory) -> Trajectory:
    """Return a truth at other instants than those at which it was asked for, by how it moves between: n samples.

    What splines of it are off by is the same at both, but for as much of it as they are apart.
    """
    return replace(there, q=exact.q + (there.q - here.q), v=exact.v + (there.v - here.v))


def _shown(t: Floats, arcs: NDArray[np.intp], here: Floats, left: Floats, right: Floats) -> Floats:
    """Return what clocks show (n,) that go straight from `left` (k,) to `right` (k,) on each arc, as time on the last.

    An instant that stands twice is shown the second time just behind itself, however its arc begins.
    """
    ends = np.append(here[1:], np.inf)
    last = np.isinf(ends)
    pace = np.where(last, 1.0, (np.where(last, 0.0, right) - left) / np.where(last, 1.0, ends - here))
    shown = np.where(t == ends[arcs], right[arcs], left[arcs] + pace[arcs] * (t - here[arcs]))
    again = np.append(False, t[1:] == t[:-1])
    return np.where(again, np.nextafter(shown, np.inf), shown)


def _errors(truth: Truth, run: Trajectory, exact: Trajectory, case: Case, here: Floats) -> Floats:
    """Return the largest errors of positions and of velocities on each arc (k, 2), as their metrics measure them."""
    found = np.zeros((len(here), 2))
    if not len(run.t):
        return found
    off, t = errors(truth, run, exact, case)
    worst = np.max(off / scale_of(truth.trajectory, case), axis=1, initial=0.0)
    np.maximum.at(found[:, 0], pieces(here, t), _known(worst))
    smooth = away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)
    rates = np.abs(run.v - exact.v)[smooth] / scale_of_rates(truth.trajectory, case)
    np.maximum.at(
        found[:, 1], pieces(here, run.t)[smooth], np.minimum(_known(np.max(rates, axis=1, initial=0.0)), APART)
    )
    return found


def _known(sizes: Floats) -> Floats:
    """Return sizes of errors; of what is no number, as of what is infinitely far off, no clock brings it nearer."""
    return np.where(np.isnan(sizes), np.inf, sizes)


def _least(parts: Floats) -> NDArray[np.bool_]:
    """Return which touches (k,) are laid where the largest errors of both kinds are least together, then their sum.

    Args:
        parts: errors of positions and velocities on arcs (k, 2, 2, 2), as parts of the largest at equal times, than
            which none may be larger.
    """
    ways = np.where((parts > 1.0).any(axis=3, keepdims=True), np.inf, parts)
    most, _ = _path(ways[..., 0], np.maximum)
    bounds = distinct(ways[..., 0][(ways[..., 0] >= most) & (ways[..., 0] <= 1.0)])
    told = []
    for bound in bounds[np.linspace(0, len(bounds) - 1, min(len(bounds), BOUNDS)).astype(np.intp)]:
        fast, _ = _path(np.where(ways[..., 0] <= bound, ways[..., 1], np.inf), np.maximum)
        told.append((bound + fast, bound, fast))
    _, bound, fast = min(told)
    near = (ways[..., 0] <= bound) & (ways[..., 1] <= fast)
    return _path(np.where(near, ways.sum(axis=3), np.inf), np.add)[1]


def _path(costs: Floats, join: Callable[[Floats, Floats], Floats]) -> tuple[float, NDArray[np.bool_]]:
    """Return the least cost of all ways through arcs (k, 2, 2), as costs join, and which touches (k,) it lays.

    By dynamic programming (Bellman 1957). Of ways that cost the same the one that lays the later touch.
    """
    so_far, came = np.array([0.0, np.inf]), np.zeros((len(costs), 2), np.intp)
    for k, cost in enumerate(costs):  # so_far[i]: up to a touch that is laid, or left out
        ways = join(so_far[:, None], cost)
        came[k] = np.argmin(ways, axis=0)
        so_far = ways.min(axis=0)
    left, laid = 0, np.ones(len(costs), dtype=bool)
    for k in reversed(range(len(costs))):
        left = came[k, left]
        laid[k] = left == 0
    return float(so_far[0]), laid
