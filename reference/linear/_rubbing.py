"""Friction in linear models: what contacts that slide bear, which rows share a load, and what has no derivative."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crossbody.cases import SceneError
from crossbody.reference.kinds import Array, Floats, Index
from crossbody.reference.linear._point import Point, dense, terms

DEPENDENT = 1e-5  # part of a row, of size 1, that does not follow from others, below which it does
STILL = 1e-9  # part of the largest row below which a row has nothing that it moves
CLEAR = 1e-9  # part of its bound by which the force of a contact that sticks must stay below it
HELD = 1e-8  # part of its terms by which the law of a row may be off that others hold
JAMMED = 1e-9  # determinant, of rows of size 1, that counts as none


class NoDirectionError(SceneError):
    """A contact slides at no speed, so that its friction has no direction."""


def borne(at: Point, H: Array, v: Array, lam: Array) -> Array:
    """Multipliers of all active rows (na, ...) from those of the rows that are solved for."""
    if len(at.solved) == len(at.active):
        return lam
    kinds = (H, v, lam, at.given("friction"), *(() if at.way is None else (at.way,)))
    found = np.zeros((len(at.active), *lam.shape[1:]), np.result_type(*kinds))
    found[at.solved] = lam
    for i, normal, places in at.slid:
        bound = at.given("friction")[i] * (1.0 if normal < 0 else found[normal])
        for row, s in zip(places.tolist(), _direction(at, H, v, places), strict=True):
            found[row] = -bound * s
    return found


def given_way(at: Point, rows: Index) -> Array | None:
    """The direction in which these tangential rows slide, if it is given."""
    if at.way is None or np.isnan(at.way[rows]).any():
        return None
    return at.way[rows]


def _direction(at: Point, H: Array, v: Array, places: Index) -> Array:
    """Direction (1,) or (2,) in which the contact slides whose tangential rows stand there."""
    rows = at.active[places]
    way = given_way(at, rows)
    if way is not None:
        return way
    slip = H[places] @ v - at.given("drift")[rows]
    direction: Array = slip / np.sqrt(slip @ slip)  # of a complex step too
    return direction


def loads(at: Point, q: Array, v: Array, u: Array, lam: Floats) -> Array:
    """Multipliers of all active rows (na,) where those that are solved for are lam; none where that is all of them."""
    if len(at.solved) == len(at.active):
        return np.zeros(len(at.active), np.result_type(q, v, u))
    return borne(at, terms(at, q, v, u)[2], v, lam)


def independent(at: Point) -> Point:
    """The point with the active rows idle that follow from those before them, normal rows before tangential ones.

    Of contacts that stick, only the shares of the load are open then; what moves is not.

    Raises:
        SceneError: if contacts that slide are among those that share: their friction, and so the
            motion, is open.
    """
    system = at.system
    blocks, _, H, _, _ = terms(at, at.q, at.v, at.u)
    follows = np.asarray(system.follows)[at.active]
    last = [f >= 0 and system.tangents[f] > 0 for f in follows.tolist()]
    kept, idle, sharing = list[int](), list[int](), set[int]()
    root = np.linalg.cholesky(dense(blocks))
    rows = np.linalg.solve(root, H.T).T  # rows of size 1 in the metric of M^-1
    size = np.linalg.norm(rows, axis=1)
    dead = size <= STILL * size.max(initial=0.0)
    rows = rows / np.where(dead, 1.0, size)[:, None]
    for place in [*np.flatnonzero(~np.array(last, dtype=bool)), *np.flatnonzero(last)]:
        if place not in at.solved:
            continue
        if dead[place]:
            idle.append(int(at.active[place]))
            continue
        part = np.linalg.lstsq(rows[kept].T, rows[place], rcond=None)[0] if kept else np.zeros(0)
        if np.linalg.norm(rows[place] - part @ rows[kept]) > DEPENDENT:
            kept.append(place)
            continue
        idle.append(int(at.active[place]))
        among = [int(at.active[k]) for k, c in zip([*kept, place], [*part, 1.0], strict=True) if abs(c) > STILL]
        sharing.update(among)
        if set(among) & set(at.sliding.tolist()):
            raise SceneError(
                f"linearise: rows {among} share a load at q = {at.q.tolist()} while some of them slide, "
                "and the law does not say how (indeterminate): friction, and the motion, depend on it."
            )
    return replace(at, idle=np.array(idle, dtype=np.int64), sharing=np.array(sorted(sharing), dtype=np.int64))


def check_idle(at: Point, off: Floats, *terms: Floats) -> None:
    """Refuse idle rows that are off their laws by more than rounding of the terms of all active rows.

    A row that nothing moves has no terms of its own, and is zero but for rounding of others.
    """
    size = max(float(np.abs(each).max(initial=0.0)) for each in terms)
    if not np.abs(off).max(initial=0.0) <= HELD * size:
        raise SceneError(
            f"linearise: rows {at.idle.tolist()} follow from the other active ones at q = {at.q.tolist()}, "
            "but their laws do not: no motion satisfies all of them; leave some contacts out."
        )


def check_slips(at: Point, H: Floats) -> None:
    """Refuse a contact that slides at no speed in a direction that is not given."""
    for i, _, places in at.slid:
        rows = at.active[places]
        if given_way(at, rows) is not None:
            continue
        drift = at.given("drift")[rows]
        slip, size = H[places] @ at.v - drift, np.abs(H[places]) @ np.abs(at.v) + np.abs(drift)
        if not np.linalg.norm(slip) > at.slow * size.max():
            raise NoDirectionError(
                f"linearise: row {i} slides at no speed at q = {at.q.tolist()}, so that its friction has "
                "no direction; valid: a state in which it slides, or the contact among those that stick."
            )


def check_jam(at: Point, A: Floats, G: Floats) -> None:
    """Refuse sliding contacts whose forces drive them into each other: A must have a positive determinant.

    Rows that are always on are eliminated: how near to each other they are says nothing of contacts.
    """
    on = np.asarray(at.system.held)[at.active[at.solved]]
    if on.any() and not on.all():
        A, G = (B[~on][:, ~on] - B[~on][:, on] @ np.linalg.solve(B[on][:, on], B[on][:, ~on]) for B in (A, G))
    size = np.sqrt(np.diag(G))
    if len(at.sliding) and not np.linalg.det(A / np.outer(size, size)) > JAMMED:
        raise SceneError(
            f"linearise: the sliding contacts {at.sliding.tolist()} jam at q = {at.q.tolist()} (Painleve): "
            "friction presses them at least as much as it lets go, and the law determines no acceleration."
        )


def check_cones(at: Point, lam: Floats) -> None:
    """Refuse a contact that sticks and bears all that it can, or more; what shares a load is not judged."""
    for i in np.flatnonzero(np.asarray(at.system.tangents)).tolist():
        places = at.tangents(i)
        if i in at.sliding or not len(places) or np.isin([i, *at.active[places]], at.sharing).any():
            continue
        bound = at.system.friction[i] * (1.0 if at.system.dry[i] else lam[at.active.tolist().index(i)])
        if not np.linalg.norm(lam[places]) < (1.0 - CLEAR) * bound:
            raise SceneError(
                f"linearise: row {i} sticks with a force of {np.linalg.norm(lam[places]):.9g} that "
                f"friction bounds by {bound:.9g} at q = {at.q.tolist()}: nearby it slides, so that no "
                "one model holds; valid: a state below the bound, or the contact among those that slide."
            )
