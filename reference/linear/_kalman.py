"""Extended Kalman filter whose unknown force is a process of known size and correlation time (Gauss and Markov).

The state is z = (q, v, F). Between samples it follows the equations linearised at the older one, exactly.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import null_space

from crossbody.reference.kinds import Floats, Index
from crossbody.reference.linear._derivatives import residual
from crossbody.reference.linear._point import STEP, Point, dense, terms
from crossbody.reference.linear._unmeasured import Estimate, Record, input_columns

TERMS, REACH = 12, 0.5  # of the exponential's series: the rest of it is below 0.5^13/13! = 2e-14
LOST = 1e-13
"""Part of the largest direction of a covariance below which it has none: what the rows hold does not vary."""


class Filter:
    """State z = (q, v, F) with covariance P.

    Args:
        record: instants, inputs, and what is unknown.
        start: state near the start, on the active rows.
        measured: coordinates that are measured.
        noise: deviation of their errors (ny,).
        strength: deviation of the unknown forces (k,).
        time: their correlation time, s.
        doubt: deviation of positions and velocities at the start, in what the rows leave free.
    """

    def __init__(
        self, record: Record, start: Point, measured: Index, noise: Floats, strength: Floats, time: float,
        doubt: tuple[float, float],
    ) -> None:  # fmt: skip
        n, k = record.system.n, len(record.unknown)
        H = terms(start, start.q, start.v, start.u)[2]
        free = null_space(H) if len(H) else np.eye(n)
        self.record, self.n, self.time = record, n, time
        self.z = np.concatenate([start.q, start.v, np.zeros(k)])
        self.P, self.Q, self.C = (np.zeros((rows, 2 * n + k)) for rows in (2 * n + k, 2 * n + k, len(measured)))
        self.P[:n, :n], self.P[n : 2 * n, n : 2 * n] = (d**2 * free @ free.T for d in doubt)
        self.P[2 * n :, 2 * n :] = np.diag(strength**2)
        self.Q[2 * n :, 2 * n :] = np.diag(2.0 * strength**2 / time)
        self.C[np.arange(len(measured)), measured] = 1.0
        self.R = np.diag(noise**2)

    def through(self, Y: Floats, smooth: bool) -> Estimate:
        """The whole record of measurements Y (N, ny)."""
        n, count, size = self.n, len(Y), len(self.z)
        z, P = np.zeros((count, size)), np.zeros((count, size, size))
        before, ahead, moves = np.zeros_like(z), np.zeros_like(P), np.zeros_like(P)
        innovation = np.zeros(Y.shape)
        for k in range(count):
            if k:
                moves[k] = self._predict(k - 1)
            before[k], ahead[k] = self.z, self.P
            innovation[k] = self._update(Y[k])
            z[k], P[k] = self.z, self.P
        if smooth:
            smoothed(z, P, before, ahead, moves)
        return Estimate(
            t=self.record.t, force=z[:, 2 * n :], covariance=P[:, 2 * n :, 2 * n :], q=z[:, :n],
            v=z[:, n : 2 * n], innovation=innovation,
        )  # fmt: skip

    def _predict(self, k: int) -> Floats:
        """Move z and P from sample k to the next; the transition matrix."""
        dt, size, Q = float(self.record.t[k + 1] - self.record.t[k]), len(self.z), self.Q
        both = np.zeros((size + 1, size + 1))  # of (z - z_k, 1): rate and derivative in one exponential
        both[:size, size], both[:size, :size] = self._flow(k)
        half = exponential(0.5 * dt * both)
        whole, half = half @ half, half[:size, :size]
        move: Floats = whole[:size, :size]
        self.z = self.z + whole[:size, size]
        added = dt / 6.0 * (Q + 4.0 * half @ Q @ half.T + move @ Q @ move.T)
        self.P = move @ self.P @ move.T + added
        return move

    def _flow(self, k: int) -> tuple[Floats, Floats]:
        """Rate of z at sample k, and its derivative."""
        n, force = self.n, self.z[2 * self.n :]
        at = self.record.pushed(self.record.at(k, self.z[:n], self.z[n : 2 * n]), force)
        vd, by_z = accelerated(at, self.record, force)
        A = np.zeros_like(self.P)
        A[:n, n : 2 * n], A[n : 2 * n] = np.eye(n), by_z
        A[2 * n :, 2 * n :] = -np.eye(len(force)) / self.time
        return np.concatenate([at.v, vd, -force / self.time]), A

    def _update(self, y: Floats) -> Floats:
        """Take in one measurement; the innovation over its deviation."""
        wrong = y - self.C @ self.z
        S = self.C @ self.P @ self.C.T + self.R
        gain = np.linalg.solve(S, self.C @ self.P).T
        keep = np.eye(len(self.z)) - gain @ self.C
        self.z = self.z + gain @ wrong
        self.P = keep @ self.P @ keep.T + gain @ self.R @ gain.T
        return np.linalg.solve(np.linalg.cholesky(S), wrong)


def accelerated(at: Point, record: Record, force: Floats) -> tuple[Floats, Floats]:
    """Accelerations (n,) under the unknown force, and their derivative (n, 2 n + k) by z.

    The inputs' part of the force is in `at` already; that of rows is H_F^T F.
    """
    n, own, na = at.system.n, len(record.unknown.inputs), len(record.held)
    blocks, f, H, h, drift = terms(at, at.q, at.v, at.u)
    a0, a1, a2 = at.system.alpha[record.held].T
    held, free, h = H[:na], H[na:], h[:na]
    law = drift[:na] + a1 * (held @ at.v) + (a0 + a2 * h * h) * h
    inverse = np.linalg.inv(np.block([[dense(blocks), -held.T], [held, np.zeros((na, na))]]))
    vd, lam = np.split(inverse @ np.concatenate([f + free.T @ force[own:], -law]), [n])
    every, x = np.concatenate([lam, force[own:]]), np.concatenate([at.q, at.v])
    columns = np.zeros((n + na, 2 * n + len(force)))
    for j in range(2 * n):
        moved = x.astype(complex)
        moved[j] += 1j * STEP
        columns[:, j] = residual(at, moved[:n], moved[n:], at.u, vd, every)[: n + na].imag / STEP
    columns[:n, 2 * n : 2 * n + own] = -input_columns(at, record.unknown.inputs)
    columns[:n, 2 * n + own :] = -free.T
    return vd, -(inverse @ columns)[:n]


def smoothed(z: Floats, P: Floats, before: Floats, ahead: Floats, moves: Floats) -> None:
    """Carry what comes later back to every sample, in place (Rauch, Tung and Striebel 1965).

    Args:
        z: filtered states (N, size).
        P: their covariances (N, size, size).
        before: the states before their measurement.
        ahead: covariances of those.
        moves: transition matrices to every sample from the one before.
    """
    for k in range(len(z) - 2, -1, -1):
        gain = np.linalg.lstsq(ahead[k + 1], moves[k + 1] @ P[k], rcond=LOST)[0].T
        z[k] += gain @ (z[k + 1] - before[k + 1])
        P[k] += gain @ (P[k + 1] - ahead[k + 1]) @ gain.T


def exponential(X: Floats) -> Floats:
    """Exp(X) of a small matrix, its series after halving.

    scipy.linalg.expm factorises, in threads of OpenBLAS: two of them on a busy machine made a
    whole filter 2.3 times as slow (OPENBLAS_NUM_THREADS=2 against 1).
    """
    halvings = max(0, int(np.ceil(np.log2(max(float(np.linalg.norm(X, 1)) / REACH, 1.0)))))
    small, one = X / 2.0**halvings, np.eye(len(X))
    E = one
    for k in range(TERMS, 0, -1):
        E = one + small @ E / k
    for _ in range(halvings):
        E = E @ E
    return E
