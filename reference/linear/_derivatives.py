"""Exact derivatives of the accelerations and multipliers, by complex step through the kernels.

With the active rows A, the accelerations and multipliers solve

    r(q, v, u; v', lam) = ( M v' - f - H_A^T lam ;  H_A v' + H_A' v + a1 H_A v + a0 h_A + a2 h_A^3 ) = 0

whose derivative by (v', lam) is the saddle matrix K. By the implicit function theorem one real K
serves every column: d(v', lam) = -K^-1 (dr/dx), where dr/dx at fixed v', lam is the imaginary
part of r(x + i s e_k) over s. There is no difference of nearly equal numbers, so s = 1e-30 and
the derivative is exact to rounding (Squire and Trapp 1998).

Contacts that stick have their tangential rows among those that are solved. Those that slide have
their forces, lam_t = -mu lam_n s with s = v_t/|v_t|, in the columns: K is not symmetric then, and
its columns turn with the slip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crossbody.cases import SceneError
from crossbody.reference.kinds import Array, Floats
from crossbody.reference.linear._point import STEP, Point, dense, directions, gaps, terms
from crossbody.reference.linear._rubbing import borne, check_cones, check_idle, check_jam, check_slips, loads

ILL_POSED = 1e10
"""Above this condition of H M^-1 H^T the multipliers, and so their derivatives, are ill posed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Derivatives:
    """First derivatives at a point, by x = (dq, v) and by u; dq are coordinates of the tangent space (`directions`).

    Attributes:
        vd (n,), lam (na,): accelerations and multipliers there, 0 of rows that are idle.
        vd_x (n, 2 n), vd_u (n, nu): of the accelerations.
        lam_x (na, 2 n), lam_u (na, nu): of the multipliers.
        gap_x (nc, 2 n), rate_x (nc, 2 n): of every gap and of its rate.
        size (n, 2 n + nu): of the terms that make up vd_x and vd_u: rounding is a part of it,
            however they cancel.
    """

    vd: Floats
    lam: Floats
    vd_x: Floats
    vd_u: Floats
    lam_x: Floats
    lam_u: Floats
    gap_x: Floats
    rate_x: Floats
    size: Floats


def _law(at: Point, H: Array, v: Array, h: Array, drift: Array) -> Array:
    """H' v + a1 h' + a0 h + a2 h^3 of the active rows, the rates of tangential ones against the surface's own."""
    a0, a1, a2 = at.given("alpha")[at.active].T
    law: Array = drift + a1 * (H @ v - at.given("drift")[at.active]) + (a0 + a2 * h * h) * h
    return law


def residual(at: Point, q: Array, v: Array, u: Array, vd: Floats, lam: Floats) -> Array:
    """The equations at accelerations vd and multipliers lam of the rows solved for; behind them those of idle rows."""
    blocks, f, H, h, drift = terms(at, q, v, u)
    inertia = (blocks @ vd.reshape(len(blocks), -1, 1)).ravel()
    law = H @ vd + _law(at, H, v, h, drift)
    return np.concatenate([inertia - f - borne(at, H, v, lam) @ H, law[at.solved], law[at.held]])


