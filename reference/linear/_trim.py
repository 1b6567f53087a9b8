"""Equilibria with unknown positions, rates, inputs and multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crossbody.cases import Outcome
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference._indices import different
from crossbody.reference._system import System
from crossbody.reference.kinds import Array, Floats, Index
from crossbody.reference.linear._point import STEP, Point, directions, terms
from crossbody.reference.linear._rubbing import borne, check_slips
from crossbody.reference.linear.linearisation import point

STEPS = 50
SETTLED = 1e-13  # part of the terms of an equation that may be left
HALVINGS = 20
RANK = 1e-9  # part of the largest singular value below which rows push in no way of their own


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trim:
    """A steady motion v' = 0.

    Attributes:
        q (nq,), v (n,), u (nu,): state and inputs.
        lam (na,): multipliers of the active rows, N.
        active (na,): these rows.
        residual: largest part of an equation's terms that is left.
        outcome: FINISHED; STEP_LIMIT without an equilibrium nearby; ILL_POSED or NOT_FINITE on the way.
        pulling: active rows that would pull though they may not: the equilibrium exists for the
            equations alone.
        shared: active rows whose multipliers the equations leave open, since others could bear their load;
            those of least norm stand there.
    """

    q: Floats
    v: Floats
    u: Floats
    lam: Floats
    active: Index
    residual: float
    outcome: Outcome
    pulling: tuple[int, ...]
    shared: tuple[int, ...] = ()


@checked_arguments
def trim(
    system: System, q: ArrayLike, v: ArrayLike | None = None, u: ArrayLike | None = None,
    active: Sequence[int] | None = None, *, sliding: Sequence[int] = (), free: Sequence[int] | None = None,
    rates: Sequence[int] = (), inputs: Sequence[int] = (), t: float = 0.0,
) -> Trim:  # fmt: skip
    """Solve f(q, v, u) + H_A^T lam = 0 with h_A = 0 and H_A v = 0 by the damped method of Gauss and Newton.

    Steps are the smallest that satisfy the linearised equations, so what they leave open stays as given.
    A row without stiffness (a0 = a2 = 0, a slip row) has no h of its own. Contacts that slide push by mu
    lam_n against their velocity; whether those that stick can bear what they must, `linearise` says.

    Args:
        system: the mechanism.
        q: positions (nq,), a guess for those that are free.
        v: velocities (n,), zero if not given.
        u: inputs (nu,), zero if not given.
        active: rows that are on; those that are always on, if not given.
        sliding: which of these slide, as in `linearise`.
        free: coordinates that may move, of the tangent space where q' is not v; all of them if not given.
        rates: velocities that may change: of cyclic coordinates, which nothing depends on.
        inputs: inputs that may change.
        t: time, s.

    Raises:
        SceneError: for arrays of another shape, rows that do not exist, or a contact that slides at no speed.
    """
    at = point(system, q, v, u, active, t, sliding=sliding)
    n, nu, na = system.n, system.inputs, len(at.solved)
    places = different("trim.free", range(n) if free is None else free, n)
    moved = [places, n + different("trim.rates", rates, n), 2 * n + different("trim.inputs", inputs, nu)]
    unknown = np.concatenate([*moved, np.arange(2 * n + nu, 2 * n + nu + na)])
    x = np.concatenate([at.q if system.velocity is None else np.zeros(n), at.v, at.u, np.zeros(na)])
    x[2 * n + nu :] = _multipliers(at, x)
    at, outcome, left, force = _solved(at, x, unknown)
    lam = borne(at, terms(at, at.q, x[n : 2 * n], at.u)[2], x[n : 2 * n], x[2 * n + nu :])
    shared = _shared(at, x) if outcome.ok and not at.slid else np.zeros(len(lam), dtype=bool)
    if shared.any():
        lam = _least(at, x)
    pulls = (
        (lam < -1e3 * SETTLED * force)
        & np.asarray(system.unilateral, dtype=bool)[at.active]
        & (np.asarray(system.a0)[at.active] > 0)
    )
    return Trim(
        q=_placed(at, x[:n]), v=x[n : 2 * n], u=x[2 * n : 2 * n + nu], lam=lam, active=at.active,
        residual=left, outcome=outcome, pulling=tuple(at.active[pulls].tolist()),
        shared=tuple(at.active[shared].tolist()),
    )  # fmt: skip


def _placed(at: Point, d: Array) -> Array:
    """Positions (nq,) of the unknowns d (n,): q themselves, or a chart of the tangent space about the guess."""
    system = at.system
    if system.velocity is None:
        return d
    q: Array = at.q + directions(system, at.q) @ d
    for entries in system.quaternion_entries:
        q[entries] /= np.sqrt(np.sum(q[entries] ** 2))  # of a complex step too
    return q


def _sizes(at: Point, x: Floats) -> Floats:
    """How large the unknowns are: those on a tangent space by the positions that they turn and shift."""
    sizes = np.abs(x)
    if at.system.velocity is not None:
        sizes[: at.system.n] += np.abs(directions(at.system, at.q)).T @ np.abs(at.q)
    return sizes


def _balance(at: Point, x: Array) -> tuple[Array, Floats]:
    """The equations that must vanish, and the size of their terms."""
    n, nu = at.system.n, at.system.inputs
    d, v, u, lam = np.split(x, [n, 2 * n, 2 * n + nu])
    q = _placed(at, d)
    _, f, H, h, _ = terms(at, q, v, u)
    every, rates = borne(at, H, v, lam), (H @ v - at.given("drift")[at.active])[at.solved]
    a0, _, a2 = at.system.alpha[at.active[at.solved]].T
    stiff = (a0 > 0.0) | (a2 > 0.0)
    forces = np.abs(f) + np.abs(every) @ np.abs(H)
    sizes = [np.full(n, forces.max(initial=0.0) or 1.0), np.full(int(stiff.sum()), np.abs(q).max(initial=1e-6))]
    sizes.append(np.full(len(lam), np.abs(v).max(initial=1e-6)))
    return np.concatenate([f + every @ H, h[at.solved][stiff], rates]), np.concatenate(sizes).real


def _multipliers(at: Point, x: Floats) -> Floats:
    """The multipliers that balance the forces best."""
    n = at.system.n
    d, v, u = np.split(x[: 2 * n + at.system.inputs], [n, 2 * n])
    _, f, H, _, _ = terms(at, _placed(at, d), v, u)
    if not (np.isfinite(f).all() and np.isfinite(H).all()):
        return np.zeros(len(at.solved))
    check_slips(replace(at, v=v), H)
    rubbed = borne(at, H, v, np.zeros(len(at.solved)))
    pushed = H.T @ (borne(at, H, v, np.eye(len(at.solved))) - rubbed[:, None])
    return np.asarray(np.linalg.lstsq(pushed, -f - rubbed @ H, rcond=None)[0], dtype=np.float64)


def _shared(at: Point, x: Floats) -> NDArray[np.bool_]:
    """Which multipliers (na,) of active rows, none of which slides, could be others that push in the same way."""
    H = _forces(at, x)[1]
    _, sizes, ways = np.linalg.svd(H.T)
    idle = ways[int(np.sum(sizes > RANK * sizes.max(initial=0.0))) :]
    return np.asarray(np.linalg.norm(idle, axis=0) > RANK)


def _least(at: Point, x: Floats) -> Floats:
    """The multipliers (na,) of least norm that balance the forces."""
    f, H = _forces(at, x)
    return np.asarray(np.linalg.lstsq(H.T, -f, rcond=RANK)[0], dtype=np.float64)


def _forces(at: Point, x: Floats) -> tuple[Floats, Floats]:
    """Forces (n,) but those of rows, and how all active rows push (na, n)."""
    n = at.system.n
    _, f, H, _, _ = terms(at, _placed(at, x[:n]), x[n : 2 * n], x[2 * n : 2 * n + at.system.inputs])
    return f, H


def _recentred(at: Point, x: Floats) -> Point:
    """The point with its chart about where x has come to, x in place; itself where positions are the unknowns."""
    if at.system.velocity is None:
        return at
    moved = replace(at, q=_placed(at, x[: at.system.n]))
    x[: at.system.n] = 0.0
    return moved


def _solved(at: Point, x: Floats, unknown: Index) -> tuple[Point, Outcome, float, float]:
    """Improve x in place; the point of its chart, how it ended, what is left, and the size of the forces."""
    value, size = _balance(at, x)
    if not np.isfinite(value).all():
        return at, Outcome.NOT_FINITE, np.inf, np.inf
    J = _jacobian(at, x, unknown)
    # Forces that vanish in equilibrium leave no scale of their own: what they are made of does.
    size[: at.system.n] = max(size[0], (np.abs(J[: at.system.n]) @ _sizes(at, x)[unknown]).max(initial=0.0))
    least, left = size, float(np.abs(value / size).max(initial=0.0))
    for _ in range(STEPS):
        if left <= SETTLED:
            return at, Outcome.FINISHED, left, size[0]
        if not np.isfinite(J).all():
            return at, Outcome.ILL_POSED, left, size[0]
        step: Floats = np.linalg.lstsq(J / size[:, None], -value / size, rcond=1e-12)[0].astype(np.float64)
        better = _searched(at, x, unknown, step, left, least)
        if better is None:
            break
        value, size, left = better
        at = _recentred(at, x)
        J = _jacobian(at, x, unknown)
    return at, (Outcome.FINISHED if left <= 1e3 * SETTLED else Outcome.STEP_LIMIT), left, size[0]


def _jacobian(at: Point, x: Floats, unknown: Index) -> Floats:
    """Derivative of the balance by the unknowns."""
    columns = []
    for i in unknown:
        moved = x.astype(complex)
        moved[i] += 1j * STEP
        columns.append(_balance(at, moved)[0].imag / STEP)
    return np.stack(columns, axis=-1) if columns else np.zeros((len(_balance(at, x)[0]), 0))


def _searched(
    at: Point, x: Floats, unknown: Index, step: Floats, left: float, least: Floats
) -> tuple[Floats, Floats, float] | None:  # fmt: skip
    """Go along a step as far as it improves, x in place; None if it does not."""
    before = x[unknown].copy()
    for halving in range(HALVINGS):
        x[unknown] = before + 0.5**halving * step
        with np.errstate(over="ignore", invalid="ignore"):
            value, size = _balance(at, x)
        size = np.maximum(size, least)
        now = float(np.abs(value / size).max(initial=0.0)) if np.isfinite(value).all() else np.inf
        if now < left:
            return value.real, size, now
    x[unknown] = before
    return None
