"""Which of the rows in contact carry a load where some depend on each other, and which it lifts off.

With G = H M^-1 H^T of all rows in contact and r what their laws ask for, the multipliers solve

    lam >= 0,    a = G lam - r >= 0,    lam . a = 0

a being by how much faster than its law each gap opens. The motion is unique, the multipliers are not. A smallest set
that carries is found by the active-set method of Lawson and Hanson (Solving Least Squares Problems, 1974, ch. 23), with
an exchange where a row depends on those that carry. Rows with a > 0 let go. The others share the load by least norm,
but for those that would pull: they stay in contact and idle, held by the rest.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import (
    GENERAL,
    accelerate,
    activate,
    assemble,
    free,
    is_active,
    pushed,
    weigh,
)
from crossbody.reference.core.algebra import DEPENDENT, RANK, ROUNDING
from crossbody.reference.core.journal import move
from crossbody.reference.core.layout import ILL_POSED, Buffers, Model, Work
from crossbody.reference.core.machine import noise, released_mode
from crossbody.reference.core.shares import allow, solve_dependent

MOVED = np.int64(1)  # rows have let go
SAME = 1.0 + 1e-12  # rows that arrive at zero together
NEARLY = 1e-9  # part of a row's diagonal below which it depends on those that carry, as far as rounding tells
DOUBT = 1e-4  # part of a row's diagonal below which a pivot may have lost what tells it from none
CHANGES = 64  # times the number of rows: changes of the set that carries; more never end


@compiled
def _evaluate(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> bool:
    """Evaluate all rows in contact: w.gram, w.r, w.allowed; False if in this order they are ill posed."""
    q, v = w.y[: s.nq], w.y[s.nq :]
    activate(s, m, w, b.mode)
    if free(K.dynamics, s, m, w, s.t, q, v) != 0:
        return False
    code = assemble(K.rows, s, m, w, 1.0, s.t, q, v)
    allow(s, w, q, v)
    for j in range(s.na):
        for c in range(j + 1):
            total = 0.0
            for a in range(s.n):
                total += w.H[j, a] * w.X[c, a]
            w.gram[j, c] = total
            w.gram[c, j] = total
    return bool(code == 0)


@compiled
def doubtful(s: Any, w: Work) -> bool:
    """Whether active rows, just evaluated, depend on others, or have pivots too small to tell in this order."""
    for j in range(s.na):
        total = 0.0
        for a in range(s.n):
            total += w.H[j, a] * w.X[j, a]
        if not w.G[j, j] ** 2 > DOUBT * total:
            return True
    return bool(s.dependent > 0)


@compiled
def _order_by_pivots(s: Any, w: Work) -> int:
    """List the rows in contact by pivots of w.gram, those that are always on first; return their rank."""
    L, rank = w.part, 0
    w.holds[:] = 0
    for j in range(s.na):
        w.trial[j] = w.gram[j, j]
    for place in range(s.na):
        best, most = -1, 0.0
        for j in range(s.na):
            i = w.idx[j]
            size = w.trial[j] / w.gram[j, j] if w.shares[i] else 2.0
            if not w.holds[i] and (best < 0 or size > most):
                best, most = j, size
        i = w.idx[best]
        w.holds[i] = 1
        w.order[place] = i
        if most > DEPENDENT:
            rank += 1
            root = np.sqrt(w.trial[best])
            for j in range(s.na):
                total = w.gram[j, best]
                for c in range(place):
                    total -= L[j, c] * L[best, c]
                L[j, place] = total / root
                w.trial[j] -= L[j, place] ** 2
    place = s.na
    for i in range(s.nc):
        if not w.holds[i]:
            w.order[place] = i
            place += 1
    return rank


@compiled
def _look(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Evaluate all rows in contact, the most independent ones first; their rank, -1 if ill posed."""
    w.idle_rows[:] = 0
    _evaluate(K, s, m, w, b)
    rank = _order_by_pivots(s, w)
    return rank if _evaluate(K, s, m, w, b) else -1


@compiled
def _factor(s: Any, w: Work) -> bool:
    """Cholesky factor of w.gram of the rows that carry, in w.part; False if they depend on each other."""
    L = w.part
    for i in range(s.na):
        for j in range(i + 1 if w.carries[i] else 0):
            if not w.carries[j]:
                continue
            total = w.gram[i, j]
            for c in range(j):
                total -= L[i, c] * L[j, c] if w.carries[c] else 0.0
            if i == j and not total > RANK * w.gram[i, i]:
                return False
            L[i, j] = np.sqrt(total) if i == j else total / L[j, j]
    return True


