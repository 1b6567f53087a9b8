"""Derivatives of a motion by its start and by parameters, through its contacts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from crossbody.cases import Event, Mode, Outcome, SceneError, Trajectory
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference._simulate import simulate
from crossbody.reference._system import System, initial_modes
from crossbody.reference.kinds import Array, Floats
from crossbody.reference.linear._point import Point, turning
from crossbody.reference.linear._variation import (
    Theta,
    bounced,
    gap_gradient,
    gradient,
    handover_gradient,
    lam_gradient,
    rate_slopes,
    slopes,
    theta,
)
from crossbody.reference.linear.linearisation import point

ACTIVE = (Mode.CONTACT, Mode.COLLISION, Mode.BILATERAL)
GRAZING = 1e-12  # part of the terms of g_x f below which an event is only grazed


AS_ONE = (
    "sensitivity: several rows strike as one; a deviation parts them, and what follows then depends on which of them "
    'comes first, so there is no derivative. Use collisions="sequential".'
)
SAME = 1e-3  # part of the motion's size by which its end may differ from the one that was passed through


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Jump:
    """What an event does to small deviations.

    Attributes:
        t: instant, s.
        contact: row.
        before, after: its mode.
        matrix (2 n, 2 n): the saltation matrix.
    """

    t: float
    contact: int
    before: Mode
    after: Mode
    matrix: Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivity:
    """A motion to its horizon and its first derivatives there; NaN where the motion or an event has none.

    Attributes:
        run: the motion.
        state (nq + n,): q and v at the end.
        by_start (2 n, 2 n): derivative by q0 and v0, by coordinates of the tangent spaces at both ends where q' is not
            v (as `linearise`). Of a periodic motion over its period, the monodromy matrix.
        by_parameters (2 n, k): derivative by the parameters.
        names: of the parameters.
        jumps: the events that were passed.
        outcome: that of the run; ILL_POSED if an event is only grazed, where the derivative does not exist.
    """

    run: Trajectory
    state: Floats
    by_start: Floats
    by_parameters: Floats
    names: tuple[str, ...]
    jumps: tuple[Jump, ...]
    outcome: Outcome

    @property
    def multipliers(self) -> Array:
        """Eigenvalues of `by_start` (2 n,), the largest first: Floquet's multipliers of a periodic motion."""
        found = np.linalg.eigvals(self.by_start)
        return found[np.argsort(-np.abs(found))]


@checked_arguments
def sensitivity(
    system: System, q0: ArrayLike, v0: ArrayLike, t_end: float, *, parameters: Sequence[str] = (),
    u: ArrayLike | None = None, rtol: float = 1e-11, collisions: str = "sequential", max_steps: int = 1_000_000,
) -> Sensitivity:  # fmt: skip
    """Integrate a motion with its variational equations; every event multiplies them by its saltation matrix.

    Collisions that follow one another at one instant, as through balls that touch, are passed one by one: the
    derivative is then that of deviations that part the balls, as long as those do not meet again.

    Args:
        system: the mechanism, without a sampled controller.
        q0: positions at the start (nq,).
        v0: velocities at the start (n,).
        t_end: horizon, s.
        parameters: by name, "p[k]", or "a0[i]", "a1[i]", "a2[i]" of row i's slow law.
        u: constant inputs (nu,), zero if not given.
        rtol: tolerance of the motion and of its derivatives.
        collisions: rule for several contacts; under "simultaneous" one collision at a time only.
        max_steps: bound on the steps of the motion.

    Raises:
        SceneError: for a sampled controller, a motion that switches discrete variables, or rows that strike as one.
        UnknownName: for a parameter that is not there.
    """
    over, at = theta(system, parameters), point(system, q0, v0, u, [], 0.0)
    if system.control is not None:
        raise SceneError("sensitivity: the system has a sampled controller; differentiate it with its inputs held.")
    run = simulate(
        system, at.q, at.v, t_end, rtol=rtol, collisions=collisions, inputs=([0.0], [at.u]), max_steps=max_steps
    )
    if any(switch.t > 0.0 and not switch.smooth for switch in run.switches):
        raise SceneError("sensitivity: the motion switches discrete variables; end it before the first switch.")
    walk = _Walk(at, over, rtol)
    outcome, n, nq = walk.along(run, t_end) if run.outcome.ok else run.outcome, system.n, system.nq
    if not outcome.ok:
        walk.S[:] = np.nan
    elif not (_same(walk.x[:nq], run.q) and _same(walk.x[nq:], run.v)):
        raise SceneError(AS_ONE)  # touching rows share an impulse of which one event tells
    return Sensitivity(
        run=run, state=walk.x, by_start=walk.S[:, : 2 * n], by_parameters=walk.S[:, 2 * n :], names=over.names,
        jumps=tuple(walk.jumps), outcome=outcome,
    )  # fmt: skip


def _same(end: Floats, motion: Floats) -> bool:
    """Whether a motion (N, n) ends there."""
    return bool(np.abs(end - motion[-1]).max() <= SAME * np.abs(motion).max(initial=1e-300))


