"""Derivatives of one mechanism at many points, in threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import InvalidValue
from crossbody.cases.arrays import distinct, frozen
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference._system import System
from crossbody.reference.kinds import Array, Floats, Index
from crossbody.reference.linear import _compiled
from crossbody.reference.linear._pattern import Pattern, coloured, dense, observed
from crossbody.reference.linear._point import Point, check_coordinates
from crossbody.reference.linear.linearisation import point

CHUNKS = 8  # parts a thread takes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tangents:
    """Derivatives at N points in one set of modes.

    Attributes:
        vd (N, n), lam (N, na): accelerations and multipliers of the active rows.
        vd_x (N, n, 2 n), vd_u (N, n, nu): derivatives of the accelerations by (q, v) and by u.
        lam_x (N, na, 2 n), lam_u (N, na, nu): of the multipliers.
        well_posed (N,): where they exist; elsewhere they are NaN.
    """

    vd: Floats
    lam: Floats
    vd_x: Floats
    vd_u: Floats
    lam_x: Floats
    lam_u: Floats
    well_posed: Array


@checked_arguments
def tangents(
    system: System, q: ArrayLike, v: ArrayLike | None = None, u: ArrayLike | None = None,
    active: Sequence[int] | None = None, *, t: float = 0.0, threads: int | None = None,
) -> Tangents:  # fmt: skip
    """First derivatives of accelerations and multipliers at many states, exact to rounding.

    What `linearise` finds at one state, compiled: about as long as 30 right-hand sides a state
    (Curtis, Powell and Reid 1974 for the columns that are stepped together).

    Args:
        system: the mechanism.
        q: positions (N, n).
        v: velocities (N, n), zero if not given.
        u: inputs (N, nu), zero if not given.
        active: rows that are on; those that are always on, if not given.
        t: time, s.
        threads: the processors at hand, if not given.

    Raises:
        SceneError: for arrays of another shape, or rows that do not exist.
        InvalidValue: for a number of threads below 1.
    """
    X = states(system, q, v, u)
    at = first(system, X, active, t)
    n = system.n
    vd, lam, derivative, codes = _evaluated(at, X, coloured(observed(at)), threads)
    missed = np.flatnonzero(codes == _compiled.MISSED)
    if len(missed):
        again = _evaluated(at, X[missed], dense(n + len(at.active), X.shape[1]), threads)
        for whole, part in zip((vd, lam, derivative, codes), again, strict=True):
            whole[missed] = part
    good = (codes == _compiled.FOUND) & np.isfinite(derivative).all(axis=(1, 2))
    for whole in (vd, lam, derivative):
        whole[~good] = np.nan
    return Tangents(
        vd=vd, lam=lam, vd_x=derivative[:, :n, : 2 * n], vd_u=derivative[:, :n, 2 * n :],
        lam_x=derivative[:, n:, : 2 * n], lam_u=derivative[:, n:, 2 * n :], well_posed=good,
    )  # fmt: skip


def states(system: System, q: ArrayLike, v: ArrayLike | None, u: ArrayLike | None) -> Floats:
    """Lines (q, v, u), checked (N, 2 n + nu)."""
    check_coordinates(system)
    positions = frozen("tangents", "q", q, (None, system.n))
    count = len(positions)
    rates = frozen("tangents", "v", np.zeros((count, system.n)) if v is None else v, (count, system.n))
    inputs = frozen("tangents", "u", np.zeros((count, system.inputs)) if u is None else u, (count, system.inputs))
    return np.hstack([positions, rates, inputs])


def first(system: System, X: Floats, active: Sequence[int] | None, t: float) -> Point:
    """The first of these states."""
    n = system.n
    line = X[0] if len(X) else np.zeros(X.shape[1])
    return point(system, line[:n], line[n : 2 * n], line[2 * n :], active, t)


def _evaluated(at: Point, X: Floats, pattern: Pattern, threads: int | None) -> tuple[Floats, Floats, Floats, Index]:
    system, n, na = at.system, at.system.n, len(at.active)
    vd, lam = np.zeros((len(X), n)), np.zeros((len(X), na))
    derivative, codes = np.zeros((len(X), n + na, X.shape[1])), np.zeros(len(X), np.int64)
    P, law = np.array(system.p, dtype=complex)[None], np.array(system.alpha[at.active], order="C")

    def part(a: int, b: int) -> None:
        scratch = np.zeros(system.scratch, dtype=complex)
        _compiled.tangents(
            system.dynamics, system.rows, system.mass_block, at.t,
            X[a:b], P, scratch, law, at.active, pattern.colours, pattern.count,
            pattern.nonzero, pattern.probe, vd[a:b], lam[a:b], derivative[a:b], codes[a:b],
        )  # fmt: skip

    shared(part, len(X), threads)
    return vd, lam, derivative, codes


def shared(part: Callable[[int, int], None], count: int, threads: int | None) -> None:
    """Call part(a, b) on ranges that cover 0..count, in threads.

    Raises:
        InvalidValue: for a number of threads below 1.
    """
    workers = threads if threads is not None else len(os.sched_getaffinity(0))
    if not workers >= 1:
        raise InvalidValue(f"threads is {threads}; it must be at least 1.")
    edges = distinct(np.linspace(0, count, workers * CHUNKS + 1).astype(int)).tolist()
    if workers == 1 or count < 2 * CHUNKS:
        part(0, count)
        return
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(lambda ends: part(*ends), pairwise(edges)))
