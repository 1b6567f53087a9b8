"""Assertions about motions, which report the first offence: two are the same, one keeps its account."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases import InvalidValue, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.truth import Truth, from_run

if TYPE_CHECKING:
    from crossbody.engines import Run

SIGNALS = ("q", "v", "gap", "lam", "energy")


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """One signal beside what it should be.

    Attributes:
        name: for the sentence, with its index.
        t (n,): instants, s.
        found, wanted (n,): values.
        allowed: largest difference that is fine, in the signal's own unit.
        basis: where `allowed` comes from, in words.
    """

    name: str
    t: Floats
    found: Floats
    wanted: Floats
    allowed: float
    basis: str

    def offence(self) -> str:
        """The sentence; empty where the signal stays within. What is NaN on one side only is off."""
        off = np.abs(self.found - self.wanted)
        both = np.isnan(self.found) & np.isnan(self.wanted)
        bad = ~(off <= self.allowed) & ~both
        if not bad.any():
            return ""
        first, worst = int(np.argmax(bad)), int(np.argmax(np.where(bad, np.where(np.isnan(off), np.inf, off), -1.0)))
        return (
            f"{self.name} is off first at t = {self.t[first]:.9g} s: {self.found[first]:.9g} "
            f"where {self.wanted[first]:.9g} is expected, a difference of {off[first]:.3g} "
            f"where {self.allowed:.3g} is allowed ({self.basis}); the worst is {off[worst]:.3g} "
            f"at t = {self.t[worst]:.9g} s, and {int(bad.sum())} of {len(bad)} samples are off."
        )


def fail_if_any(sentences: list[str]) -> None:
    """Raise AssertionError with all sentences that are not empty."""
    if told := [text for text in sentences if text]:
        raise AssertionError("\n".join(told))


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

    Touches are matched first and the arcs between them compared: a touch that comes 1 ms late is
    an error of 1 ms, not of twice the speed.

    Args:
        run: what is tested; a prepared run of an engine is run.
        truth: what it is held against, with samples as dense as the comparison needs (it is
            joined by splines).
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
    found = _touches(mine, theirs, late)
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
    for who, one in (("The run", run), ("The motion to compare with", truth)):
        if not one.outcome.ok:
            text = " ".join(x for x in (one.message, one.outcome.advice) if x)
            return [f"{who} ended at t = {one.t[-1]:.9g} s with {one.outcome.value}: {text}"]
    if not math.isclose(run.t[-1], truth.t[-1], rel_tol=1e-9):
        return [f"The run ends at t = {run.t[-1]:.9g} s, what it is held against at t = {truth.t[-1]:.9g} s."]
    return []


def _touches(run: Trajectory, truth: Truth, late: float) -> list[str]:
    """The first touch that has no counterpart in row and time."""
    mine, theirs = truth.contacts(run), truth.contacts(truth.trajectory)
    for i, (a, b) in enumerate(zip(mine, theirs, strict=False)):
        if a.row != b.row or not abs(a.touch - b.touch) <= late:
            return [
                f"Touch {i} is of row {a.row} at t = {a.touch:.9g} s where row {b.row} at t = "
                f"{b.touch:.9g} s is expected; {late:.3g} s are allowed."
            ]
    if len(mine) == len(theirs):
        return []
    more, word = (mine, "has no counterpart") if len(mine) > len(theirs) else (theirs, "is missing")
    extra = more[min(len(mine), len(theirs))]
    counts = f"{len(mine)} touches where {len(theirs)} are expected"
    return [f"The touch of row {extra.row} at t = {extra.touch:.9g} s {word}: {counts}."]


def _signals(run: Trajectory, truth: Truth, of: Sequence[str], rtol: float, atol: float) -> Iterator[Signal]:
    inside, exact = aligned(truth, run, None)
    for name in of:
        wanted: Floats = getattr(exact, name)
        largest = np.max(np.abs(getattr(truth.trajectory, name)), axis=0, initial=0.0)
        for i in range(wanted.shape[1]):
            yield Signal(
                name=f"{name}[{i}]", t=run.t[inside], found=getattr(run, name)[inside, i],
                wanted=wanted[:, i], allowed=atol + rtol * float(np.nan_to_num(largest[i])),
                basis=f"rtol {rtol:g} of {largest[i]:.3g}" + (f", atol {atol:g}" if atol else ""),
            )  # fmt: skip


def assert_energy(run: Trajectory | Run, *, rtol: float = 1e-6, conserved: bool = False) -> None:
    """Assert that the integrator neither made nor lost energy.

    E(t) - E(0) must be the work of the inputs, less what damping took, plus the work of every
    multiplier: what the contact law itself makes is no error of the integrator.

    Args:
        run: what is tested; a prepared run of an engine is run.
        rtol: of the largest kinetic energy.
        conserved: hold E(t) against E(0) alone, for a scene in which nothing does work; needs no account.

    Raises:
        AssertionError: naming the first offending instant, the energy there, and what is allowed.
        InvalidValue: for a run without an account, unless `conserved`.
    """
    motion = _motion(run)
    change = motion.total_energy - motion.total_energy[0]
    wanted = np.zeros_like(change) if conserved else _account(motion)
    largest = float(np.max(motion.energy[:, 0], initial=0.0))
    word = "E(t) - E(0) [J]" if conserved else "E(t) - E(0) against the account of inputs, damping and contacts [J]"
    signal = Signal(
        name=word, t=motion.t, found=change, wanted=wanted, allowed=rtol * largest,
        basis=f"rtol {rtol:g} of the largest kinetic energy, {largest:.3g} J",
    )  # fmt: skip
    fail_if_any([signal.offence()])


def _account(run: Trajectory) -> Floats:
    """Energy that everything outside the integrator has brought since the start (n,), J."""
    if run.ledger is None:
        raise InvalidValue(
            "The run keeps no energy account: prepare it with ledger=True where the engine "
            "has that setting, or compare it with its start with conserved=True."
        )
    book: Floats = run.ledger.input - run.ledger.dissipated + run.ledger.contact.sum(axis=1)
    brought: Floats = book - book[0]
    return brought
