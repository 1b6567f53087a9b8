"""One explicit step of DOP853 and the coefficients of its dense output (see dop853_table)."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import OWN, accelerate
from crossbody.reference.core.algebra import copy
from crossbody.reference.core.dop853_table import DENSE_STAGES, E3, E5, STAGES, A, C, D
from crossbody.reference.core.friction import watch_slips
from crossbody.reference.core.layout import Model, Work
from crossbody.reference.kinds import Array, Floats

# The columns that are not zero, row by row: most of A is.
_COUNT = np.array([np.count_nonzero(row) for row in A])
_COLUMN = np.array([np.r_[np.flatnonzero(row), np.zeros(16 - np.count_nonzero(row))] for row in A], dtype=np.int64)
_WEIGHT = np.array([np.r_[row[row != 0], np.zeros(16 - np.count_nonzero(row))] for row in A])


OPEN = 30.0  # times what the tolerance may add to the energy of all steps: a first step can be fourteen of it off
ACCOUNTED = 10.0  # of these, what sums of powers may make up
TINY = 1e-300  # in place of an energy of nothing
START, SECOND = np.arange(2)  # stages, as values


@compiled
def derivative(K: Any, s: Any, m: Model, w: Work, t: float, y: Array, stage: int) -> int:
    """k[stage] = (q', v'), and the powers of the ledger if it is kept."""
    q, v = y[: s.nq], y[s.nq :]
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, q, v, OWN) != 0:
        return 1
    keep(K, s, m, w, t, q, v, stage)
    return 0


@compiled
def keep(K: Any, s: Any, m: Model, w: Work, t: float, q: Array, v: Array, stage: int) -> None:
    """k[stage] = (q', v') from the acceleration in the workspace, and the powers."""
    n, nq, k, vd = s.n, s.nq, w.k[stage], w.vd
    if s.has_velocity:
        K.velocity(t, q, v, m.p, k[:nq])
        for i in range(n):
            k[nq + i] = vd[i]
    else:
        for i in range(n):
            k[i] = v[i]
            k[n + i] = vd[i]
    if s.ledger:
        powers(K, s, m, w, t, q, v, stage)


@compiled
def powers(K: Any, s: Any, m: Model, w: Work, t: float, q: Array, v: Array, stage: int) -> None:
    """kz[stage] = power of every row's multiplier, of the inputs, of the damping."""
    nc, kz, idx, la, hda, e = s.nc, w.kz[stage], w.idx, w.la, w.hda, w.e
    for i in range(nc):
        kz[i] = 0.0
    for j in range(s.na):
        kz[idx[j]] = la[j] * hda[j]
    if s.frictional:
        for j in range(s.na):  # what a surface does that moves by itself is work as well
            kz[idx[j]] += la[j] * m.drift[idx[j]]
    K.power(t, q, v, w.u, m.p, e)
    kz[nc] = e[0]
    kz[nc + 1] = e[1]


@compiled
def _combine(base: Array, k: Floats, stage: int, h: float, out: Array) -> None:
    """Out = base + h sum_j A[stage, j] k[j]."""
    fours = len(base) // 4 * 4
    for i in range(0, fours, 4):  # four sums that do not wait for each other
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for j in range(_COUNT[stage]):
            weight, row = _WEIGHT[stage, j], _COLUMN[stage, j]
            a += weight * k[row, i]
            b += weight * k[row, i + 1]
            c += weight * k[row, i + 2]
            d += weight * k[row, i + 3]
        out[i], out[i + 1] = base[i] + h * a, base[i + 1] + h * b
        out[i + 2], out[i + 3] = base[i + 2] + h * c, base[i + 3] + h * d
    for i in range(fours, len(base)):
        total = 0.0
        for j in range(_COUNT[stage]):
            total += _WEIGHT[stage, j] * k[_COLUMN[stage, j], i]
        out[i] = base[i] + h * total


@compiled
def _error(s: Any, w: Work, h: float) -> float:
    """Hairer's norm of the two embedded estimates; 1 is the tolerance. NaN where a stage was NaN."""
    sum5, sum3 = 0.0, 0.0
    size = s.nq + s.n
    for i in range(size):
        e5, e3 = 0.0, 0.0
        for j in range(STAGES):
            e5 += E5[j] * w.k[j, i]
            e3 += E3[j] * w.k[j, i]
        scale = w.atol[i] + s.rtol * max(abs(w.y[i]), abs(w.y1[i]))
        sum5 += (e5 / scale) ** 2
        sum3 += (e3 / scale) ** 2
    if sum5 == 0.0 and sum3 == 0.0:
        return 0.0
    return float(abs(h) * sum5 / np.sqrt((sum5 + 0.01 * sum3) * size))


