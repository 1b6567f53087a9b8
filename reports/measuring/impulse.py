"""Which multipliers a run shows, and their impulse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.trajectory import Event, Trajectory

SAME = 1e-7  # part of the horizon within which a sample and a collision are at one instant


def away(exact: Trajectory, instants: Sequence[float], t_end: float) -> NDArray[np.bool_]:
    """Samples of a truth (n,) not at one of the instants, where a sample does not say on which side."""
    nearest = [np.abs(exact.t - t) for t in instants]
    return np.min(nearest, axis=0) > SAME * t_end if nearest else np.ones(len(exact.t), dtype=bool)


def cumulative(run: Trajectory) -> Floats:
    """INT lam dt by the trapezoidal rule (n, nc), N s."""
    pieces = 0.5 * np.diff(run.t)[:, None] * (run.lam[1:] + run.lam[:-1])
    return np.concatenate([np.zeros((1, run.lam.shape[1])), np.cumsum(pieces, axis=0)])


def with_collisions(run: Trajectory, events: Sequence[Event]) -> Floats:
    """The same with the impulses of collisions that took no time (n, nc), N s.

    Args:
        run: its multipliers; of several samples at the instant of a collision the last is behind it.
        events: those of the motion, in the run's time.
    """
    total = cumulative(run)
    for event in events:
        if event.impulse:
            first, behind = (int(np.searchsorted(run.t, event.t, side=side)) for side in ("left", "right"))
            total[max(first, behind - 1) :, event.contact] += event.impulse
    return total


def true_impulse(run: Trajectory, exact: Trajectory, whole: Trajectory) -> Floats:
    """Return the cumulative impulse of the truth beside samples of a run (m, nc), N s.

    By the same rule over the same samples, so that the error of the rule cancels. A run whose collisions take no
    time has too few samples for the forces of a truth whose collisions take some: there the truth's own count.

    Args:
        run: whose collisions may take no time.
        exact: the truth at its samples.
        whole: the truth at its own.
    """
    if not any(event.impulse for event in run.events) or any(event.impulse for event in whole.events):
        return with_collisions(exact, whole.events)
    own = with_collisions(whole, whole.events)
    return np.stack([np.interp(exact.t, whole.t, row) for row in own.T], axis=1)


def stopping(run: Trajectory) -> NDArray[np.bool_]:
    """Samples (n,) at which a slip stops or turns, and still slides: its friction may have any direction there.

    A slip that dies out may turn within nanoseconds, and its friction with it, and what others bear.
    """
    found = np.zeros(len(run.t), dtype=np.bool_)
    for event in run.events:
        if event.before == Mode.SLIP and event.after in (Mode.SLIP, Mode.STICK):
            found |= (run.t == event.t) & (run.mode[:, event.contact] == Mode.SLIP)
    return found


def before_stops(run: Trajectory, exact: Trajectory) -> tuple[Trajectory, Trajectory]:
    """Return a run and the truth beside it with the multipliers of the sample before where a slip stops or turns.

    What friction is at that instant tells nothing of the step before it, for half of which the sample would stand.
    """
    samples = 1 + np.flatnonzero(stopping(run)[1:])
    return _held(run, samples), _held(exact, samples)


def _held(run: Trajectory, samples: NDArray[np.intp]) -> Trajectory:
    """Return a motion with the multipliers of the sample before each of these (n,), which are in order."""
    lam = run.lam.copy()
    for i in samples[samples < len(lam)].tolist():
        lam[i] = lam[i - 1]
    return replace(run, lam=lam)


def told(run: Trajectory) -> NDArray[np.bool_] | None:
    """Which rows have multipliers (nc,); None if lam is not known.

    Of rows that are always on and follow from others lam is NaN from the first sample to the last.
    """
    unknown = np.isnan(run.lam)
    follow = unknown.all(axis=0) & np.all(run.mode == Mode.BILATERAL, axis=0)
    known = not unknown[:, ~follow].any() and not (follow.any() and follow.all())
    return ~follow if known else None
