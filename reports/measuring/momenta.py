"""Whether the forces that a run tells are what changed its momenta, when it says that they act."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Acts, Case, Inputs, Trajectory
from crossbody.cases.arrays import Floats, distinct
from crossbody.reports.measuring.equations import equations, finite
from crossbody.reports.measuring.impulse import stopping

if TYPE_CHECKING:
    from crossbody.reference import System

MOST, SPREAD = 16, 16
"""Steps that are looked at: those over which forces change most, and so many spread among all over which they do."""
CHANGES = 1e-3
"""Part of the largest change of forces from which on they change."""
ROUNDING = 1e-6
"""Part of the largest force by which forces do not change: to that their law is held; below are ends of solvers."""
SHORT = 1e-6
"""Part of the longest step below which a step is one that an event cut."""


TINY = 1e-300
"""In place of the energy of forces that push nothing."""
TOGETHER = 256
"""Steps whose equations are asked for at once."""


@dataclass(frozen=True, slots=True)
class Unexplained:
    """What rules leave unexplained of the momenta of a run, as parts of what half of a change of forces comes to.

    Attributes:
        whole: of the steps over which forces change most, together.
        middle: of the step in the middle of all, by what each leaves.
        size: what half of these changes comes to, as part of all that moves.
    """

    whole: Mapping[Acts, float]
    middle: Mapping[Acts, float]
    size: float


def unexplained(run: Trajectory, case: Case) -> Unexplained | None:
    """Return what each rule leaves unexplained: of a wrong one 1 or 2, where forces change steadily or jump.

    What velocities gain in a step is M dv = dt (f + H' lam), with lam of its start, of its end, or the mean of both.
    Sizes are those of kinetic energies: r' M^-1 r of momenta r. None where nothing can be told: without rows or
    equations, where nobody knows what acts or pushes, and where forces never change.
    """
    if (system := _told(run, case)) is None:
        return None
    inputs = _inputs(system, run, case)
    at, most = _steps(run, case, inputs)
    if not len(at):
        return None
    M, left, change, every = _left(system, run, at, inputs)
    half, moves = np.maximum(0.25 * _sizes(M, change), TINY), np.sum([_sizes(M, one) for one in every], axis=0)
    off = {rule: _sizes(M, rates) for rule, rates in left.items()}
    return Unexplained(
        whole={rule: float(np.sqrt(np.sum(each[most]) / np.sum(half[most]))) for rule, each in off.items()},
        middle={rule: float(np.sqrt(np.sort(each / half)[len(at) // 2])) for rule, each in off.items()},
        size=float(np.sqrt(np.sum(half[most]) / np.sum(moves[most]))),
    )


def of_cut_steps(run: Trajectory, case: Case, cut: float) -> tuple[Floats, Floats] | None:
    """Return by what forces of cut steps must be multiplied to be what velocities gained (m,), and what cut them (m,).

    That is how many times as long the longest step is: a force that is an impulse over that, and not over its own step,
    is as many times too small. None of a run whose forces are not means of steps, or where nothing can be told.

    Args:
        run: the motion.
        case: what moved.
        cut: part of the longest step below which a step is cut.
    """
    if run.acts not in (Acts.BEFORE, Acts.BEHIND) or (system := _told(run, case)) is None:
        return None
    dt, pushed = np.diff(run.t), run.lam[1:] if run.acts == Acts.BEFORE else run.lam[:-1]
    longest, largest = float(dt.max()), float(np.max(np.abs(run.lam)))
    pushes = np.max(np.abs(pushed), axis=1) > CHANGES * largest
    at = np.flatnonzero((dt > SHORT * longest) & (dt < cut * longest) & pushes)[-MOST:]
    if not len(at):
        return None
    M, left, _, (_, first, last) = _left(system, run, at, _inputs(system, run, case))
    own = last if run.acts == Acts.BEFORE else first
    by = 1.0 + np.einsum("mi,mij,mj->m", own, M, left[run.acts]) / np.maximum(_sizes(M, own), TINY)
    return by, longest / dt[at]


def unseen(run: Trajectory, case: Case) -> float:
    """Return which part of impulses trapezoids of the samples do not see, or make up, by what velocities gained.

    The largest sum over steps of M dv - dt (f + H' lam), over that of dt H' lam, each by the size sqrt(p' M^-1 p) of a
    momentum p; infinite where nothing tells it, or no sample pushes.
    """
    if (system := _told(run, case)) is None:
        return math.inf
    inputs, steps = _inputs(system, run, case), np.flatnonzero(np.diff(run.t) > 0.0)
    sums, most = np.zeros((2, len(case.velocities))), np.zeros(2)
    for at in np.array_split(steps, -(-len(steps) // TOGETHER)):
        M, left, _, (_, first, last) = _left(system, run, at, inputs)
        for k, rates in enumerate((left[Acts.AT], 0.5 * (first + last))):
            momenta = sums[k] + np.cumsum(np.einsum("mij,mj->mi", M, rates), axis=0)
            inverse: Floats = np.asarray(np.linalg.inv(M), dtype=np.float64)
            most[k] = max(most[k], float(np.max(_sizes(inverse, momenta))))
            sums[k] = momenta[-1]
    return float(np.sqrt(most[0] / most[1])) if most[1] > 0.0 else math.inf


def _told(run: Trajectory, case: Case) -> System | None:
    """Return the equations of a motion that tells all that they ask for; None of another."""
    system = equations(case)
    if system is None or system.jumps or (system.control is not None and run.inputs is None):
        return None
    return system if len(run.t) > 2 and run.lam.size and finite(run) and np.isfinite(run.lam).all() else None


def _inputs(system: System, run: Trajectory, case: Case) -> Inputs | None:
    inputs = case.inputs if run.inputs is None else run.inputs
    return inputs if system.activations is None or inputs is None else system.activations.extended(inputs)


def _steps(run: Trajectory, case: Case, inputs: Inputs | None) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the steps that are looked at (m,), and which of them are those over which forces change most.

    Nothing that takes no time happens within one, nor what acts from outside changes.
    """
    dt = np.diff(run.t)
    changes = np.linalg.norm(np.diff(run.lam, axis=0), axis=1) * dt
    changes[dt <= SHORT * dt.max()] = 0.0
    if run.acts == Acts.AT:  # what a stiff law takes back within a step is between its samples
        late = dt[:, None] * np.maximum(case.law.a1, np.sqrt(case.law.a0)) > 1.0
        changes[(late & (np.diff(run.lam, axis=0) != 0.0)).any(axis=1)] = 0.0
    if run.acts in (Acts.AT, Acts.GRID):  # friction of a slip that dies out may turn within nanoseconds
        stops = stopping(run)
        changes[stops[:-1] | stops[1:]] = 0.0
    within = [event.t for event in run.events if event.impulse] + [switch.t for switch in run.switches]
    for t in (*within, *(() if case.force is None else case.force.breaks)):
        changes[(run.t[:-1] <= t) & (t <= run.t[1:])] = 0.0
    if inputs is not None:
        first = np.searchsorted(inputs.times, run.t[:-1], side="right")
        changes[np.searchsorted(inputs.times, run.t[1:], side="left") > first] = 0.0
    rounded = ROUNDING * float(np.max(np.abs(run.lam))) * dt
    some = np.flatnonzero(changes > np.maximum(CHANGES * changes.max(initial=0.0), rounded))
    most = some[np.argsort(changes[some])[-MOST:]]
    at = distinct(most, some[:: -(-len(some) // SPREAD) or 1])
    return at, np.isin(at, most)


def _left(
    system: System, run: Trajectory, at: NDArray[np.intp], inputs: Inputs | None
) -> tuple[Floats, Mapping[Acts, Floats], Floats, Sequence[Floats]]:
    """Return M (m, n, n) of steps, and of what velocities gain (m, n) what rules leave.

    And how much more the rows' forces of the end give than those of the start, and what each kind of force gives.
    """
    t, dt, dv = run.t[at], np.diff(run.t)[at, None], run.v[at + 1] - run.v[at]
    u = None if inputs is None else inputs.at(t)
    M, f, H, _, _ = system.equations_along(t, run.q[at], run.v[at], u)
    N, g, J, _, _ = system.equations_along(run.t[at + 1], run.q[at + 1], run.v[at + 1], u)

    def given(mass: Floats, force: Floats) -> Floats:
        found: Floats = dt * np.linalg.solve(mass, force[..., None])[..., 0]
        return found

    free, first, last = given(M, f), given(M, _push(H, run.lam[at])), given(M, _push(H, run.lam[at + 1]))
    end = given(N, g + _push(J, run.lam[at + 1]))
    left = {Acts.AT: dv - 0.5 * (free + first + end), Acts.BEFORE: dv - free - last, Acts.BEHIND: dv - free - first}
    return M, left, last - first, (free, first, last)


def _push(H: Floats, lam: Floats) -> Floats:
    """Return H' lam (m, n)."""
    found: Floats = np.einsum("mkn,mk->mn", H, lam)
    return found


def _sizes(M: Floats, rates: Floats) -> Floats:
    """Return v' M v (m,), or p' M^-1 p."""
    found: Floats = np.einsum("mi,mij,mj->m", rates, M, rates)
    return found
