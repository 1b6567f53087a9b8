"""Rows that are always on, beside contacts with friction: eliminated before modes of contacts are looked at.

With l the rows of loops and c all others in contact, G = H M^-1 H^T, G_ll = L L^T and Y = L^-1 G_lc,

    G'_cc = G_cc - Y^T Y          r'_c = r_c - Y^T L^-1 r_l          lam_l = L^-T (L^-1 r_l - Y lam_c)

are the system of the contacts of the mechanism whose loops are closed: what coordinates without loops would give.
Modes, sizes of rows, shares of loads and jams are those of that system, by whatever rows the loops are written. A row
that the loops hold, so that no contact moves it, has nothing but zeros there, and bears nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.algebra import DEPENDENT, RANK
from crossbody.reference.core.friction import is_dry, is_tangent
from crossbody.reference.core.layout import Model, Work
from crossbody.reference.kinds import Array

HELD = 1e-9  # part of its terms by which a row that loops hold may be asked to move, and at least rtol
UNMOVED = 1e-14  # part of its terms by which a row's friction must accelerate it to count
KNOWN = 100.0  # times what the tolerance makes of a gap and its rate: loops may have drifted by so much


@compiled
def is_loop(m: Model, i: int) -> bool:
    """Whether row i is always on: itself, or the row that it follows."""
    own = m.follows[i] if m.follows[i] >= 0 else i
    return bool(m.unilateral[own] == 0)


@compiled
def is_idle(w: Work, j: int) -> bool:
    """Whether loops hold the row in place j, so that no contact moves it, or its friction moves nothing."""
    return not w.gram[j, j] > 0.0


@compiled
def bears_nothing(m: Model, w: Work, j: int) -> bool:
    """Whether loops hold the row in place j, or the contact that it belongs to."""
    i = w.idx[j]
    return is_idle(w, j) or (is_tangent(m, i) and is_idle(w, w.listed[m.follows[i]]))


@compiled
def eliminate(s: Any, m: Model, w: Work) -> int:
    """Take loops out of w.gram and w.r; 1 if they have lost rank, or hold a contact that its law lets rise.

    Leaves L in w.closing, Y in w.led, places of loops in w.loop, L^-1 r in w.drawn, and in w.G the diagonal of L.
    """
    s.closed = 0
    for j in range(s.na):
        if is_loop(m, w.idx[j]):
            w.loop[s.closed] = j
            s.closed += 1
    if _factor(s, w) != 0:
        return 1
    _draw(s, w, w.r)
    for c in range(s.na):
        if not is_loop(m, w.idx[c]):
            _lead(s, w, c)
            _reduce(s, m, w, c)
    code = _hold(s, m, w)
    _take_away(s, w)
    return int(code)


@compiled
def _factor(s: Any, w: Work) -> int:
    """Cholesky factor of G of the loops; 1 if one follows from those before it."""
    L = w.closing
    for a in range(s.closed):
        j = w.loop[a]
        for b in range(a + 1):
            total = w.gram[j, w.loop[b]]
            for k in range(b):
                total -= L[a, k] * L[b, k]
            if a != b:
                L[a, b] = total / L[b, b]
            elif total > RANK * w.gram[j, j]:
                L[a, a] = np.sqrt(total)
                w.G[j, j] = L[a, a]
            else:
                return 1
    return 0


@compiled
def _draw(s: Any, w: Work, r: Array) -> None:
    """L^-1 r of the loops, in w.drawn."""
    for a in range(s.closed):
        total = r[w.loop[a]]
        for k in range(a):
            total -= w.closing[a, k] * w.drawn[k]
        w.drawn[a] = total / w.closing[a, a]


@compiled
def _lead(s: Any, w: Work, c: int) -> None:
    """Column of Y of the row in place c."""
    for a in range(s.closed):
        total = w.gram[w.loop[a], c]
        for k in range(a):
            total -= w.closing[a, k] * w.led[k, c]
        w.led[a, c] = total / w.closing[a, a]


@compiled
def _reduce(s: Any, m: Model, w: Work, c: int) -> None:
    """Row c of G' up to its diagonal, and r'_c with the size of its terms."""
    for d in range(c + 1):
        if not is_loop(m, w.idx[d]):
            total = w.gram[c, d]
            for a in range(s.closed):
                total -= w.led[a, c] * w.led[a, d]
            w.gram[c, d], w.gram[d, c] = total, total
    for a in range(s.closed):
        part = w.led[a, c] * w.drawn[a]
        w.r[c] -= part
        w.scale[c] += abs(part)


@compiled
def _led(s: Any, w: Work, c: int) -> float:
    """Square of what loops let the row in place c have of their own."""
    total = 0.0
    for a in range(s.closed):
        total += w.led[a, c] ** 2
    return float(total)


@compiled
def _hold(s: Any, m: Model, w: Work) -> int:
    """Put zeros for rows that loops hold; 1 if one of a contact should rise all the same."""
    gap, rate = 0.0, 0.0
    for a in range(s.nq + s.n):
        known = KNOWN * (w.atol[a] + s.rtol * abs(w.y[a]))
        gap, rate = (max(gap, known), rate) if a < s.nq else (gap, max(rate, known))
    code = 0
    for c in range(s.na):
        i = w.idx[c]
        if not is_loop(m, i) and not w.gram[c, c] > DEPENDENT * _led(s, w, c):
            most = max(HELD, s.rtol) * w.scale[c] + w.law[i, 0] * gap + w.law[i, 1] * rate
            code |= not is_tangent(m, i) and w.r[c] > most
            _put_zeros(s, m, w, c, most)
    return int(code)


@compiled
def _put_zeros(s: Any, m: Model, w: Work, c: int, most: float) -> None:
    """Take the row in place c out; what a tangential one is asked for beyond `most` stays in w.carried."""
    i = w.idx[c]
    asked = w.r[c] + w.law[i, 1] * w.hda[c]
    w.carried[c] = asked if is_tangent(m, i) and abs(asked) > most else 0.0
    w.r[c] = 0.0
    for d in range(s.na):
        w.gram[c, d], w.gram[d, c] = 0.0, 0.0


@compiled
def leave_unmoved(s: Any, m: Model, w: Work) -> None:
    """Take out rows that their whole dry friction moves by rounding alone, as that of a tendon where it is shortest."""
    for c in range(s.na):
        i = w.idx[c]
        unmoved = is_dry(m, i) and m.friction[i] * w.gram[c, c] <= UNMOVED * w.scale[c]
        if unmoved and not (s.loops and is_idle(w, c)):
            _put_zeros(s, m, w, c, HELD * w.scale[c])


@compiled
def _take_away(s: Any, w: Work) -> None:
    """Leave of the loops in w.gram how much each one alone moves by itself, 1/(G_ll^-1)_jj, which tells its noise."""
    for a in range(s.closed):
        for d in range(s.na):
            w.gram[w.loop[a], d], w.gram[d, w.loop[a]] = 0.0, 0.0
    for a in range(s.closed):
        size2 = 0.0
        for b in range(a, s.closed):
            total = 1.0 if b == a else 0.0
            for k in range(a, b):
                total -= w.closing[b, k] * w.beside[k]
            w.beside[b] = total / w.closing[b, b]
            size2 += w.beside[b] ** 2
        w.gram[w.loop[a], w.loop[a]] = 1.0 / size2


@compiled
def reduce_right(s: Any, m: Model, w: Work, r: Array) -> None:
    """R := r' of any right-hand side r of all rows in contact."""
    _draw(s, w, r)
    for c in range(s.na):
        if not is_loop(m, w.idx[c]):
            for a in range(s.closed):
                r[c] -= w.led[a, c] * w.drawn[a]
            if is_idle(w, c):
                r[c] = 0.0


@compiled
def complete(s: Any, m: Model, w: Work, r: Array, la: Array, driven: bool) -> None:
    """Fill la of the loops from that of the others: their law asks for r, or if they are not `driven` for nothing."""
    if driven:
        _draw(s, w, r)
    for a in range(s.closed):
        total = w.drawn[a] if driven else 0.0
        for c in range(s.na):
            if not is_loop(m, w.idx[c]):
                total -= w.led[a, c] * la[c]
        w.beside[a] = total
    for a in range(s.closed - 1, -1, -1):
        w.beside[a] /= w.closing[a, a]
        for k in range(a):
            w.beside[k] -= w.closing[a, k] * w.beside[a]
        la[w.loop[a]] = w.beside[a]
