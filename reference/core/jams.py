"""How far contacts that slide are from a jam, where their forces drive them further into each other."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.complete import RANK, factor_complete
from crossbody.reference.core.friction import has_friction, is_dry, is_tangent
from crossbody.reference.core.layout import Model, Work
from crossbody.reference.core.unknowns import fill
from crossbody.reference.kinds import Array, Bytes, Floats, Index

JAMMED = 1e-9  # determinant, of rows of size 1, that counts as none
JAMMING = 1e-2  # below which contacts are about to jam where no step is short enough
KNOWN_BY = 1e2  # times the tolerance, below which forces are not known


@compiled
def _reach(s: Any, m: Model, w: Work, j: int) -> None:
    """Mark in w.reached the places of rows in contact that forces of the row in place j move, or that move with it."""
    for a in range(s.na):
        w.reached[a] = a == j
    grows = True
    while grows:
        grows = False
        for a in range(s.na):
            own = m.follows[w.idx[a]] if is_tangent(m, w.idx[a]) else w.idx[a]
            for c in range(s.na if w.reached[a] else 0):
                i = w.idx[c]
                beside = i == own or (is_tangent(m, i) and m.follows[i] == own)
                if not (w.reached[c] or w.off[i]) and (beside or w.gram[a, c] != 0.0):
                    w.reached[c] = 1
                    grows = True


@compiled
def _signed_product(A: Floats, n: int, down: Index, across: Index, seen: Bytes) -> float:
    """Determinant from the factors of `factor_complete`, of the rows whose places `seen` does not mark; it fills it."""
    product = 1.0
    for a in range(n):
        b, length = a, 0
        while not seen[b]:
            seen[b] = 1
            product *= A[b, b]
            length += 1
            for c in range(n):
                if down[c] == across[b]:
                    b = c
                    break
        if length > 0 and length % 2 == 0:
            product = -product
    return float(product)


@compiled
def _independent(s: Any, w: Work, count: int) -> int:
    """Factor G = L L^T of the unknowns that w.among lists into w.second, their places in w.down2; how many rows."""
    for a in range(count):
        for b in range(count):
            j, k = w.among[a], w.among[b]
            w.square[a, b] = w.gram[w.unknown[j], w.unknown[k]] / (w.size[j] * w.size[k])
    rank = 0
    while rank < count:
        most, best = RANK, -1
        for a in range(count):
            if w.square[a, a] > most:
                most, best = w.square[a, a], a
        if best < 0:
            break
        for a in range(count):
            w.second[a, rank] = w.square[a, best] / np.sqrt(most)
        for a in range(count):
            for b in range(count):
                w.square[a, b] -= w.second[a, rank] * w.second[b, rank]
        w.square[best, best] = 0.0
        w.down2[rank] = best
        rank += 1
    return rank


@compiled
def determinant(s: Any, m: Model, w: Work, j: int) -> float:
    """Determinant of A of the rows that the sliding contact in place j bears on: positive until they jam together.

    Where it vanishes some forces of theirs press none of them, and behind that their forces drive them into each other:
    of one contact alone it is Painleve's p. Of rows that depend on each other only what forces do to independent ones
    counts, as by springs that are all alike: with G = L L^T it is that of L^+ A L. Less JAMMED: two that come near that
    place together press in turn, ever faster.
    """
    _reach(s, m, w, j)
    if s.short == 0:
        for a in range(s.unknowns):
            w.seen[a] = not w.reached[w.unknown[w.down[a]]]
        return _signed_product(w.matrix, s.unknowns, w.down, w.across, w.seen) - JAMMED
    s.spent_factors = 1
    fill(s, m, w)
    count = 0
    for a in range(s.unknowns):
        if w.reached[w.unknown[a]]:
            w.among[count] = a
            count += 1
    rank = _independent(s, w, count)
    for b in range(count):
        for a in range(rank):
            value = w.matrix[w.among[w.down2[a]], w.among[b]]
            for c in range(a):
                value -= w.second[w.down2[a], c] * w.held[c, b]
            w.held[a, b] = value / w.second[w.down2[a], a]
    for a in range(rank):
        for b in range(rank):
            w.first[a, b] = 0.0
            for c in range(count):
                w.first[a, b] += w.held[a, c] * w.second[c, b]
    if factor_complete(w.first, rank, rank, w.down, w.across, rank) < rank:
        return -JAMMED
    w.seen[:] = 0
    return _signed_product(w.first, rank, w.down, w.across, w.seen) - JAMMED


@compiled
def near(s: Any, m: Model, w: Work) -> bool:
    """Whether what has fired is of rows that bear on contacts so near to a jam that their forces are not known.

    Forces are off by the tolerance over the determinant: before a jam one reaches a bound, or vanishes, by that alone.
    Not asked where rows depend on each other, which would take the factors that hold them.
    """
    for j in range(s.na if s.short == 0 else 0):
        i = w.idx[j]
        slides = has_friction(m, i) and w.slides[i] and not is_dry(m, i)
        if slides and determinant(s, m, w, j) < min(KNOWN_BY * s.rtol, JAMMING):
            for a in range(s.na):
                if w.reached[a] and w.hit[w.idx[a]] <= s.theta:
                    return True
    return False


@compiled
def watch(s: Any, m: Model, w: Work, out: Array) -> float:
    """Write how far every contact that slides is from a jam, by the rows last factored; the least, inf if none slides.

    Behind a jam it is negative. Forces need not tell: they may stay as they are but for an instant that no stage of a
    step meets.
    """
    value, least, known = 0.0, np.inf, False
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and w.slides[i] and not is_dry(m, i):
            if not (known and w.reached[j]):
                value, known = determinant(s, m, w, j), True
            out[i] = value
            least = min(least, value)
    return float(least)
