"""Derivatives of a motion by its start and by parameters, through its contacts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import Outcome, SceneError, Trajectory
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference._simulate import simulate
from crossbody.reference._system import System
from crossbody.reference.kinds import Array, Floats
from crossbody.reference.linear._variation import (
    theta,
)
from crossbody.reference.linear._walk import AS_ONE, Jump, Walk
from crossbody.reference.linear.linearisation import point


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivity:
    """A motion to its horizon and its first derivatives there; NaN where the motion or an event has none.

    Attributes:
        run: the motion.
        state (nq + n,): q and v at the end.
        by_start (2 n, 2 n): derivative by q0 and v0, by coordinates of the tangent spaces at both ends
            where q' is not v (as `linearise`). Of a periodic motion over its period, the monodromy matrix.
        by_parameters (2 n, k): derivative by the parameters.
        names: of the parameters.
        jumps: the events that were passed.
        outcome: that of the run; ILL_POSED if an event is only grazed, where the derivative does not exist, or
            if there is none by some variables alone; TIME_LIMIT if the derivatives took longer than asked.
        message: that of the run, or what is grazed or took so long, and when.
    """

    run: Trajectory
    state: Floats
    by_start: Floats
    by_parameters: Floats
    names: tuple[str, ...]
    jumps: tuple[Jump, ...]
    outcome: Outcome
    message: str = ""

    @property
    def multipliers(self) -> Array:
        """Eigenvalues of `by_start` (2 n,), the largest first, NaN without it: Floquet's of a periodic motion."""
        if not np.isfinite(self.by_start).all():
            return np.full(len(self.by_start), complex(np.nan, np.nan))
        found = np.linalg.eigvals(self.by_start)
        return found[np.argsort(-np.abs(found))]


@checked_arguments
def sensitivity(
    system: System, q0: ArrayLike, v0: ArrayLike, t_end: float, *,
    parameters: Sequence[str] = (), u: ArrayLike | None = None, rtol: float = 1e-11,
    collisions: str = "sequential", max_steps: int = 1_000_000, time_limit: float = math.inf,
) -> Sensitivity:  # fmt: skip
    """Integrate a motion with its variational equations; every event multiplies them by its saltation matrix.

    Collisions that follow one another at one instant, as through balls that touch, are passed one by one: the
    derivative is then that of deviations that part the balls, as long as those do not meet again.

    Contacts that are closed at the start and deeper than the tolerance tells stay so in deviations. Those that only
    touch have no derivative by what lifts them off, and those that slide from the start without a slip none by what
    gives them one: it is NaN while the others hold. A slip that stops takes the deviations
    of its velocity with it. Where a contact sticks from the start or from its touch, so do those by which it would
    slip: they die out within times of their own size.

    Args:
        system: the mechanism, without a sampled controller.
        q0: positions at the start (nq,).
        v0: velocities at the start (n,).
        t_end: horizon, s.
        parameters: by name, "p[k]", "a0[i]", "a1[i]", "a2[i]" of row i's slow law, "mu[i]" of the friction
            of contact i or the bound of row i's own, "drift[i]" of the surface along tangential row i.
        u: constant inputs (nu,), zero if not given.
        rtol: tolerance of the motion and of its derivatives.
        collisions: rule for several contacts; under "simultaneous" one collision at a time only.
        max_steps: bound on the steps of the motion.
        time_limit: bound on processor time, s, of the motion and again of its derivatives.

    Raises:
        SceneError: for a sampled controller, a motion that switches discrete variables, rows that
            strike or switch as one, a slip in space that turns back through zero, or a load of
            which the law leaves open who bears it.
        UnknownName: for a parameter that is not there.
    """
    over, at = theta(system, parameters), point(system, q0, v0, u, [], 0.0)
    if system.control is not None:
        raise SceneError("sensitivity: the system has a sampled controller; differentiate it with its inputs held.")
    run = simulate(
        system, at.q, at.v, t_end, rtol=rtol, collisions=collisions, inputs=([0.0], [at.u]), max_steps=max_steps,
        time_limit=time_limit,
    )  # fmt: skip
    if any(switch.t > 0.0 and not switch.smooth for switch in run.switches):
        raise SceneError("sensitivity: the motion switches discrete variables; end it before the first switch.")
    walk = Walk(at, over, rtol, run, time_limit)
    outcome, n = walk.within_time(run, t_end) if run.outcome.ok else run.outcome, system.n
    if not outcome.ok:
        walk.S[:] = np.nan
    elif not walk.ends_as(run):
        raise SceneError(AS_ONE)  # touching rows share an impulse of which one event tells
    if walk.lost.any():
        walk.S[:, walk.lost], outcome = np.nan, Outcome.ILL_POSED if outcome.ok else outcome
    return Sensitivity(
        run=run, state=walk.x, by_start=walk.S[:, : 2 * n], by_parameters=walk.S[:, 2 * n :],
        names=over.names, jumps=tuple(walk.jumps), outcome=outcome, message=walk.message or run.message,
    )  # fmt: skip
