"""Exact derivatives of the accelerations and multipliers, by complex step through the kernels.

With the active rows A, the accelerations and multipliers solve

    r(q, v, u; v', lam) = ( M v' - f - H_A^T lam ;  H_A v' + H_A' v + a1 H_A v + a0 h_A + a2 h_A^3 ) = 0

whose derivative by (v', lam) is the saddle matrix K. By the implicit function theorem one real K serves every column:
d(v', lam) = -K^-1 (dr/dx), where dr/dx at fixed v', lam is the imaginary part of r(x + i s e_k) over s. There is no
difference of nearly equal numbers, so s = 1e-30 and the derivative is exact to rounding (Squire and Trapp 1998).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crossbody.cases import SceneError
from crossbody.cases.control import Control
from crossbody.reference._system import System
from crossbody.reference.kinds import Array, Floats, Index

STEP = 1e-30
ILL_POSED = 1e10
"""Above this condition of H M^-1 H^T the multipliers, and so their derivatives, are ill posed (spec 3.5)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Point:
    """Where a mechanism is linearised.

    Attributes:
        system: the mechanism.
        t: time, s.
        q (nq,), v (n,), u (nu,): state and inputs.
        active (na,): the rows that are on.
        p: parameters in place of the system's own; complex for a step in one of them.
        alpha (nc, 3): a0, a1, a2 in force in place of the system's slow constants.
    """

    system: System
    t: float
    q: Floats
    v: Floats
    u: Floats
    active: Index
    p: Array | None = None
    alpha: Array | None = None

    def __post_init__(self) -> None:
        """Refuse what has no derivatives here."""
        check_frictionless(self.system)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Derivatives:
    """First derivatives at a point, by x = (dq, v) and by u; dq are coordinates of the tangent space (`directions`).

    Attributes:
        vd (n,), lam (na,): accelerations and multipliers there.
        vd_x (n, 2 n), vd_u (n, nu): of the accelerations.
        lam_x (na, 2 n), lam_u (na, nu): of the multipliers.
        gap_x (nc, 2 n), rate_x (nc, 2 n): of every gap and of its rate.
        size (n, 2 n + nu): of the terms that make up vd_x and vd_u: rounding is a part of it, however they cancel.
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


def check_frictionless(system: System) -> None:
    """Refuse contacts with friction.

    Raises:
        SceneError: if there are any.
    """
    if system.frictional:
        raise SceneError("The system has contacts with friction (System.mu), whose derivatives are not done.")


def check_held(system: System, *, driven: bool = False) -> None:
    """Refuse a system whose inputs follow from its state in a way that has no derivative.

    Raises:
        SceneError: if a controller in Python gives its inputs, or some of them are activations.
    """
    check_frictionless(system)
    if system.activations is not None and not driven:
        raise SceneError("Actuators with an activation have a state beside q and v: only linearise knows it.")
    if isinstance(system.control, Control):
        raise SceneError(
            f"System.control is the controller {system.control.label} in Python, which has no derivatives; "
            "valid: the system without it, its inputs held."
        )


def check_coordinates(system: System) -> None:
    """Refuse a system whose positions are not integrals of its velocities, where the tangent space is not enough.

    Raises:
        SceneError: if so, or as `check_held`.
    """
    check_held(system)
    if system.velocity is not None:
        raise SceneError(
            "System.velocity is given: q' is not v. Derivatives at many states and estimates of forces are there for "
            "systems whose velocities are the derivatives of their positions alone; valid: linearise, sensitivity."
        )


def directions(system: System, q: Floats) -> Floats:
    """N (nq, n): how positions change with the coordinates dq of the tangent space at q, which change as v acts."""
    if system.velocity is None:
        return np.eye(system.n)
    return np.stack([system.displacement(q, e) for e in np.eye(system.n)], axis=-1)


def turning(system: System, t: float, q: Floats, v: Floats) -> Floats:
    """T (n, n) of dq' = T dq + dv along a motion: the tangent space moves with it; 0 where q' = v, and at rest.

    With q' = F(q, v) = N(q) v + r(q) and a deviation N dq of the positions, N dq' = (dF/dq) N dq - (dN/dt) dq + N dv,
    which for a quaternion is dq' = dv - v x dq. Both derivatives are complex steps through the kernel.
    """
    n = system.n
    if system.velocity is None or not v.any():
        return np.zeros((n, n))
    N, p = directions(system, q), np.asarray(system.p).astype(complex)

    def along(d: Floats, at: Floats) -> Floats:
        """Derivative of F(q, at) along positions d."""
        out = np.zeros(system.nq, complex)
        system.velocity(t, q + 1j * STEP * d, at.astype(complex), p, out)
        return np.asarray(out.imag / STEP)

    flow, still = system.rates(q, v, t), np.zeros(n)
    bent = [along(N[:, k], v) - along(flow, e) + along(flow, still) for k, e in enumerate(np.eye(n))]
    return np.asarray(np.linalg.lstsq(N, np.stack(bent, axis=-1), rcond=None)[0], dtype=np.float64)


def terms(at: Point, q: Array, v: Array, u: Array) -> tuple[Array, Array, Array, Array, Array]:
    """M in blocks (n/k, k, k), f, and of the active rows H, h, H' v; in the type of the state."""
    system, na, given = at.system, len(at.active), at.system.p if at.p is None else at.p
    kind = np.result_type(q, v, u, given)
    p, w = given.astype(kind), np.zeros(system.scratch, kind)
    blocks, f = np.zeros((system.n, system.mass_block), kind), np.zeros(system.n, kind)
    H, h, drift = np.zeros((na, system.n), kind), np.zeros(na, kind), np.zeros(na, kind)
    q, v, u = q.astype(kind), v.astype(kind), u.astype(kind)
    system.dynamics(at.t, q, v, u, p, blocks, f, w)
    system.rows(at.t, q, v, p, w, at.active, na, H, h, drift)
    return blocks.reshape(-1, system.mass_block, system.mass_block), f, H, h, drift


