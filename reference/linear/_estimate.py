"""Forces that were not measured, from a measured motion and torque, with their uncertainty (spec 2.7, 5.7).

Unknown forces F are inputs of the mechanism (a force on the flange) or multipliers of rows whose law is not trusted:

    M v' = f(q, v, u + F) + H_A^T lam_A + H_F^T F        lam_A from the laws of the active rows

`balanced` reads F off one instant at a time, where accelerations are at hand: generalised least squares with the
covariance of what was measured. `filtered` needs positions alone: an extended Kalman filter whose F is a process of
known size and correlation time (Gauss and Markov), and the smoother of Rauch, Tung and Striebel over the whole record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm, null_space

from crossbody.cases import InvalidValue
from crossbody.cases._arrays import frozen
from crossbody.reference._kinds import Floats, Index
from crossbody.reference._system import System
from crossbody.reference.linear._derivatives import STEP, Point, dense, residual, terms
from crossbody.reference.linear._linearise import point


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """Forces with their covariance.

    Attributes:
        t (N,): s.
        force (N, k): the inputs asked for, then the multipliers asked for.
        covariance (N, k, k): of the force.
        q, v (N, n): the motion that goes with it.
        innovation (N, ny): measurement minus its prediction over the deviation expected; white and of unit size where
            model and noise are right. Empty for `balanced`.
    """

    t: Floats
    force: Floats
    covariance: Floats
    q: Floats
    v: Floats
    innovation: Floats

    @property
    def std(self) -> Floats:
        """Standard deviations (N, k); 1.96 of them hold 95 % of the errors of a Gaussian."""
        deviation: Floats = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))
        return deviation


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Unknown:
    """Which forces are looked for.

    Attributes:
        inputs: inputs of the mechanism to which an unknown part is added.
        rows: rows whose multipliers are unknown; their law is not used.
    """

    inputs: tuple[int, ...] = ()
    rows: tuple[int, ...] = ()

    def __len__(self) -> int:
        """Number of forces."""
        return len(self.inputs) + len(self.rows)


def balanced(
    system: System, t: ArrayLike, q: ArrayLike, v: ArrayLike, vd: ArrayLike, u: ArrayLike | None = None, *,
    unknown: Unknown, active: Sequence[int] | None = None, std_q: ArrayLike = 0.0, std_v: ArrayLike = 0.0,
    std_vd: ArrayLike = 0.0, std_u: ArrayLike = 0.0,
) -> Estimate:  # fmt: skip
    """Forces that balance M v' = f + H^T lam + ... at each instant, lam of the active rows unknown as well.

    Args:
        system: the mechanism.
        t: instants (N,), s.
        q: positions (N, n).
        v: velocities (N, n).
        vd: accelerations (N, n).
        u: inputs (N, nu), zero if not given.
        unknown: what is looked for.
        active: rows that are on beside those; the ones that are always on, if not given.
        std_q: deviation of the errors in q, a number or (n,).
        std_v: of those in v.
        std_vd: of those in v'.
        std_u: of those in u, a number or (nu,).

    Raises:
        SceneError: for arrays of another shape.
        InvalidValue: if no error is given at all, so that nothing weighs the equations.
    """
    record = _Record(system, t, u, unknown, active)
    n, na = system.n, len(record.held)
    Q, V, VD = (frozen("balanced", k, x, (len(record.t), n)) for k, x in (("q", q), ("v", v), ("vd", vd)))
    spread = np.concatenate([np.broadcast_to(np.asarray(s, dtype=float), n) for s in (std_q, std_v, std_vd)])
    inputs = np.broadcast_to(np.asarray(std_u, dtype=float), system.inputs)
    if not (spread.any() or inputs.any()):
        raise InvalidValue("balanced: give the deviation of at least one of q, v, vd, u.")
    found, covariance = np.zeros((len(Q), na + len(unknown))), np.zeros((len(Q), na + len(unknown), na + len(unknown)))
    for k in range(len(Q)):
        at = record.at(k, Q[k], V[k])
        E, e, M = _imbalance(at, record, VD[k])
        first: Floats = np.linalg.lstsq(E, e, rcond=None)[0].astype(np.float64)
        J = _noise_paths(at, record, VD[k], first, M)
        W = J * np.concatenate([spread, inputs])
        left, size, _ = np.linalg.svd(W @ W.T)
        whiten = left.T / np.sqrt(np.maximum(size, 1e-12 * size[0]))[:, None]
        pinv = np.linalg.pinv(whiten @ E)
        found[k], covariance[k] = pinv @ (whiten @ e), pinv @ pinv.T
    return Estimate(
        t=record.t, force=found[:, na:], covariance=covariance[:, na:, na:], q=Q, v=V, innovation=np.zeros((len(Q), 0))
    )  # fmt: skip


def filtered(
    system: System, t: ArrayLike, y: ArrayLike, u: ArrayLike | None = None, *, unknown: Unknown,
    measured: Sequence[int], std_y: ArrayLike, q0: ArrayLike, v0: ArrayLike | None = None, std_force: ArrayLike,
    time_force: float, active: Sequence[int] | None = None, std_q0: float = 1e-3, std_v0: float = 1e-1,
    smooth: bool = True,
) -> Estimate:  # fmt: skip
    """Forces from positions alone by an extended Kalman filter, and a smoother over the record.

    Args:
        system: the mechanism; its active rows keep one set through the record.
        t: instants (N,), s, increasing.
        y: measured positions (N, ny).
        u: inputs (N, nu), each held from its instant on; zero if not given.
        unknown: what is looked for.
        measured: coordinates that y holds.
        std_y: deviation of their errors, a number or (ny,).
        q0: positions near the start (n,), on the active rows.
        v0: velocities near the start (n,), zero if not given.
        std_force: deviation of the unknown forces, a number or (k,).
        time_force: their correlation time, s.
        active: rows that are on beside the unknown ones; those that are always on, if not given.
        std_q0: deviation of q0, in the coordinates that the rows leave free.
        std_v0: deviation of v0.
        smooth: use the whole record at every instant, else its past alone.

    Raises:
        SceneError: for arrays of another shape.
        InvalidValue: for deviations or times that are not above 0, or instants that do not increase.
    """
    record = _Record(system, t, u, unknown, active)
    Y = frozen("filtered", "y", y, (len(record.t), len(measured)))
    noise = np.broadcast_to(np.asarray(std_y, dtype=float), len(measured))
    strength = np.broadcast_to(np.asarray(std_force, dtype=float), len(unknown))
    _check_positive(std_y=noise, std_force=strength, time_force=np.array([time_force]))
    if np.any(np.diff(record.t) <= 0.0):
        raise InvalidValue("filtered: the instants t must increase.")
    start = point(system, q0, v0, None, record.held.tolist(), float(record.t[0]))
    run = _Filter(record, start, np.asarray(measured, dtype=np.int64), noise, strength, time_force, (std_q0, std_v0))
    return run.through(Y, smooth)


def _check_positive(**given: Floats) -> None:
    for name, values in given.items():
        if not (np.all(np.isfinite(values)) and np.all(values > 0.0)):
            raise InvalidValue(f"filtered: {name} is {values.tolist()}; it must be finite and above 0.")


class _Record:
    """Instants and inputs of a record, and which forces are unknown in it."""

    def __init__(
        self, system: System, t: ArrayLike, u: ArrayLike | None, unknown: Unknown, active: Sequence[int] | None
    ) -> None:
        self.system, self.unknown = system, unknown
        self.t = frozen("estimate", "t", t, (None,))
        given = np.zeros((len(self.t), system.inputs)) if u is None else u
        self.u = frozen("estimate", "u", given, (len(self.t), system.inputs))
        on = np.flatnonzero(np.asarray(system.unilateral) == 0).tolist() if active is None else list(active)
        self.held: Index = np.array([i for i in on if i not in unknown.rows], dtype=np.int64)
        self.all: Index = np.concatenate([self.held, np.array(unknown.rows, dtype=np.int64)])

    def at(self, k: int, q: Floats, v: Floats) -> Point:
        """Sample k with all rows, held ones first."""
        return Point(
            system=self.system, t=float(self.t[k]), q=np.array(q), v=np.array(v), u=np.array(self.u[k]), active=self.all
        )  # fmt: skip

    def pushed(self, at: Point, force: Floats) -> Point:
        """With the unknown part of the inputs added."""
        u = at.u.copy()
        u[list(self.unknown.inputs)] += force[: len(self.unknown.inputs)]
        return replace(at, u=u)


def _input_columns(at: Point, columns: Sequence[int]) -> Floats:
    """Df/du (n, len(columns))."""
    found = np.zeros((at.system.n, len(columns)))
    for j, i in enumerate(columns):
        u = at.u.astype(complex)
        u[i] += 1j * STEP
        found[:, j] = terms(at, at.q, at.v, u)[1].imag / STEP
    return found


def _imbalance(at: Point, record: _Record, vd: Floats) -> tuple[Floats, Floats, Floats]:
    """E and e of E (lam, F) = e = M v' - f, and M."""
    blocks, f, H, _, _ = terms(at, at.q, at.v, at.u)
    na, M = len(record.held), dense(blocks)
    return np.hstack([H[:na].T, _input_columns(at, record.unknown.inputs), H[na:].T]), M @ vd - f, M


