"""Whether two motions are the same, told by the first instant at which they are not."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases import InvalidValue, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.contacts import contacts
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.truth import Truth, from_run
from crossbody.reports.testing._offence import Signal, fail_if_any

if TYPE_CHECKING:
    from crossbody.engines import Run

SIGNALS = ("q", "v", "gap", "lam", "energy")


def assert_agrees(
    run: Trajectory | Run,
    truth: Trajectory | Run | Truth,
    *,
    of: Sequence[str] = ("q", "v"),
    rtol: float = 1e-6,
    atol: float = 0.0,
    times: float | None = None,
) -> None:
    """Assert that a motion agrees with another one.

    Touches are matched first and the arcs between them compared: a touch that comes 1 ms late is an error of 1 ms, not
    of twice the speed.

    Args:
        run: what is tested; a prepared run of an engine is run.
        truth: what it is held against, with samples as dense as the comparison needs (it is joined by splines).
        of: which signals, out of q, v, gap, lam and energy.
        rtol: of the largest magnitude of each column of the truth.
        atol: in each signal's own unit, for columns that rest.
        times: how far touches may be off, s; `rtol` of the horizon if not given.

    Raises:
        AssertionError: naming the first offending instant, the values there, and what is allowed.
        InvalidValue: for a signal that does not exist, or motions of different mechanisms.
    """
    mine, theirs = _motion(run), truth if isinstance(truth, Truth) else from_run(_motion(truth), Tier.D, "given")
    _check(mine, theirs.trajectory, of)
    fail_if_any(_unfinished(mine, theirs.trajectory))
    late = rtol * float(theirs.trajectory.t[-1]) if times is None else times
    found = _touches(mine, theirs.trajectory, late)
    if not found:  # behind a touch that has no counterpart nothing can be compared
        found = [signal.offence() for signal in _signals(mine, theirs, of, rtol, atol)]
    fail_if_any(found)


def _motion(run: Trajectory | Run) -> Trajectory:
    return run if isinstance(run, Trajectory) else run.run()


def _check(run: Trajectory, truth: Trajectory, of: Sequence[str]) -> None:
    for name in of:
        if name not in SIGNALS:
            raise InvalidValue(f"There is no signal {name!r}; valid: {', '.join(SIGNALS)}.")
        mine, theirs = getattr(run, name).shape[1], getattr(truth, name).shape[1]
        if mine != theirs:
            raise InvalidValue(f"{name} has {mine} columns here and {theirs} there: these are different mechanisms.")


def _unfinished(run: Trajectory, truth: Trajectory) -> list[str]:
    """What keeps two motions from being compared at all."""
    for who, one in (("The run", run), ("What it is held against", truth)):
        if not one.outcome.ok:
            text = " ".join(x for x in (one.message, one.outcome.advice) if x)
            return [f"{who} ended at t = {one.t[-1]:.9g} s with {one.outcome.value}: {text}"]
    if not math.isclose(run.t[-1], truth.t[-1], rel_tol=1e-9):
        return [f"The run ends at t = {run.t[-1]:.9g} s, what it is held against at t = {truth.t[-1]:.9g} s."]
    return []


def _touches(run: Trajectory, truth: Trajectory, late: float) -> list[str]:
    """The first touch that has no counterpart in row and time."""
    mine, theirs = contacts(run), contacts(truth)
    for i, (a, b) in enumerate(zip(mine, theirs, strict=False)):
        if a.row != b.row or not abs(a.touch - b.touch) <= late:
            return [
                f"Touch {i} is of row {a.row} at t = {a.touch:.9g} s where row {b.row} at t = {b.touch:.9g} s is "
                f"expected; {late:.3g} s are allowed."
            ]
    if len(mine) == len(theirs):
        return []
    more, word = (mine, "has no counterpart") if len(mine) > len(theirs) else (theirs, "is missing")
    extra = more[min(len(mine), len(theirs))]
    counts = f"{len(mine)} touches where {len(theirs)} are expected"
    return [f"The touch of row {extra.row} at t = {extra.touch:.9g} s {word}: {counts}."]


def _signals(run: Trajectory, truth: Truth, of: Sequence[str], rtol: float, atol: float) -> Iterator[Signal]:
    inside, exact = aligned(truth, run)
    for name in of:
        wanted: Floats = getattr(exact, name)
        largest = np.max(np.abs(getattr(truth.trajectory, name)), axis=0, initial=0.0)
        for i in range(wanted.shape[1]):
            yield Signal(
                name=f"{name}[{i}]", t=run.t[inside], found=getattr(run, name)[inside, i], wanted=wanted[:, i],
                allowed=atol + rtol * float(np.nan_to_num(largest[i])),
                basis=f"rtol {rtol:g} of {largest[i]:.3g}" + (f", atol {atol:g}" if atol else ""),
            )  # fmt: skip
