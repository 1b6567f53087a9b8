"""Frozen collisions: the fast time scale of a contact as one instant (docs/explanation/model.md).

While a row with fast constants collides, q, M and H stand still, so its law has the exact solution

    v+ = v + M^-1 H_A^T P,    G_A P = -(1 + e) h'  on the struck rows,  0 on the held ones,    G = H M^-1 H^T

with the restitution e of the fast constants. A struck row is captured (e = 0) where the forces of the slow scale press
it down faster than it would come back, and a held row that would have to pull is let go.

    sequential     one row at a time, the most approaching first
    simultaneous   all touching rows at once
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import GENERAL, accelerate, activate, add_row, assemble, is_active, push_rows
from crossbody.reference.core.algebra import solve_schur
from crossbody.reference.core.journal import full, move, write_event
from crossbody.reference.core.layout import (
    BALLISTIC,
    COLLISION,
    CONTACT,
    EVENTS_FULL,
    FREE,
    ILL_POSED,
    MODE_CYCLE,
    SEQUENTIAL,
    Buffers,
    Model,
    Work,
)
from crossbody.reference.core.machine import DEEP, slow

TIE = 1e-12  # rates closer than this are the same: the first row is struck first
PULL = 1e-12  # part of the struck row's impulse below which a held row's is rounding
STILL = 1e-13  # part of the largest rate seen: a rate below it is 0 but for rounding
CEILING = 64  # collisions at one instant, times the square of the number of rows: more never end
NOT, BOUNCES, STAYS = np.arange(3)  # how a row takes part: not, struck, or touching at rest


@compiled
def restitution(b0: float, b1: float) -> float:
    """Speed after over speed before of one linear contact: exp(-2 zeta Theta(zeta)) (docs/explanation/model.md)."""
    zeta = 0.5 * b1 / np.sqrt(b0)
    if abs(zeta - 1.0) < 1e-6:
        theta = 1.0 + (1.0 - zeta) / 3.0
    elif zeta < 1.0:
        theta = np.arccos(zeta) / np.sqrt(1.0 - zeta * zeta)
    else:
        theta = np.arccosh(zeta) / np.sqrt(zeta * zeta - 1.0)
    return float(np.exp(-2.0 * zeta * theta))


@compiled
def _touches(s: Any, m: Model, w: Work, b: Buffers, i: int) -> bool:
    return bool(m.beta[i, 0] > 0.0 and w.gap[i] <= s.touch and not is_active(b.mode[i]))


@compiled
def _choose(s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Mark the rows that take part in the next collision; the most approaching one, -1 if none approaches."""
    struck, rate = w.struck, w.rate
    first, faster = -1, 0.0
    for i in range(s.nc):
        struck[i] = NOT
        if rate[i] < min(faster, -slow(s, w, i)) and _touches(s, m, w, b, i):
            first, faster = i, rate[i] - TIE
    if first < 0:
        return first
    w.struck[first] = BOUNCES
    if s.rule != SEQUENTIAL:
        for i in range(s.nc):
            if w.rate[i] <= slow(s, w, i) and _touches(s, m, w, b, i):
                w.struck[i] = BOUNCES if w.rate[i] < -slow(s, w, i) else STAYS
    return first


@compiled
def _list_rows(s: Any, m: Model, w: Work, b: Buffers) -> None:
    """The rows of the map: the held ones and those that take part."""
    na = 0
    for i in range(s.nc):
        if is_active(b.mode[i]) or w.struck[i] != NOT:
            add_row(m, w, na, i)
            na += 1
    s.na = na


@compiled
def _bounce(s: Any, m: Model, w: Work, j: int) -> float:
    """Restitution of the struck row in place j: 0 where it is captured, v < v* = press / (w e^(3/2))."""
    i = w.idx[j]
    fall = w.Hdv[j]  # the row's acceleration without its own multiplier
    for c in range(m.span[i, 0], m.span[i, 1]):
        fall += w.H[j, c] * w.vd[c]
    e = restitution(m.beta[i, 0], m.beta[i, 1])
    return 0.0 if -w.hda[j] * np.sqrt(m.beta[i, 0]) * e * np.sqrt(e) < -fall else e


@compiled
def _impulses(K: Any, s: Any, m: Model, w: Work) -> int:
    """Solve the map for la, the impulses; leaves in ha the restitution of every row, -1 where it is not struck."""
    nq = s.nq
    if assemble(K.rows, s, m, w, 1.0, s.t, w.y[:nq], w.y[nq:]) != 0:
        return 1
    for j in range(s.na):
        w.r[j], w.ha[j] = 0.0, -1.0
        if w.struck[w.idx[j]] == BOUNCES:
            w.ha[j] = _bounce(s, m, w, j)
            w.r[j] = -(1.0 + w.ha[j]) * w.hda[j]
    solve_schur(w.G, s.na, w.reach, w.r, w.la)
    return 0


@compiled
def _pulling(s: Any, m: Model, w: Work) -> int:
    """Place of the row that pulls most; -1 if all push. Rows that are always on, and those that follow, may pull."""
    worst, least, largest = -1, 0.0, 0.0
    for j in range(s.na):
        largest = max(largest, w.la[j])
    for j in range(s.na):
        i = w.idx[j]
        if m.unilateral[i] and m.follows[i] < 0 and w.la[j] < min(least, -PULL * largest):
            worst, least = j, w.la[j]
    return worst


