"""What is written down: one row of numbers a sample, t | q | v | gap | lam | energy | ledger."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core import dense, peaks
from crossbody.reference.core.acceleration import scatter
from crossbody.reference.core.algebra import copy
from crossbody.reference.core.layout import EXACT, NEVER, Model, Work
from crossbody.reference.kinds import Array, Bytes, Floats

ARC_POINTS = 16  # an arc in closed form is one step, however long: these points show its shape
LEAST_POINTS = 2  # of a flight that is short against the longest: bounces that accumulate are many


@compiled
def write_row(
    s: Any, w: Work, mode: Bytes, t: float, y: Array, lam: Array, z: Array, out: Floats, modes: Bytes
) -> None:  # fmt: skip
    """Append one row, with the gaps in w.gap and the energies in w.e."""
    nc, r, at = s.nc, s.rows, 1 + s.nq + s.n
    row = out[r]
    row[0] = t
    _put(row, 1, y)
    _put(row, at, w.gap)
    _put(row, at + nc, lam)
    at += 2 * nc
    row[at] = w.e[0]
    row[at + 1] = w.e[1]
    _put(row, at + 2, z)
    for i in range(nc):
        modes[r, i] = mode[i]
    s.rows = r + 1
    wrong = 0.0  # gaps, energies and powers steer no step
    for i in range(len(row)):
        wrong += row[i] - row[i] if s.has_energy or i < at or i > at + 1 else 0.0
    if wrong != 0.0:
        s.spoilt = 1


@compiled
def _put(row: Array, at: int, x: Array) -> None:
    """Write x into a row from place `at` on."""
    for i in range(len(x)):
        row[at + i] = x[i]


@compiled
def here(K: Any, s: Any, m: Model, w: Work, mode: Bytes, out: Floats, modes: Bytes, judged: bool) -> None:
    """Append the present state with its gaps, in w.gap, and multipliers; `judged` if its energies have just been."""
    if s.natural:
        if not judged:
            K.energy(w.y[: s.nq], w.y[s.nq :], m.p, w.e)
        write_row(s, w, mode, s.t, w.y, w.lam0, w.z, out, modes)


@compiled
def samples_here(s: Any, w: Work, mode: Bytes, samples: Floats, out: Floats, modes: Bytes) -> None:
    """Append the samples asked for up to the present instant, which no step writes: they have the present state."""
    while s.next_sample < len(samples) and samples[s.next_sample] <= s.t:
        write_row(s, w, mode, samples[s.next_sample], w.y, w.lam0, w.z, out, modes)
        s.next_sample += 1


@compiled
def step_end(K: Any, s: Any, m: Model, w: Work, mode: Bytes, out: Floats, modes: Bytes) -> None:
    """Append the end of a step in which nothing happened: its last node knows the gaps, its account the energies."""
    if s.natural and dense.long_for_rows(s):  # the node may have been moved onto the rows
        K.gaps(s.t, w.y[: s.nq], w.y[s.nq :], m.p, w.gap, w.rate)
    elif s.natural:
        copy(w.gaps[0], w.gap)
    here(K, s, m, w, mode, out, modes, s.audited)


@compiled
def _inside(K: Any, s: Any, m: Model, w: Work, mode: Bytes, t: float, out: Floats, modes: Bytes) -> None:
    """Append the state at a time inside the step."""
    theta = min(max((t - s.t_old) / s.hs, 0.0), 1.0)
    dense.prepare(K, s, m, w)
    dense.with_rows(K, s, m, w, theta, t, w.ys, True)
    scatter(s, w, w.lam)
    z = w.z
    if s.ledger and s.method != EXACT:
        z = w.kz[1]
        dense.ledger(s, w, theta, z)
    q, v = w.ys[: s.nq], w.ys[s.nq :]
    K.gaps(t, q, v, m.p, w.gap, w.rate)
    K.energy(q, v, m.p, w.e)
    write_row(s, w, mode, t, w.ys, w.lam, z, out, modes)


@compiled
def _points(s: Any, length: float) -> int:
    """Intervals into which rows cut an arc in closed form: all while a contact lasts, of a flight by its length."""
    if s.na > 0:
        return ARC_POINTS
    s.longest_flight = max(s.longest_flight, length)
    return max(LEAST_POINTS, int(np.ceil(ARC_POINTS * length / s.longest_flight)))


@compiled
def _shape(K: Any, s: Any, m: Model, w: Work, mode: Bytes, until: float, out: Floats, modes: Bytes) -> None:
    """Append the peaks of multipliers in the step, and the shape of an arc, in the order of time."""
    length = until - s.t_old
    peaks.find(K, s, m, w, min(s.theta, 1.0))
    count = _points(s, length) if s.method == EXACT else 1
    for j in range(1, count + 1):
        t = s.t_old + length * j / count
        place = peaks.first(s, w)
        while place < NEVER and s.t_old + place * s.hs < t:
            _inside(K, s, m, w, mode, s.t_old + place * s.hs, out, modes)
            peaks.drop(s, w, place)
            place = peaks.first(s, w)
        if j < count:
            _inside(K, s, m, w, mode, t, out, modes)


@compiled
def within_step(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, samples: Floats, until: float, out: Floats, modes: Bytes
) -> None:  # fmt: skip
    """Append the samples asked for up to `until`, before the step's end is taken over."""
    if s.natural:
        if s.na > 0 or s.method == EXACT:
            _shape(K, s, m, w, mode, until, out, modes)
        return
    while s.next_sample < len(samples) and samples[s.next_sample] <= until:
        _inside(K, s, m, w, mode, samples[s.next_sample], out, modes)
        s.next_sample += 1