@compiled
def _account_error(K: Any, s: Any, m: Model, w: Work, h: float) -> float:
    """What the step's sums of powers leave open of the energy account, in units of what it has left and admits anew.

    A force that sets in within a step shapes its power more sharply than the motion that it brings about.
    """
    total = 0.0
    for i in range(s.nz):
        e5, e3 = 0.0, 0.0
        for j in range(STAGES):
            e5 += E5[j] * w.kz[j, i]
            e3 += E3[j] * w.kz[j, i]
        if e5 != 0.0:
            total += abs(h) * e5 * e5 / np.sqrt(e5 * e5 + 0.01 * e3 * e3)
    part = ACCOUNTED * np.sqrt(s.nq + s.n) * s.rtol
    left = ACCOUNTED / OPEN * max(s.energy_allowed - abs(s.energy_open), 0.0)
    if total <= part * s.energy_size + left:
        return 0.0
    K.energy(w.y1[: s.nq], w.y1[s.nq :], m.p, w.e)
    size = abs(w.e[0]) + abs(w.e[1])
    for i in range(s.nz):
        size += abs(w.z1[i])
    return float(total / max(part * max(size, s.energy_size) + left, TINY))


@compiled
def watch_guards(K: Any, s: Any, m: Model, w: Work, t: float, place: int) -> None:
    """Keep the discrete variables' guards at a stage."""
    K.watch(t, w.ys[: s.nq], w.ys[s.nq :], m.p, w.guard_at[place])


@compiled
def watch_multipliers(s: Any, m: Model, w: Work, stage: int) -> None:
    """Keep the multipliers at a stage, and slips: a free filter for events."""
    lam_at, la, idx = w.lam_at, w.la, w.idx
    for j in range(s.na):
        lam_at[stage, idx[j]] = la[j]
    if s.frictional:
        watch_slips(s, m, w, stage)


@compiled
def keep_velocity(s: Any, w: Work, stage: int) -> None:
    """Keep v at a stage where k has q' instead: its integral over the step shapes the interpolant."""
    if s.has_velocity:
        copy(w.ys[s.nq :], w.stage_v[stage])


@compiled
def watch_gaps(K: Any, s: Any, m: Model, w: Work, t: float, place: int) -> None:
    """Keep the gaps at a stage."""
    s.guards += 1
    K.gaps(t, w.ys[: s.nq], w.ys[s.nq :], m.p, w.gap_at[place], w.rate)


@compiled
def step(K: Any, s: Any, m: Model, w: Work, h: float) -> float:
    """From y and k[0] to y1; returns the error in units of the tolerance, -1 if a stage is ill posed."""
    for stage in range(1, STAGES):
        _combine(w.y, w.k, stage, h, w.ys)
        t = s.t + C[stage] * h
        if derivative(K, s, m, w, t, w.ys, stage) != 0:
            return -1.0
        watch_multipliers(s, m, w, stage)
        if stage == 4 or stage == 8 or stage == 10:
            if s.switching and s.na < s.nc:
                watch_gaps(K, s, m, w, t, stage // 4 + stage // 10 - 1)
            if s.ng > 0:
                watch_guards(K, s, m, w, t, stage // 4 + stage // 10 - 1)
    _combine(w.y, w.k, STAGES, h, w.y1)
    error = _error(s, w, h)
    if s.ledger:
        _combine(w.z, w.kz, STAGES, h, w.z1)
        if error <= 1.0:
            error = max(error, _account_error(K, s, m, w, h))
    return error


@compiled
def make_dense(K: Any, s: Any, m: Model, w: Work) -> int:
    """Coefficients of the dense output over the step just taken; k[12] = f(y1) must be there."""
    h, t = s.hs, s.t_old
    for stage in range(STAGES + 1, DENSE_STAGES):
        _combine(w.y, w.k, stage, h, w.ys)
        if derivative(K, s, m, w, t + C[stage] * h, w.ys, stage) != 0:
            return 1
    _polynomial(w.y, w.y1, w.k, h, w.F)
    if s.ledger:
        _polynomial(w.z, w.z1, w.kz, h, w.Fz)
    return 0


@compiled
def _polynomial(y: Array, y1: Array, k: Floats, h: float, F: Floats) -> None:
    for i in range(len(y)):
        delta = y1[i] - y[i]
        F[0, i] = delta
        F[1, i] = h * k[0, i] - delta
        F[2, i] = 2.0 * delta - h * (k[STAGES, i] + k[0, i])
        for r in range(4):
            total = 0.0
            for j in range(DENSE_STAGES):
                total += D[r, j] * k[j, i]
            F[3 + r, i] = h * total


@compiled
def evaluate(y: Array, F: Floats, theta: float, out: Array) -> None:
    """Out = the dense output at theta in [0, 1]."""
    for i in range(len(y)):
        value = F[6, i] * theta
        value = (value + F[5, i]) * (1.0 - theta)
        value = (value + F[4, i]) * theta
        value = (value + F[3, i]) * (1.0 - theta)
        value = (value + F[2, i]) * theta
        value = (value + F[1, i]) * (1.0 - theta)
        out[i] = y[i] + (value + F[0, i]) * theta