@compiled
def _parted(w: Work, i: int) -> int:
    """The mode of a row that has let go."""
    return BALLISTIC if w.gap[i] < -DEEP else FREE


@compiled
def _let_go(s: Any, m: Model, w: Work, b: Buffers, i: int) -> None:
    """Take row i, and what follows it, out of the map."""
    if w.struck[i] != NOT:
        if w.struck[i] == BOUNCES:
            write_event(s, b, i, COLLISION, b.mode[i], 0.0)
        w.struck[i] = NOT
        return
    move(s, b, i, _parted(w, i))
    for c in range(s.nc):
        if m.follows[c] == i:
            b.mode[c] = b.mode[i]


@compiled
def _apply(s: Any, m: Model, w: Work, b: Buffers) -> None:
    """The jump of v, its work in the ledger, and the end of the struck rows' collisions."""
    v = w.y[s.nq :]
    push_rows(m, w, s.na, w.la, 1.0, v)
    for j in range(s.na):
        i = w.idx[j]
        if s.ledger:
            after = 0.0
            for c in range(m.span[i, 0], m.span[i, 1]):
                after += w.H[j, c] * v[c]
            w.z[i] += 0.5 * w.la[j] * (w.hda[j] + after)
        if w.struck[i] == BOUNCES:
            after_mode = CONTACT if w.ha[j] == 0.0 else _parted(w, i)
            write_event(s, b, i, COLLISION, after_mode, w.la[j])
            b.mode[i] = after_mode


@compiled
def _factor(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """M^-1 of the present state, and the free acceleration in vd, as the map asks for them; 1 if ill posed."""
    activate(s, m, w, b.mode)
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[: s.nq], w.y[s.nq :], GENERAL) != 0:
        return 1
    if s.n == 1:
        w.L[0, 0] = 1.0 / w.M[0, 0]
    return 0


@compiled
def _one(K: Any, s: Any, m: Model, w: Work, b: Buffers, known: bool) -> int:
    """One collision of the rows marked; with known = True the free acceleration stands in vd from the one before."""
    for i in range(s.nc):
        if w.struck[i] == BOUNCES:
            write_event(s, b, i, b.mode[i], COLLISION, 0.0)
    while True:
        if not known and _factor(K, s, m, w, b) != 0:
            return ILL_POSED
        _list_rows(s, m, w, b)
        if _impulses(K, s, m, w) != 0:
            return ILL_POSED
        j = _pulling(s, m, w)
        if j < 0:
            break
        _let_go(s, m, w, b, w.idx[j])
        known = False
    _apply(s, m, w, b)
    return 0


@compiled
def _endless(s: Any) -> bool:
    return bool(s.collisions_now > CEILING * (s.nc * s.nc + 16))


@compiled
def _stand_still(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Give rows that touch and whose gap stands still the rate 0, which they have but for `slow`.

    Collisions that come ever faster (inelastic collapse) end there. The gaps would drift apart by more than rounding,
    and the next impulse would cross the row in the order of these gaps instead of that of the rates.
    """
    nq, still = s.nq, False
    struck, rate, least = w.struck, w.rate, STILL * s.speed
    for i in range(s.nc):
        struck[i] = NOT
        if least < abs(rate[i]) <= slow(s, w, i) and _touches(s, m, w, b, i):
            struck[i] = STAYS
            still = True
    if not still or _endless(s):
        return 0
    if _factor(K, s, m, w, b) != 0:
        return ILL_POSED
    _list_rows(s, m, w, b)
    if assemble(K.rows, s, m, w, 1.0, s.t, w.y[:nq], w.y[nq:]) != 0:
        return ILL_POSED
    for j in range(s.na):
        w.r[j], w.ha[j] = 0.0, -1.0
        if w.struck[w.idx[j]] == STAYS:
            w.r[j] = -w.hda[j]
    solve_schur(w.G, s.na, w.reach, w.r, w.la)
    _apply(s, m, w, b)
    K.gaps(s.t, w.y[:nq], w.y[nq:], m.p, w.gap, w.rate)
    s.collisions_now += 1
    s.collisions += 1
    return 0


@compiled
def _name_touching(s: Any, m: Model, w: Work, b: Buffers) -> None:
    """Mark the rows that collide for ever, for the message."""
    changed = b.history[len(b.history) - 1]
    for i in range(s.nc):
        changed[i] = _touches(s, m, w, b, i)


@compiled
def collide(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Collide until no touching row approaches, from the gaps and rates in w.gap, w.rate.

    Returns:
        0, EVENTS_FULL if the caller must make room and come again, or a negative code.
    """
    nq, known = s.nq, False
    if s.collision_t != s.t:
        s.collision_t, s.collisions_now = s.t, 0
    while _choose(s, m, w, b) >= 0:
        if full(s, b):
            return EVENTS_FULL
        if _endless(s):
            _name_touching(s, m, w, b)
            return MODE_CYCLE
        code = _one(K, s, m, w, b, known)
        if code != 0:
            return int(code)
        known = bool(s.affine and s.na == 1 and not is_active(b.mode[w.idx[0]]))
        s.collisions_now += 1
        s.collisions += 1
        K.gaps(s.t, w.y[:nq], w.y[nq:], m.p, w.gap, w.rate)
    return int(_stand_still(K, s, m, w, b))