class _Walk:
    """State x (nq + n,) and its derivative S (2 n, 2 n + k) on the way through a motion."""

    def __init__(self, at: Point, over: Theta, rtol: float) -> None:
        n = at.system.n
        self.at, self.over, self.rtol = at, over, rtol
        self.x = np.concatenate([at.q, at.v])
        self.S = np.hstack([np.eye(2 * n), np.zeros((2 * n, len(over.names)))])
        self.modes = initial_modes(at.system, at.q, at.v).astype(int).tolist()
        self.jumps: list[Jump] = []

    def along(self, run: Trajectory, t_end: float) -> Outcome:
        """Go to the end; FINISHED, or how the derivative was lost."""
        now = 0.0
        for t, group in groupby(run.events, key=lambda event: event.t):
            self._smooth(now, t)
            now = t
            for piece in _pieces(list(group)):
                if not self._event(piece):
                    return Outcome.ILL_POSED
        self._smooth(now, t_end)
        return Outcome.FINISHED if np.isfinite(self.S).all() else Outcome.NOT_FINITE

    def _here(self) -> Point:
        """The present state, with the rows and constants of the present modes."""
        system, nq = self.at.system, self.at.system.nq
        modes = [self.modes[f] if f >= 0 else m for m, f in zip(self.modes, np.asarray(system.follows), strict=True)]
        fast = (np.array(modes) == Mode.COLLISION) & (np.asarray(system.b0) > 0.0)
        return replace(
            self.at, q=self.x[:nq].copy(), v=self.x[nq:].copy(),
            alpha=np.where(fast[:, None], system.beta, system.alpha),
            active=np.array([i for i, mode in enumerate(modes) if mode in ACTIVE], dtype=np.int64),
        )  # fmt: skip

    def _smooth(self, start: float, end: float) -> None:
        """Integrate x and S between two events."""
        if not end > start:
            return
        here, system = self._here(), self.at.system
        n, nq, shape = system.n, system.nq, self.S.shape

        def rate(t: float, y: Floats) -> Floats:
            moved = replace(here, t=t, q=y[:nq].copy(), v=y[nq : nq + n].copy())
            f, _, slope = slopes(moved, self.over)
            S = y[nq + n :].reshape(shape)
            tangent = S[n:]
            if system.velocity is not None:
                tangent = tangent + turning(system, t, moved.q, moved.v) @ S[:n]
                tangent[:, 2 * n :] += rate_slopes(moved, self.over)
            changed = slope[:n, : 2 * n] @ S
            changed[:, 2 * n :] += slope[:n, 2 * n :]
            return np.concatenate([system.rates(moved.q, moved.v, t), f[n:], tangent.ravel(), changed.ravel()])

        y = np.concatenate([self.x, self.S.ravel()])
        scale = np.full(len(y), 1e-3)
        done: Any = solve_ivp(rate, (start, end), y, method="DOP853", rtol=self.rtol, atol=self.rtol * scale)
        self.x, self.S = done.y[: nq + n, -1].copy(), done.y[nq + n :, -1].reshape(shape).copy()
        self.x[:nq] = system.normalised("sensitivity", self.x[:nq])

    def _event(self, piece: list[Event]) -> bool:
        """Pass one event, or one frozen collision with all that it does; False if it is only grazed."""
        event, before = piece[0], self._here()
        frozen = len(piece) > 1
        start, n = event.t == 0.0 and not frozen, self.at.system.n
        R, jumped = np.eye(2 * n, self.S.shape[1]), self.x
        if frozen:
            let_go = {e.contact for e in piece[1:-1]}
            held = [i for i in before.active.tolist() if i not in let_go]
            struck = replace(before, active=np.array([*held, event.contact], dtype=np.int64))
            after = bounced(struck, event.contact, piece[-1].after is Mode.CONTACT)
            R = np.vstack([R[:n], gradient(after, struck, self.over)])
            jumped = np.concatenate([struck.q, after(struck, struck.q, struck.v)])
        guard = None if start else self._guard(event, before)
        old, _, _ = slopes(before, self.over)
        for e in piece:
            self.modes[e.contact] = int(e.after)
        self.x = jumped
        if guard is None:
            return True
        new, _, _ = slopes(self._here(), self.over)
        return self._jump(piece, guard, R, old, new)

    def _jump(self, piece: list[Event], g: Floats, R: Floats, old: Floats, new: Floats) -> bool:
        width = len(old)
        speed = float(g[:width] @ old)
        if not abs(speed) > GRAZING * float(np.abs(g[:width]) @ np.abs(old)):
            return False
        kick = R[:, :width] @ old - new
        change = g[:width] @ self.S
        change[width:] += g[width:]
        S = R[:, :width] @ self.S - np.outer(kick, change) / speed
        S[:, width:] += R[:, width:]
        self.S = S
        matrix = R[:, :width] - np.outer(kick, g[:width]) / speed
        self.jumps.append(
            Jump(t=piece[0].t, contact=piece[0].contact, before=piece[0].before, after=piece[-1].after, matrix=matrix)
        )
        return True

    def _guard(self, event: Event, here: Point) -> Floats | None:
        """Gradient of what fell to zero; None where nothing changes but a label."""
        i, before, after = event.contact, event.before, event.after
        if before is Mode.FREE:
            return gap_gradient(here, self.over, i)
        if before is Mode.COLLISION and after is Mode.CONTACT:
            return handover_gradient(here, self.over, i)
        if before in ACTIVE:
            return lam_gradient(here, self.over, i)
        return None if after is Mode.FREE else gap_gradient(here, self.over, i, rate=True)


def _pieces(events: list[Event]) -> Iterator[list[Event]]:
    """Events of one instant: each frozen collision with the rows it releases and its end, every other one alone.

    Raises:
        SceneError: if several rows strike together.
    """
    k = 0
    while k < len(events):
        size = 1
        ends = [
            j for j, e in enumerate(events) if j > k and e.contact == events[k].contact and e.before is Mode.COLLISION
        ]
        if events[k].after is Mode.COLLISION and ends:
            if any(e.before is not Mode.CONTACT for e in events[k + 1 : ends[0]]):
                raise SceneError(AS_ONE)
            size = ends[0] - k + 1
        yield events[k : k + size]
        k += size
