"""The system of an island in which nothing slides: symmetric, so that A = L D L^T by pivots of its diagonal.

Where it has less than full rank the pivots of the normal rows come first,

    A = (L1, L2) D (L1, L2)^T,        L1 of all rows, L2 of the sticking ones alone,

and the multipliers of `loads` follow from two small systems, N1 = L1_n^T L1_n of the normal rows and N2 = L2^T L2.
Factors of island k stand from row w.begin[k] on. L is stored by columns.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.complete import RANK, factor_normal, orthonormalise, solve_normal
from crossbody.reference.core.layout import Work
from crossbody.reference.kinds import Array, Floats


@compiled
def _take_pivots(s: Any, w: Work, o: int, low: int, high: int, done: int, most: int) -> int:
    """Take up to `most` pivots from rows `low` to `high` behind the `done` ones; how many there are then."""
    n, L = s.unknowns, w.ldl
    while done < most:
        best, pivot = -1, RANK
        for a in range(low, high):
            if w.remains[a] > pivot:
                best, pivot = a, w.remains[a]
        if best < 0:
            break
        place, scale = w.unknown[best], 1.0 / (pivot * w.size[best])
        for a in range(low, n):
            L[o + done, a] = w.gram[place, w.unknown[a]] * scale / w.size[a]
        for c in range(done):
            part = L[o + c, best] * w.pivots[o + c] / pivot
            for a in range(low, n):
                L[o + done, a] -= part * L[o + c, a]
        for c in range(done):
            L[o + done, w.taken[o + c]] = 0.0
        L[o + done, best] = 1.0
        for a in range(low, n):
            w.remains[a] -= L[o + done, a] ** 2 * pivot
        w.remains[best] = 0.0
        w.pivots[o + done], w.taken[o + done] = pivot, best
        done += 1
    return done


@compiled
def _begin(s: Any, w: Work) -> None:
    for a in range(s.unknowns):
        w.remains[a] = w.gram[w.unknown[a], w.unknown[a]] / w.size[a] ** 2


@compiled
def _small_systems(s: Any, w: Work, o: int, first: int, rank: int) -> None:
    """Fill and factor N1 and N2, which stand one below the other."""
    for b in range(rank):
        start = 0 if b < first else first
        low, high = (0, s.normals) if b < first else (s.normals, s.unknowns)
        for c in range(start, b + 1):
            total = 0.0
            for a in range(low, high):
                total += w.ldl[o + b, a] * w.ldl[o + c, a]
            w.small[o + b, c - start] = total
    factor_normal(w.small[o : o + first], first)
    factor_normal(w.small[o + first : o + rank], rank - first)


@compiled
def factor_symmetric(s: Any, w: Work, k: int, most: int) -> float:
    """Factor the system of calm island k, which is taken; the largest pivot that is left among its sticking rows.

    Of the sticking rows at most so many count as independent; whether all rows are is asked where that is no bound.
    """
    n, o, sticking = s.unknowns, w.begin[k], s.unknowns - s.normals
    _begin(s, w)
    if most >= sticking:
        w.isle_rank[k] = _take_pivots(s, w, o, 0, n, 0, n)
        w.isle_second[k] = sticking
        if w.isle_rank[k] == n:
            return 0.0
        _begin(s, w)
    first = _take_pivots(s, w, o, 0, s.normals, 0, s.normals)
    rank = _take_pivots(s, w, o, s.normals, n, first, first + min(most, sticking))
    w.isle_rank[k], w.isle_second[k] = rank, rank - first
    _small_systems(s, w, o, first, rank)
    left = 0.0
    for a in range(s.normals, n):
        left = max(left, w.remains[a])
    return float(left)


@compiled
def solve_full(s: Any, w: Work, k: int) -> None:
    """Solve for w.found the system of calm island k, which is taken and of full rank."""
    n, o, L, y = s.unknowns, w.begin[k], w.ldl, w.beside
    for a in range(n):
        total = w.found[w.taken[o + a]]
        for c in range(a):
            total -= L[o + c, w.taken[o + a]] * y[c]
        y[a] = total
    for a in range(n - 1, -1, -1):
        total = y[a] / w.pivots[o + a]
        for c in range(a + 1, n):
            total -= L[o + a, w.taken[o + c]] * w.found[w.taken[o + c]]
        w.found[w.taken[o + a]] = total


@compiled
def start_symmetric(s: Any, w: Work, k: int) -> None:
    """Leave in w.press what the normal rows alone ask for by w.found, and in w.asked what the sticking ones do then."""
    n, count, o, first, second = s.unknowns, s.normals, w.begin[k], w.isle_rank[k] - w.isle_second[k], w.isle_second[k]
    L, left, y = w.ldl[o : o + n], w.left, w.beside
    _project(L, 0, first, 0, count, w.found, y)
    solve_normal(w.small[o : o + first], first, y)
    for a in range(count, n):
        left[a] = w.found[a]
    for b in range(first):
        for a in range(count, n):
            left[a] -= L[b, a] * y[b]
        y[b] /= w.pivots[o + b]
    _press(L, w.small[o : o + first], first, count, y, w.press)
    _project(L, first, second, count, n, left, w.asked)
    solve_normal(w.small[o + first : o + first + second], second, w.asked)
    for b in range(second):
        w.asked[b] /= w.pivots[o + first + b]


@compiled
def _project(L: Floats, first: int, rank: int, low: int, high: int, x: Array, y: Array) -> None:
    """Y := L^T x of `rank` columns from `first` on, in rows `low` to `high`."""
    for b in range(rank):
        total = 0.0
        for a in range(low, high):
            total += L[first + b, a] * x[a]
        y[b] = total


@compiled
def _press(L: Floats, N: Floats, first: int, count: int, y: Array, out: Array) -> None:
    """Out := L1_n N1^-1 y of the normal rows; y is overwritten."""
    solve_normal(N, first, y)
    for a in range(count):
        out[a] = 0.0
    for b in range(first):
        for a in range(count):
            out[a] += L[b, a] * y[b]


@compiled
def share_symmetric(s: Any, w: Work, k: int) -> None:
    """Solve for the sticking rows by w.weight, and for the normal ones beside them."""
    n, count, o, first, second = s.unknowns, s.normals, w.begin[k], w.isle_rank[k] - w.isle_second[k], w.isle_second[k]
    L, Q, y, found, root = w.ldl[o : o + n], w.square, w.beside, w.found, w.root_weight
    for a in range(n - count):
        root[a] = np.sqrt(w.weight[a])
        found[count + a] = 0.0
    for b in range(second):
        y[b] = w.asked[b]
        for a in range(n - count):
            Q[b, a] = L[first + b, count + a] * root[a]
    orthonormalise(Q, second, n - count, y)
    for b in range(second):
        for a in range(n - count):
            found[count + a] += Q[b, a] * y[b]
    for a in range(n - count):
        found[count + a] *= root[a]
    _project(L, 0, first, count, n, found, y)
    _press(L, w.small[o : o + first], first, count, y, found)
    for a in range(count):
        found[a] = w.press[a] - found[a]