def _noise_paths(at: Point, record: _Record, vd: Floats, found: Floats, M: Floats) -> Floats:
    """How errors of q, v, v' and u come into the balance (n, 3 n + nu)."""
    n, na, own = at.system.n, len(record.held), len(record.unknown.inputs)
    here = record.pushed(at, found[na:])
    lam = np.concatenate([found[:na], found[na + own :]])
    x, columns = np.concatenate([at.q, at.v]), np.zeros((n, 2 * n))
    for k in range(2 * n):
        moved = x.astype(complex)
        moved[k] += 1j * STEP
        columns[:, k] = residual(here, moved[:n], moved[n:], here.u, vd, lam)[:n].imag / STEP
    return np.hstack([columns, M, -_input_columns(here, range(at.system.inputs))])


class _Filter:
    """State z = (q, v, F) with covariance P."""

    def __init__(
        self, record: _Record, start: Point, measured: Index, noise: Floats, strength: Floats, time: float,
        doubt: tuple[float, float],
    ) -> None:  # fmt: skip
        n, k = record.system.n, len(record.unknown)
        self.record, self.n, self.k, self.time = record, n, k, time
        self.C = np.zeros((len(measured), 2 * n + k))
        self.C[np.arange(len(measured)), measured] = 1.0
        self.R = np.diag(noise**2)
        self.Q = np.zeros((2 * n + k, 2 * n + k))
        self.Q[2 * n :, 2 * n :] = np.diag(2.0 * strength**2 / time)
        H = terms(start, start.q, start.v, start.u)[2]
        free = null_space(H) if len(H) else np.eye(n)
        self.z = np.concatenate([start.q, start.v, np.zeros(k)])
        self.P = np.zeros_like(self.Q)
        self.P[:n, :n], self.P[n : 2 * n, n : 2 * n] = doubt[0] ** 2 * free @ free.T, doubt[1] ** 2 * free @ free.T
        self.P[2 * n :, 2 * n :] = np.diag(strength**2)

    def through(self, Y: Floats, smooth: bool) -> Estimate:
        """The whole record."""
        count, size = len(Y), len(self.z)
        z, P = np.zeros((count, size)), np.zeros((count, size, size))
        before, ahead, moves = np.zeros((count, size)), np.zeros_like(P), np.zeros_like(P)
        innovation = np.zeros(Y.shape)
        for k in range(count):
            if k:
                moves[k] = self._predict(k - 1)
            before[k], ahead[k] = self.z, self.P
            innovation[k] = self._update(Y[k])
            z[k], P[k] = self.z, self.P
        if smooth:
            for k in range(count - 2, -1, -1):
                gain = np.linalg.lstsq(ahead[k + 1], moves[k + 1] @ P[k], rcond=1e-13)[0].T
                z[k] += gain @ (z[k + 1] - before[k + 1])
                P[k] += gain @ (P[k + 1] - ahead[k + 1]) @ gain.T
        n = self.n
        return Estimate(
            t=self.record.t, force=z[:, 2 * n :], covariance=P[:, 2 * n :, 2 * n :], q=z[:, :n], v=z[:, n : 2 * n],
            innovation=innovation,
        )  # fmt: skip

    def _predict(self, k: int) -> Floats:
        """Move z and P from sample k to the next; the transition matrix."""
        dt = float(self.record.t[k + 1] - self.record.t[k])
        rate, A = self._flow(k)
        size = len(rate)
        both = np.zeros((size + 1, size + 1))
        both[:size, :size], both[:size, size] = A, rate
        half = expm(0.5 * dt * both)
        whole, half = half @ half, half[:size, :size]
        move: Floats = whole[:size, :size]
        self.z = self.z + whole[:size, size]
        added = dt / 6.0 * (self.Q + 4.0 * half @ self.Q @ half.T + move @ self.Q @ move.T)
        self.P = move @ self.P @ move.T + added
        return move

    def _flow(self, k: int) -> tuple[Floats, Floats]:
        """Rate of z at sample k and its derivative."""
        n, record, force = self.n, self.record, self.z[2 * self.n :]
        at = record.pushed(record.at(k, self.z[:n], self.z[n : 2 * n]), force)
        own, na = len(record.unknown.inputs), len(record.held)
        blocks, f, H, h, drift = terms(at, at.q, at.v, at.u)
        M, rows = dense(blocks), H[:na]
        K = np.block([[M, -rows.T], [rows, np.zeros((na, na))]])
        law = at.system.alpha[record.held]
        drive = drift[:na] + law[:, 1] * (rows @ at.v) + (law[:, 0] + law[:, 2] * h[:na] ** 2) * h[:na]
        inverse = np.linalg.inv(K)
        vd, lam = np.split(inverse @ np.concatenate([f + H[na:].T @ force[own:], -drive]), [n])
        every, x = np.concatenate([lam, force[own:]]), np.concatenate([at.q, at.v])
        columns = np.zeros((n + na, 2 * n + self.k))
        for j in range(2 * n):
            moved = x.astype(complex)
            moved[j] += 1j * STEP
            columns[:, j] = residual(at, moved[:n], moved[n:], at.u, vd, every)[: n + na].imag / STEP
        columns[:n, 2 * n : 2 * n + own] = -_input_columns(at, record.unknown.inputs)
        columns[:n, 2 * n + own :] = -H[na:].T
        A = np.zeros((2 * n + self.k, 2 * n + self.k))
        A[:n, n : 2 * n], A[n : 2 * n] = np.eye(n), -(inverse @ columns)[:n]
        A[2 * n :, 2 * n :] = -np.eye(self.k) / self.time
        return np.concatenate([at.v, vd, -force / self.time]), A

    def _update(self, y: Floats) -> Floats:
        """Take in one measurement; the innovation over its deviation."""
        wrong = y - self.C @ self.z
        S = self.C @ self.P @ self.C.T + self.R
        gain = np.linalg.solve(S, self.C @ self.P).T
        keep = np.eye(len(self.z)) - gain @ self.C
        self.z = self.z + gain @ wrong
        self.P = keep @ self.P @ keep.T + gain @ self.R @ gain.T
        whitened: Floats = np.linalg.solve(np.linalg.cholesky(S), wrong)
        return whitened