def saddle(at: Point) -> tuple[Floats, Floats, Floats]:
    """K, and the v' and lam of the rows that are solved for, with K (v', lam) = (f, -law).

    Raises:
        SceneError: if the active rows are redundant or jam here, a contact slides at no speed, a
            coordinate has no inertia, or a value is not finite.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        blocks, f, H, h, drift = terms(at, at.q, at.v, at.u)
        M, solved = dense(blocks), at.solved
        law = _law(at, H, at.v, h, drift)
        right = np.concatenate([f, -law[solved]])
    if not (np.all(np.isfinite(M)) and np.all(np.isfinite(H)) and np.all(np.isfinite(right))):
        raise SceneError(f"linearise: the equations have no finite value at q = {at.q.tolist()}, v = {at.v.tolist()}.")
    if not np.linalg.matrix_rank(M, hermitian=True) == len(M):
        raise SceneError(f"linearise: a coordinate has no inertia at q = {at.q.tolist()}.")
    held, na = H[solved], len(solved)
    if na and not np.linalg.cond(held @ np.linalg.solve(M, held.T)) <= ILL_POSED:
        raise SceneError(
            f"linearise: the active rows {at.active.tolist()} are redundant at q = {at.q.tolist()}; "
            "leave out those that follow from the others."
        )
    check_slips(at, H)
    rubbed = borne(at, H, at.v, np.zeros(na))
    pushed = H.T @ (borne(at, H, at.v, np.eye(na)) - rubbed[:, None])
    check_jam(at, held @ np.linalg.solve(M, pushed), held @ np.linalg.solve(M, held.T))
    K = np.block([[M, -pushed], [held, np.zeros((na, na))]])
    right[: at.system.n] += rubbed @ H
    vd, lam = np.split(np.linalg.solve(K, right), [at.system.n])
    check_idle(at, H[at.held] @ vd + law[at.held], np.abs(H) @ np.abs(np.linalg.solve(M, f)), law)
    return K, vd, lam


def implied(at: Point, K: Floats, columns: Floats, borne_x: Floats) -> tuple[Floats, Floats]:
    """Derivatives of v' (n, ...) and of the multipliers of all active rows (na, ...).

    Args:
        at: the point.
        K: the saddle matrix there.
        columns: derivatives of `residual` at fixed accelerations and multipliers.
        borne_x: of `loads`, likewise.

    Raises:
        SceneError: if idle rows are off their laws beside the point.
    """
    n, m = at.system.n, len(K)
    solved = -np.asarray(np.linalg.solve(K, columns[:m]), dtype=np.float64)
    H = terms(at, at.q, at.v, at.u)[2]
    free = np.asarray(np.linalg.solve(K[:n, :n], columns[:n]), dtype=np.float64)
    check_idle(at, H[at.held] @ solved[:n] + columns[m:], np.abs(H) @ np.abs(free), columns[n:])
    m -= n
    spread = borne(at, H, at.v, np.eye(m)) - borne(at, H, at.v, np.zeros((m, m)))
    return solved[:n], borne_x + spread @ solved[n:]


def derivatives(at: Point) -> Derivatives:
    """All first derivatives at a point.

    Raises:
        SceneError: as `saddle` and `implied`, or if a contact sticks that bears all that it can.
    """
    n, nu, nc = at.system.n, at.system.inputs, at.system.nc
    K, vd, lam = saddle(at)
    columns, slopes = np.zeros((len(K) + len(at.idle), 2 * n + nu)), np.zeros((2 * nc, 2 * n))
    borne_x = np.zeros((len(at.active), 2 * n + nu))
    steps = 1j * STEP * np.eye(2 * n + nu)
    N = directions(at.system, at.q)
    for k, step in enumerate(steps):
        q, v, u = at.q + N @ step[:n], at.v + step[n : 2 * n], at.u + step[2 * n :]
        columns[:, k] = residual(at, q, v, u, vd, lam).imag / STEP
        borne_x[:, k] = loads(at, q, v, u, lam).imag / STEP
        if k < 2 * n:
            slopes[:, k] = gaps(at, q, v).imag / STEP
    vd_x, lam_x = implied(at, K, columns, borne_x)
    every = borne(at, terms(at, at.q, at.v, at.u)[2], at.v, lam)
    check_cones(at, every)
    return Derivatives(
        vd=vd, lam=every, vd_x=vd_x[:, : 2 * n], vd_u=vd_x[:, 2 * n :], lam_x=lam_x[:, : 2 * n],
        lam_u=lam_x[:, 2 * n :], gap_x=slopes[:nc], rate_x=slopes[nc:],
        size=_sizes(K, np.abs(columns[: len(K)]), n),
    )  # fmt: skip


def _sizes(K: Floats, columns: Floats, n: int) -> Floats:
    """Sizes (n, ...) of the terms of -K^-1 columns: what moves freely, and what the rows take back of it."""
    inverse, H = np.linalg.inv(K[:n, :n]), K[n:, :n]
    pushed = inverse @ -K[:n, n:]
    free = np.abs(inverse) @ columns[:n]
    taken = np.abs(pushed @ np.linalg.inv(H @ pushed)) @ (np.abs(H) @ free + columns[n:])
    sizes: Floats = free + taken
    return sizes