@compiled
def _solve(s: Any, w: Work, x: Any) -> None:
    """X := w.gram^-1 x of the rows that carry, in place, from the factor in w.part."""
    L = w.part
    for i in range(s.na):
        if w.carries[i]:
            for c in range(i):
                x[i] -= L[i, c] * x[c] if w.carries[c] else 0.0
            x[i] /= L[i, i]
    for i in range(s.na - 1, -1, -1):
        if w.carries[i]:
            x[i] /= L[i, i]
            for c in range(i):
                x[c] -= L[i, c] * x[i] if w.carries[c] else 0.0


@compiled
def _go(s: Any, w: Work, part: float) -> None:
    """Move w.share towards w.trial; rows that arrive at zero carry no longer."""
    for j in range(s.na):
        if w.carries[j]:
            falls = w.shares[w.idx[j]] and w.trial[j] < 0.0 and w.share[j] <= SAME * part * (w.share[j] - w.trial[j])
            w.share[j] = 0.0 if falls else w.share[j] + part * (w.trial[j] - w.share[j])
            w.carries[j] = not falls


@compiled
def _settle_shares(s: Any, w: Work) -> bool:
    """Let the rows that carry keep their laws, less those that would have to pull; False if they are dependent."""
    while True:
        if not _factor(s, w):
            return False
        part = 1.0
        for j in range(s.na):
            w.trial[j] = w.r[j]
        _solve(s, w, w.trial)
        for j in range(s.na):
            if w.carries[j] and w.shares[w.idx[j]] and w.trial[j] < 0.0:
                part = min(part, w.share[j] / (w.share[j] - w.trial[j]))
        _go(s, w, part)
        if part == 1.0:
            return True


@compiled
def _excess(s: Any, w: Work, j: int) -> float:
    """A of the row in place j: by how much faster than its law its gap opens."""
    total = -w.r[j]
    for c in range(s.na):
        total += w.gram[j, c] * w.share[c]
    return float(total)


@compiled
def _allowed(m: Model, w: Work, j: int) -> float:
    """By how much the row in place j may be off its law under the shares that were weighed."""
    return float(w.allowed[j] + ROUNDING * pushed(m, w, j))


@compiled
def _most_pressed(s: Any, m: Model, w: Work) -> int:
    """Place of the row that is furthest below its law, -1 for none; of those that were let go just now at last."""
    weigh(s, m, w, w.share)
    for late in range(2):
        found, most = -1, 0.0
        for j in range(s.na):
            if not w.carries[j] and w.spent[w.idx[j]] <= late:
                excess = _excess(s, w, j)
                size = excess / np.sqrt(w.gram[j, j])
                if excess < -_allowed(m, w, j) and size < most:
                    found, most = j, size
        if found >= 0:
            return found
    return -1


@compiled
def _exchange(s: Any, w: Work, j: int) -> bool:
    """Let row j carry; one that depends on those that do takes the place of one. False if none can give way."""
    left = w.gram[j, j]
    for c in range(s.na):
        w.trial[c] = w.gram[c, j]
    _solve(s, w, w.trial)
    for c in range(s.na):
        left -= w.gram[j, c] * w.trial[c] if w.carries[c] else 0.0
    if left <= NEARLY * w.gram[j, j]:
        least, out = np.inf, -1
        for c in range(s.na):
            gives_way = w.carries[c] and w.shares[w.idx[c]] and w.trial[c] > DEPENDENT
            if gives_way and w.share[c] < least * w.trial[c]:
                least, out = w.share[c] / w.trial[c], c
        if out < 0:
            return False
        for c in range(s.na):
            w.share[c] -= least * w.trial[c] if w.carries[c] else 0.0
        w.share[j], w.share[out], w.carries[out] = least, 0.0, 0
    w.carries[j] = 1
    return True


@compiled
def _carry(s: Any, m: Model, w: Work) -> bool:
    """Find a smallest set that carries: w.carries by place, w.share; False if the rows contradict each other."""
    w.carries[:] = 0
    for j in range(s.na):
        w.carries[j], w.share[j] = not w.shares[w.idx[j]], 0.0
    for _ in range(CHANGES * (s.na + 1)):
        if not _settle_shares(s, w):
            return False
        j = _most_pressed(s, m, w)
        if j < 0:
            return True
        if not _exchange(s, w, j):
            return False
    return False


@compiled
def _let_go(s: Any, w: Work, b: Buffers, i: int) -> None:
    """Release row i."""
    w.let_go[i] = s.t
    move(s, b, i, released_mode(b.mode[i], w.gap[i]))
    b.history[len(b.history) - 1, i] = 1


