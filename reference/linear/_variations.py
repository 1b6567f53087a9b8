"""Variational equations of a motion between two events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import sparse

from crossbody.cases import SceneError
from crossbody.reference._elapsed import Elapsed
from crossbody.reference.kinds import Floats
from crossbody.reference.linear._emerging import settled
from crossbody.reference.linear._point import Point, directions, turning
from crossbody.reference.linear._rubbing import NoDirectionError
from crossbody.reference.linear._variation import (
    Theta,
    flow,
    rate_slopes,
)


def placed(here: Point, t: float, y: Floats) -> Point:
    """The point at a time and a state."""
    return settled(moved_to(here, t, y))


def moved_to(here: Point, t: float, y: Floats) -> Point:
    """The point at a time and a state, with the rows in contact as they are."""
    nq = here.system.nq
    return replace(here, t=t, q=y[:nq].copy(), v=y[nq : nq + here.system.n].copy())


class OutOfTimeError(Exception):
    """Processor time is spent; its argument is the time of the motion at which that was."""


class Variations:
    """Right-hand side of a state x (nq + n,) and of its derivative S (2 n, k), until processor time is spent.

    Attributes:
        over: the parameters behind the variables of the start.
        shape: of S.
        time_limit: bound on processor time, s.
        refusal: why a rate that was asked for has none, where no shorter step avoids it.
    """

    def __init__(self, over: Theta, shape: tuple[int, int], time_limit: float) -> None:
        self.over, self.shape, self.time_limit = over, shape, time_limit
        self.elapsed = Elapsed()
        self.refusal: SceneError | None = None

    def rate(self, here: Point) -> Callable[[float, Floats], Floats]:
        """The right-hand side of x and S."""
        system, shape = here.system, self.shape
        n, nq = system.n, system.nq

        def rate(t: float, y: Floats) -> Floats:
            if self.elapsed.exceeds(self.time_limit):
                raise OutOfTimeError(t)
            moved, lost = placed(here, t, y), np.full(len(y), np.nan)
            if not np.isfinite(y).all():
                return lost
            try:
                f, slope = flow(moved, self.over)
            except SceneError as error:  # a trial step beyond the arc's end, or else one that no shorter step avoids
                self.refusal = None if isinstance(error, NoDirectionError) else error
                return lost
            S = y[nq + n :].reshape(shape)
            tangent = S[n:]
            if system.velocity is not None:
                tangent = tangent + turning(system, t, moved.q, moved.v) @ S[:n]
                tangent[:, 2 * n :] += rate_slopes(moved, self.over)
            changed = slope[:, : 2 * n] @ S
            changed[:, 2 * n :] += slope[:, 2 * n :]
            return np.concatenate([system.rates(moved.q, moved.v, t), f[n:], tangent.ravel(), changed.ravel()])

        return rate

    def jacobian(self, here: Point) -> Callable[[float, Floats], sparse.csc_array]:
        """Of the right-hand side, but for second derivatives: Newton's method finds its way without."""
        system, n, nq = here.system, here.system.n, here.system.nq

        def jacobian(t: float, y: Floats) -> sparse.csc_array:
            moved = placed(here, t, y)
            vd_x, N = flow(moved, self.over)[1][:, : 2 * n], directions(system, moved.q)
            whole = np.block([[turning(system, t, moved.q, moved.v), np.eye(n)], [vd_x]])
            own = np.block([[np.zeros((nq, nq)), N], [vd_x[:, :n] @ np.linalg.pinv(N), vd_x[:, n:]]])
            spread = sparse.kron(whole, sparse.eye_array(self.shape[1]))
            return sparse.csc_array(sparse.block_diag([sparse.csc_array(own), spread]))

        return jacobian