def dense(blocks: Array) -> Array:
    """The block-diagonal matrix (n, n)."""
    count, k, _ = blocks.shape
    M = np.zeros((count, k, count, k), blocks.dtype)
    each = np.arange(count)
    M[each, :, each, :] = blocks
    dense: Array = M.reshape(count * k, count * k)
    return dense


def _law(at: Point, H: Array, v: Array, h: Array, drift: Array) -> Array:
    """H' v + a1 h' + a0 h + a2 h^3 of the active rows."""
    a0, a1, a2 = (at.system.alpha if at.alpha is None else at.alpha)[at.active].T
    law: Array = drift + a1 * (H @ v) + (a0 + a2 * h * h) * h
    return law


def residual(at: Point, q: Array, v: Array, u: Array, vd: Floats, lam: Floats) -> Array:
    blocks, f, H, h, drift = terms(at, q, v, u)
    inertia = (blocks @ vd.reshape(len(blocks), -1, 1)).ravel()
    return np.concatenate([inertia - f - lam @ H, H @ vd + _law(at, H, v, h, drift)])


def gaps(at: Point, q: Array, v: Array) -> Array:
    """Gaps and rates of all rows (2 nc,)."""
    given = at.system.p if at.p is None else at.p
    kind, nc = np.result_type(q, v, given), at.system.nc
    h, hd = np.zeros(nc, kind), np.zeros(nc, kind)
    at.system.gaps(at.t, q.astype(kind), v.astype(kind), given.astype(kind), h, hd)
    return np.concatenate([h, hd])


def saddle(at: Point) -> tuple[Floats, Floats, Floats]:
    """K, and the v' and lam that solve K (v', lam) = (f, -law).

    Raises:
        SceneError: if the active rows are redundant here, a coordinate has no inertia, or a value is not finite.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        blocks, f, H, h, drift = terms(at, at.q, at.v, at.u)
        M, na = dense(blocks), len(at.active)
        right = np.concatenate([f, -_law(at, H, at.v, h, drift)])
    if not (np.all(np.isfinite(M)) and np.all(np.isfinite(H)) and np.all(np.isfinite(right))):
        raise SceneError(f"linearise: the equations have no finite value at q = {at.q.tolist()}, v = {at.v.tolist()}.")
    if not np.linalg.matrix_rank(M, hermitian=True) == len(M):
        raise SceneError(f"linearise: a coordinate has no inertia at q = {at.q.tolist()}.")
    if na and not np.linalg.cond(H @ np.linalg.solve(M, H.T)) <= ILL_POSED:
        raise SceneError(
            f"linearise: the active rows {at.active.tolist()} are redundant at q = {at.q.tolist()}; "
            "leave out those that follow from the others."
        )
    K = np.block([[M, -H.T], [H, np.zeros((na, na))]])
    vd, lam = np.split(np.linalg.solve(K, right), [at.system.n])
    return K, vd, lam


def derivatives(at: Point) -> Derivatives:
    """All first derivatives at a point.

    Raises:
        SceneError: if the active rows are redundant there, a coordinate has no inertia, or a value is not finite.
    """
    n, nu, nc = at.system.n, at.system.inputs, at.system.nc
    K, vd, lam = saddle(at)
    columns, slopes = np.zeros((n + len(lam), 2 * n + nu)), np.zeros((2 * nc, 2 * n))
    steps = 1j * STEP * np.eye(2 * n + nu)
    N = directions(at.system, at.q)
    for k, step in enumerate(steps):
        q, v, u = at.q + N @ step[:n], at.v + step[n : 2 * n], at.u + step[2 * n :]
        columns[:, k] = residual(at, q, v, u, vd, lam).imag / STEP
        if k < 2 * n:
            slopes[:, k] = gaps(at, q, v).imag / STEP
    solved = -np.asarray(np.linalg.solve(K, columns), dtype=np.float64)
    return Derivatives(
        vd=vd, lam=lam, vd_x=solved[:n, : 2 * n], vd_u=solved[:n, 2 * n :], lam_x=solved[n:, : 2 * n],
        lam_u=solved[n:, 2 * n :], gap_x=slopes[:nc], rate_x=slopes[nc:],
        size=_sizes(K, np.abs(columns), n),
    )  # fmt: skip


def _sizes(K: Floats, columns: Floats, n: int) -> Floats:
    """Sizes (n, ...) of the terms of -K^-1 columns: what moves freely, and what the rows take back of it."""
    inverse, H = np.linalg.inv(K[:n, :n]), K[n:, :n]
    pushed = inverse @ H.T
    free = np.abs(inverse) @ columns[:n]
    taken = np.abs(pushed @ np.linalg.inv(H @ pushed)) @ (np.abs(H) @ free + columns[n:])
    sizes: Floats = free + taken
    return sizes