@compiled
def _lift(s: Any, m: Model, w: Work, b: Buffers) -> bool:
    """Release the rows whose gaps open faster than their law; whether there were any."""
    lifted = False
    w.holds[:] = 0
    weigh(s, m, w, w.share)
    for j in range(s.na):
        w.holds[w.idx[j]] = w.carries[j]
        if not w.carries[j] and _excess(s, w, j) > _allowed(m, w, j):
            _let_go(s, w, b, w.idx[j])
            lifted = True
    return lifted


@compiled
def _rank(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Rank of the rows in contact that are not idle, evaluated with their multipliers; -1 if ill posed."""
    activate(s, m, w, b.mode)
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[: s.nq], w.y[s.nq :], GENERAL) != 0:
        return -1
    return int(s.na - s.dependent)


@compiled
def _rest_the_spent(K: Any, s: Any, m: Model, w: Work, b: Buffers, rank: int) -> bool:
    """Let rows whose multipliers vanished idle; whether one that none can replace was released instead."""
    moved = False
    for i in range(s.nc):
        if w.spent[i] and is_active(b.mode[i]):
            w.idle_rows[i] = 1
            if _rank(K, s, m, w, b) < rank:
                w.idle_rows[i] = 0
                _let_go(s, w, b, i)
                moved = True
    return moved


@compiled
def _most_pulling(s: Any, w: Work) -> int:
    """The row that pulls most beyond its noise; -1 if none does."""
    found, least = -1, 0.0
    for j in range(s.na):
        i = w.idx[j]
        if w.shares[i] and w.la[j] < min(least, -w.noise[i]):
            found, least = i, w.la[j]
    return found


@compiled
def _all_push(s: Any, m: Model, w: Work) -> bool:
    """Whether the multipliers of least norm push, so that no row has to let go.

    Where rows hardly depend on each other a smallest set would load a third row otherwise, and the two would disagree
    on whether it pushes.
    """
    if not solve_dependent(s, w, w.y[: s.nq], w.y[s.nq :]) or s.contradiction > 1.0:
        return False
    noise(s, m, w)
    return bool(_most_pulling(s, w) < 0)


@compiled
def _fewest(K: Any, s: Any, m: Model, w: Work, b: Buffers, rank: int) -> None:
    """Let all rows idle but the smallest set that carries, and what it lacks to hold the others."""
    for i in range(s.nc):
        w.idle_rows[i] = w.shares[i] and is_active(b.mode[i]) and not w.holds[i]
    known = _rank(K, s, m, w, b)
    for i in range(s.nc):
        if known < rank and w.idle_rows[i]:
            w.idle_rows[i] = 0
            found = _rank(K, s, m, w, b)
            w.idle_rows[i] = found <= known
            known = max(found, known)


@compiled
def _share(K: Any, s: Any, m: Model, w: Work, b: Buffers, rank: int) -> int:
    """Let rows that would pull idle as long as the others hold them."""
    for _ in range(s.nc + 1):
        if _rank(K, s, m, w, b) < 0:
            return ILL_POSED
        noise(s, m, w)
        i = _most_pulling(s, w)
        if i < 0:
            return 0
        w.idle_rows[i] = 1
        if _rank(K, s, m, w, b) < rank:
            if not w.holds[i]:  # it lifts off: nothing holds it, and nothing presses it
                w.idle_rows[i] = 0
                _let_go(s, w, b, i)
                return int(MOVED)
            break
    _fewest(K, s, m, w, b, rank)
    return 0


@compiled
def hold(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Decide which rows in contact let go and which idle, at the present instant.

    Returns:
        0 if the rows in contact hold each other, MOVED if some have let go, or ILL_POSED. The workspace holds no
        evaluation of them.
    """
    rank, spent = _look(K, s, m, w, b), 0
    for i in range(s.nc):
        spent += w.spent[i]
    if rank == s.na and spent == 0:
        return 0
    if rank >= 0 and spent == 0:
        if _all_push(s, m, w):
            s.redundant = max(s.redundant, s.na - rank)
            return 0
        rank = _look(K, s, m, w, b)
    if rank < 0 or not _carry(s, m, w):
        return ILL_POSED
    moved = _lift(s, m, w, b)
    if not moved:
        moved = _rest_the_spent(K, s, m, w, b, rank)
    w.spent[:] = 0
    if moved:
        return int(MOVED)
    s.redundant = max(s.redundant, s.na + s.idle - rank)
    return int(_share(K, s, m, w, b, rank))
