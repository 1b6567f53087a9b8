"""The direction of a slip in space that has just begun, and how it turns with the state.

Friction turns a slip at a rate of mu lam_n/(m |v_t|). As |v_t| vanishes, its direction s follows
from the state: it is that of the slip's acceleration, but for the rate w at which it turns,

    F(x, s) = s_perp . v_t'(x, s) - w s . v_t = 0        s_x = -F_x/F_s

with w from the same equation without its last term, at the start, since that is small. A
direction that is held instead, up to a slip of e, is off by the time that the slip takes to reach
e, which is about its square root, and so are the derivatives of all that follows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from crossbody.reference.kinds import Array, Floats
from crossbody.reference.linear._derivatives import residual, saddle
from crossbody.reference.linear._point import STEP, Point, force_rate, terms

TURNS = 20  # of Newton's method, which starts beside its solution
SETTLED = 1e-14  # rad, a turn that is rounding
FORWARD = 1e-6  # part of what turns a slip by which one that begins may seem to decelerate


def emerges(at: Point, i: int) -> bool:
    """Whether contact i, which slides at hardly any speed in the direction that is given, does not come to a stop."""
    alone = replace(at, emerging=np.array([i], dtype=np.int64))
    found = saddle(alone)
    gains = float(_along(alone, slip_accelerations(alone, at.q, at.v, found[1]))[0])
    turns = float(_misfit_slopes(alone, found[1], accelerations_by_turns(alone, *found))[0, 0]) + gains
    return gains >= -FORWARD * abs(turns)


def emerging(at: Point, contacts: Sequence[int]) -> Point:
    """The point with contacts that emerge there, their directions, and the rates at which these turn."""
    at = replace(at, emerging=np.array(contacts, dtype=np.int64), spins=None)
    if not len(contacts):
        return at
    at, found = _settled(at)
    return replace(at, spins=_spins(at, *found))


def _spins(at: Point, K: Floats, vd: Floats, lam: Floats) -> Floats:
    q, v = at.q + 1j * STEP * at.system.rates(at.q, at.v, at.t), at.v + 1j * STEP * vd
    change = residual(at, q, v, at.u, vd, lam)[: len(K)].imag / STEP
    change[: at.system.n] -= force_rate(at)
    jerk = -np.linalg.solve(K, change)[: at.system.n]
    moved = _across(at, slip_accelerations(at, q, v, vd).imag / STEP + _tangents(at) @ jerk)
    return -np.asarray(
        np.linalg.solve(_misfit_slopes(at, vd, accelerations_by_turns(at, K, vd, lam)), moved), dtype=np.float64
    )


def settled(at: Point) -> Point:
    """The point with the directions in which what emerges there accelerates."""
    return _settled(at)[0] if len(at.emerging) else at


def _settled(at: Point) -> tuple[Point, tuple[Floats, Floats, Floats]]:
    """The same, of one at which something emerges, with what `saddle` gives there."""
    found = saddle(at)
    for _ in range(TURNS):
        vd = found[1]
        wrong = _across(at, slip_accelerations(at, at.q, at.v, vd))
        turns = -np.linalg.solve(_misfit_slopes(at, vd, accelerations_by_turns(at, *found)), wrong)
        if np.abs(turns).max() <= SETTLED:
            break
        for i, angle in zip(at.emerging.tolist(), turns.tolist(), strict=True):
            at = _turned(at, i, angle)
        found = saddle(at)
    return at, found


def with_turns(at: Point, vd: Floats, found: Floats, turn: Floats, accelerations: Floats) -> Floats:
    """Derivatives that are meant for held directions, with the directions turning as they do.

    Args:
        at: a settled point.
        vd: accelerations (n,).
        found: derivatives with held directions (n + ..., variables), those of the accelerations first.
        turn: of the same values, by the angles of what emerges (n + ..., k).
        accelerations: derivatives of `slip_accelerations` at fixed vd (2 k, variables).
    """
    if not len(at.emerging):
        return found
    n = at.system.n
    moved = _across(at, accelerations + _tangents(at) @ found[:n])
    return found - turn @ np.linalg.solve(_misfit_slopes(at, vd, turn[:n]), moved)


def by_turns(function: Callable[[Point], Array], at: Point) -> Floats:
    """Derivative of function(at) by the angles of what emerges (..., k)."""
    columns = [np.asarray(function(_turned(at, i, 1j * STEP))).imag / STEP for i in at.emerging.tolist()]
    return np.stack(columns, axis=-1) if columns else np.zeros((len(function(at)), 0))


def accelerations_by_turns(at: Point, K: Floats, vd: Floats, lam: Floats) -> Floats:
    """Derivative (n, k) of the accelerations by the angles of what emerges; K, vd and lam as `saddle` gives them."""
    columns = by_turns(lambda here: residual(here, at.q, at.v, at.u, vd, lam), at)
    return -np.asarray(np.linalg.solve(K, columns[: len(K)]), dtype=np.float64)[: at.system.n]


def slip_accelerations(at: Point, q: Array, v: Array, vd: Floats) -> Array:
    """Accelerations (2 k,) of the slips that emerge, two by two, at accelerations vd (n,); without what turns them."""
    _, _, H, _, drift = terms(at, q, v, at.u)
    places = _places(at)
    found: Array = (H @ vd + drift)[places]
    if at.spins is None:
        return found
    slip = H[places] @ v - at.given("drift")[at.active[places]]
    ways = _ways(at)
    turning = (at.spins * np.einsum("ij,ij->i", ways, slip.reshape(-1, 2)))[:, None] * ways[:, ::-1] * [-1.0, 1.0]
    return np.asarray(found - turning.ravel())


def _places(at: Point) -> Array:
    """Places in `active` (2 k,) of the tangential rows of what emerges."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *(at.tangents(i) for i in at.emerging.tolist())])


def _tangents(at: Point) -> Floats:
    """Tangential rows (2 k, n) of what emerges."""
    return terms(at, at.q, at.v, at.u)[2][_places(at)]


def _ways(at: Point) -> Floats:
    """Directions (k, 2)."""
    return np.asarray(at.given("way"))[at.active[_places(at)]].reshape(-1, 2)


def _along(at: Point, values: Floats) -> Floats:
    """Parts along the directions (k, ...) of values (2 k, ...)."""
    along = np.einsum("ij,ij...->i...", _ways(at), values.reshape(-1, 2, *values.shape[1:]))
    return np.asarray(along, dtype=np.float64)


def _across(at: Point, values: Floats) -> Floats:
    """Parts across the directions (k, ...) of values (2 k, ...)."""
    left = _ways(at)[:, ::-1] * [-1.0, 1.0]
    across = np.einsum("ij,ij...->i...", left, values.reshape(-1, 2, *values.shape[1:]))
    return np.asarray(across, dtype=np.float64)


def _misfit_slopes(at: Point, vd: Floats, turn: Floats) -> Floats:
    """Derivative (k, k) of the parts across, by the angles, from that of the accelerations (n, k)."""
    gains = _along(at, slip_accelerations(at, at.q, at.v, vd))
    return _across(at, _tangents(at) @ turn) - np.diag(gains)


def _turned(at: Point, i: int, angle: complex) -> Point:
    """The point with the direction of contact i turned, rad."""
    rows = at.active[at.tangents(i)]
    way = np.array(at.given("way"), dtype=np.result_type(at.given("way"), type(angle)))
    a, b = way[rows]
    way[rows] = [np.cos(angle) * a - np.sin(angle) * b, np.sin(angle) * a + np.cos(angle) * b]
    return replace(at, way=way)
