"""Which multipliers a run shows, and their impulse."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Acts, Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.between import integrals
from crossbody.cases.splines import straight
from crossbody.cases.trajectory import Event, Trajectory

SAME = 1e-7  # part of the horizon within which a sample and a collision are at one instant


def away(exact: Trajectory, instants: Sequence[float], t_end: float) -> NDArray[np.bool_]:
    """Samples of a truth (n,) not at one of the instants, where a sample does not say on which side."""
    nearest = [np.abs(exact.t - t) for t in instants]
    return np.min(nearest, axis=0) > SAME * t_end if nearest else np.ones(len(exact.t), dtype=bool)


def cumulated(run: Trajectory, values: Floats, along: Floats | None = None) -> Floats:
    """Return the integrals (n, k) since the start of what acts as lam of a run does.

    By the trapezoidal rule; of means over steps by what they are. Over a step of constant force velocities change
    evenly, so that its work is exact with the mean of those at both ends.

    Args:
        run: its instants, and when lam acts.
        values: what acts (n, k).
        along: velocities (n, k) along which it does, for its work.
    """
    steps = np.diff(run.t)[:, None]
    if run.acts in (Acts.AT, Acts.GRID):
        product = values if along is None else values * along
        pieces = 0.5 * steps * (product[1:] + product[:-1])
    else:
        held = values[1:] if run.acts == Acts.BEFORE else values[:-1]
        pieces = steps * (held if along is None else held * 0.5 * (along[1:] + along[:-1]))
    return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(pieces, axis=0)])


def cumulative(run: Trajectory) -> Floats:
    """Return INT lam dt (n, nc), N s."""
    return cumulated(run, run.lam)


def with_collisions(run: Trajectory, events: Sequence[Event]) -> Floats:
    """Return the same with the impulses of collisions that took no time (n, nc), N s.

    Args:
        run: its multipliers; of several samples at the instant of a collision the last is behind it.
        events: those of the motion, in the run's time.
    """
    return collided(run.t, cumulative(run), events)


def collided(t: Floats, total: Floats, events: Sequence[Event]) -> Floats:
    """Return impulses (n, nc) at instants (n,), s, with those of collisions that took no time up to there."""
    total = total.copy()
    for event in events:
        if event.impulse:
            first, behind = (int(np.searchsorted(t, event.t, side=side)) for side in ("left", "right"))
            total[max(first, behind - 1) :, event.contact] += event.impulse
    return total


def counts_itself(run: Trajectory, whole: Trajectory) -> bool:
    """Whether the samples of a run are too few for the forces of a truth, which is then integrated over its own.

    Those of steps in time, whose forces act over a step, and those of collisions that take no time, where the truth's
    take some.
    """
    return run.acts != Acts.AT or (
        any(event.impulse for event in run.events) and not any(event.impulse for event in whole.events)
    )


Signal = Callable[[Trajectory], tuple[Floats, Floats | None]]
"""What acts in a motion (n, k), and along which velocities if its work is asked for."""


def beside(run: Trajectory, exact: Trajectory, whole: Trajectory, signal: Signal) -> Floats:
    """Return the integrals of a truth beside samples of a run (m, k).

    Over the same samples by the same rule, so that the error of the rule cancels; over its own where `counts_itself`.

    Args:
        run: what the truth is beside.
        exact: the truth at its samples.
        whole: the truth at its own.
        signal: what is integrated.
    """
    return integrated(whole, signal, exact.t) if counts_itself(run, whole) else cumulated(exact, *signal(exact))


def integrated(whole: Trajectory, signal: Signal, times: Floats) -> Floats:
    """Return the integrals of a truth since its start (m, k), over its own samples, up to times (m,), s."""
    # What slides on behind a turn is known there: only the side in front of an instant is held.
    whole = _held(whole, 1 + np.flatnonzero(stopping(whole)[1:] & (np.diff(whole.t) > 0.0)))
    values, along = signal(whole)
    if whole.acts == Acts.AT:
        return integrals(whole, values if along is None else values * along)(times)
    return straight(whole.t, cumulated(whole, values, along), times)


def true_impulse(run: Trajectory, exact: Trajectory, whole: Trajectory) -> Floats:
    """Return the cumulative impulse of the truth `beside` samples of a run (m, nc), N s, with its collisions."""
    return collided(exact.t, beside(run, exact, whole, multipliers), whole.events)


def multipliers(motion: Trajectory) -> tuple[Floats, None]:
    """Return what acts where the impulse of all rows is asked for."""
    return motion.lam, None


def impulse_upto(run: Trajectory, times: Floats) -> Floats:
    """Return the cumulative impulses of a motion at times (m,), s, of its own clock (m, nc), N s, with collisions."""
    return collided(times, straight(run.t, cumulative(run), times), run.events)


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
