"""Stability of many held poses: trim, minimal linear model and its poles at each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import SceneError
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference._system import System
from crossbody.reference.kinds import Array, Floats, Index
from crossbody.reference.linear import _held
from crossbody.reference.linear._compiled import FOUND, ILL_POSED, MISSED
from crossbody.reference.linear._many import first, shared, states
from crossbody.reference.linear._pattern import Pattern, coloured, dense, observed
from crossbody.reference.linear._point import Point


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Poses:
    """Held poses and the small motions about them; NaN where a pose is not well posed.

    Attributes:
        u (N, nu): inputs of equilibrium.
        lam (N, na): multipliers of the active rows.
        basis (N, n, m): dq = basis @ y, y the m coordinates that are free.
        A (N, 2 m, 2 m): of the states (y, y').
        poles (N, 2 m): eigenvalues of A, 1/s.
        well_posed (N,): where the inputs determine the pose.
    """

    u: Floats
    lam: Floats
    basis: Floats
    A: Floats
    poles: Array
    well_posed: Array

    @property
    def growth(self) -> Floats:
        """Largest real part of the poles (N,), 1/s."""
        largest: Floats = self.poles.real.max(axis=1, initial=-np.inf)
        return largest


@checked_arguments
def poses(
    system: System, q: ArrayLike, hold: Sequence[int], active: Sequence[int] | None = None, *,
    u: ArrayLike | None = None, t: float = 0.0, threads: int | None = None,
) -> Poses:  # fmt: skip
    """Trim and linearise a mechanism at rest in many poses, each held by constant inputs.

    Args:
        system: the mechanism; its forces are affine in the inputs that hold.
        q: poses (N, n), on the active rows.
        hold: inputs that are found, as many as the rows leave freedoms.
        active: rows that are on; those that are always on, if not given.
        u: the other inputs (N, nu), zero if not given.
        t: time, s.
        threads: the processors at hand, if not given.

    Raises:
        SceneError: for arrays of another shape, or another number of inputs than of freedoms.
    """
    X = states(system, q, None, u)
    at = first(system, X, active, t)
    chosen, n = np.asarray(hold, dtype=np.int64), system.n
    freedoms = n - len(at.active)
    if len(set(chosen.tolist())) != freedoms or np.any(chosen < 0) or np.any(chosen >= system.inputs):
        raise SceneError(
            f"poses.hold is {chosen.tolist()}; it must name {freedoms} inputs below {system.inputs}, "
            f"one for each freedom that the active rows leave."
        )
    nonzero = observed(at)[:n, : 2 * n]
    found = _evaluated(at, X, chosen, coloured(nonzero), threads)
    missed = np.flatnonzero(found[-1] == MISSED)
    if len(missed):
        again = _evaluated(at, X[missed], chosen, dense(n, 2 * n), threads)
        for whole, part in zip(found, again, strict=True):
            whole[missed] = part
    inputs, lam, basis, A, values, codes = found
    good = codes == FOUND
    for whole in (inputs, lam, basis, A, values):
        whole[~good] = np.nan
    return Poses(u=inputs, lam=lam, basis=basis, A=A, poles=values, well_posed=good)


def _evaluated(
    at: Point, X: Floats, hold: Index, pattern: Pattern, threads: int | None
) -> tuple[Floats, Floats, Floats, Floats, Array, Index]:
    system, n, na, count = at.system, at.system.n, len(at.active), len(X)
    m = n - na
    u, lam, basis = X[:, 2 * n :].copy(), np.zeros((count, na)), np.zeros((count, n, m))
    A, codes = np.zeros((count, 2 * m, 2 * m)), np.zeros(count, np.int64)
    values = np.zeros((count, 2 * m), dtype=complex)
    Q = np.ascontiguousarray(X[:, :n])
    P = np.array(system.p, dtype=complex)[None]

    def part(a: int, b: int) -> None:
        scratch = np.zeros(system.scratch, dtype=complex)
        _held.held(
            system.dynamics, system.rows, system.mass_block, at.t,
            Q[a:b], P, scratch, at.active, hold, pattern.colours, pattern.count,
            pattern.nonzero, pattern.probe, u[a:b], lam[a:b], basis[a:b], A[a:b], codes[a:b],
        )  # fmt: skip
        bad = ~np.isfinite(A[a:b]).all(axis=(1, 2))
        codes[a:b][bad], A[a:b][bad] = ILL_POSED, 0.0
        values[a:b] = np.linalg.eigvals(A[a:b])

    shared(part, count, threads)
    return u, lam, basis, A, values, codes
