"""Forces read off one instant at a time, where accelerations are at hand: generalised least squares."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import InvalidValue
from crossbody.cases.arrays import frozen, full
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats
from crossbody.reference.linear._derivatives import residual
from crossbody.reference.linear._point import STEP, Point, dense, terms
from crossbody.reference.linear._unmeasured import LARGEST, Estimate, Record, Unknown, input_columns


@checked_arguments
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
    record = Record(system, t, u, unknown, active)
    n, na = system.n, len(record.held)
    Q, V, VD = (frozen("balanced", k, x, (len(record.t), n)) for k, x in (("q", q), ("v", v), ("vd", vd)))
    stated = (("std_q", std_q), ("std_v", std_v), ("std_vd", std_vd))
    spread = np.concatenate([full("balanced", name, value, n) for name, value in stated])
    inputs = full("balanced", "std_u", std_u, system.inputs)
    if not np.all((whole := np.concatenate([spread, inputs])) >= 0.0) or not np.all(whole <= LARGEST):
        raise InvalidValue(f"balanced: deviations are {whole.tolist()}; valid: 0 to {LARGEST:g}.")
    if not whole.any():
        raise InvalidValue("balanced: give the deviation of at least one of q, v, vd, u.")
    found, covariance = np.zeros((len(Q), na + len(unknown))), np.zeros((len(Q), na + len(unknown), na + len(unknown)))
    for k in range(len(Q)):
        at = record.at(k, Q[k], V[k])
        E, e, M = _imbalance(at, record, VD[k])
        first: Floats = np.linalg.lstsq(E, e, rcond=None)[0].astype(np.float64)
        J = _noise_paths(at, record, VD[k], first, M)
        W = J * whole
        left, size, _ = np.linalg.svd(W @ W.T)
        whiten = left.T / np.sqrt(np.maximum(size, 1e-12 * size[0]))[:, None]
        pinv = np.linalg.pinv(whiten @ E)
        found[k], covariance[k] = pinv @ (whiten @ e), pinv @ pinv.T
    return Estimate(
        t=record.t, force=found[:, na:], covariance=covariance[:, na:, na:], q=Q, v=V, innovation=np.zeros((len(Q), 0))
    )  # fmt: skip


def _imbalance(at: Point, record: Record, vd: Floats) -> tuple[Floats, Floats, Floats]:
    """E and e of E (lam, F) = e = M v' - f, and M."""
    blocks, f, H, _, _ = terms(at, at.q, at.v, at.u)
    na, M = len(record.held), dense(blocks)
    return np.hstack([H[:na].T, input_columns(at, record.unknown.inputs), H[na:].T]), M @ vd - f, M


def _noise_paths(at: Point, record: Record, vd: Floats, found: Floats, M: Floats) -> Floats:
    """How errors of q, v, v' and u come into the balance (n, 3 n + nu)."""
    n, na, own = at.system.n, len(record.held), len(record.unknown.inputs)
    here = record.pushed(at, found[na:])
    lam = np.concatenate([found[:na], found[na + own :]])
    x, columns = np.concatenate([at.q, at.v]), np.zeros((n, 2 * n))
    for k in range(2 * n):
        moved = x.astype(complex)
        moved[k] += 1j * STEP
        columns[:, k] = residual(here, moved[:n], moved[n:], here.u, vd, lam)[:n].imag / STEP
    return np.hstack([columns, M, -input_columns(here, range(at.system.inputs))])
