"""Islands: rows in contact that no moving mechanism couples to others, so that each island is a system of its own.

Trees of bodies, or blocks of the mass matrix, that a row in contact joins belong to one island. G = H M^-1 H^T has
nothing but zeros between two of them. One in which nothing slides is calm: its part of A is symmetric (`symmetric`).
All others together are the rest, whose A is not.
"""

from __future__ import annotations

from typing import Any

from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import entry_of, push_of
from crossbody.reference.core.algebra import solve_columns
from crossbody.reference.core.friction import is_tangent
from crossbody.reference.core.layout import Model, Work
from crossbody.reference.core.loops import bears_nothing
from crossbody.reference.core.unknowns import is_out, list_unknowns, row_size
from crossbody.reference.kinds import Index

REST = -1  # the system of all islands in which something slides


@compiled
def _root(root: Index, c: int) -> int:
    """The lowest coordinate that c is known to move with."""
    while root[c] != c:
        c = root[c]
    return c


@compiled
def find(s: Any, m: Model, w: Work) -> None:
    """List the rows in contact by islands, each from w.begin[k] to w.begin[k + 1] of w.packed, the calm ones first."""
    for c in range(s.n):
        w.root[c] = w.root[m.above[c]] if m.above[c] >= 0 else c
    for j in range(s.na):
        first, last = m.trees[w.idx[j], 0], m.trees[w.idx[j], 1]
        for c in range(first, last):
            a, b = _root(w.root, first), _root(w.root, c)
            w.root[max(a, b)] = min(a, b)
    for c in range(s.n):
        w.slid_on[c] = 0
    for j in range(s.na):
        i = w.idx[j]
        w.island[j] = _root(w.root, m.trees[i, 0])
        w.slid_on[w.island[j]] |= w.slides[i]
        w.calm[j] = 0
    s.islands, s.calm, w.begin[0] = 0, 0, 0
    for slides in range(2):
        for j in range(s.na):
            if w.island[j] >= 0 and w.slid_on[w.island[j]] == slides:
                _pack(s, m, w, j, slides == 0)
    for j in range(s.na):  # what stands outside of islands is zero from here on
        for c in range(s.na):
            w.gram[j, c] = 0.0
        for c in range(s.n):
            w.X[j, c] = 0.0
    s.held_calm = -1


@compiled
def _pack(s: Any, m: Model, w: Work, first: int, calm: bool) -> None:
    """List the island of the row in place `first`, the lowest of it."""
    at, root, low, high = w.begin[s.islands], w.island[first], s.n, 0
    for j in range(first, s.na):
        if w.island[j] == root:
            w.packed[at], w.island[j], w.calm[j] = j, -1, calm
            low, high = min(low, m.trees[w.idx[j], 0]), max(high, m.trees[w.idx[j], 1])
            at += 1
    w.begin_at[s.islands], w.end_at[s.islands] = low, high
    s.islands += 1
    s.calm += calm
    w.begin[s.islands] = at


@compiled
def couple(s: Any, m: Model, w: Work) -> None:
    """Fill M^-1 H^T of the rows in contact and w.gram, H M^-1 H^T, island by island."""
    for k in range(s.islands):
        start, count = w.begin[k], w.begin[k + 1] - w.begin[k]
        if w.begin_at[k] // s.k == (w.end_at[k] - 1) // s.k and count > 1:
            _couple_at_once(s, m, w, start, count, w.begin_at[k], w.end_at[k] - w.begin_at[k])
        else:
            _couple_row_by_row(s, m, w, start, count)


@compiled
def _couple_row_by_row(s: Any, m: Model, w: Work, start: int, count: int) -> None:
    """Fill both for an island on several blocks, of which rows have different ones."""
    for a in range(start, start + count):
        j = w.packed[a]
        push_of(s, m, w, j)
        for b in range(start, a + 1):
            value = entry_of(m, w, j, w.packed[b])
            w.gram[j, w.packed[b]], w.gram[w.packed[b], j] = value, value


@compiled
def _couple_at_once(s: Any, m: Model, w: Work, start: int, count: int, first: int, n: int) -> None:
    """Fill both for an island on n coordinates of one block of M: the rows' entries of each stand side by side."""
    right, solved, G = w.right, w.solved, w.G
    for a in range(count):
        j = w.packed[start + a]
        for c in range(n):
            right[c, a] = w.H[j, first + c]
            solved[c, a] = right[c, a]
    solve_columns(w.L, solved, m.above, first, first % s.k, n, count)
    for a in range(count):
        j = w.packed[start + a]
        for b in range(a + 1):
            G[a, b] = 0.0
        for c in range(n):
            part = solved[c, a]
            w.X[j, first + c] = part
            for b in range(a + 1):
                G[a, b] += part * right[c, b]
        for b in range(a + 1):
            w.gram[j, w.packed[start + b]] = G[a, b]
            w.gram[w.packed[start + b], j] = G[a, b]


@compiled
def list_island(s: Any, m: Model, w: Work, k: int) -> None:
    """List the unknowns of calm island k, and their sizes, in w.calm_place and w.calm_size, sticking rows last."""
    start, end, count = w.begin[k], w.begin[k + 1], w.begin[k]
    for a in range(start, end):
        j = w.packed[a]
        if not is_tangent(m, w.idx[j]) and not (s.loops and is_out(m, w, j)):
            w.calm_place[count], w.spot[j] = j, count - start
            count += 1
    w.isle_normals[k] = count - start
    for a in range(start, end):
        j = w.packed[a]
        if is_tangent(m, w.idx[j]) and not bears_nothing(m, w, j):
            w.calm_place[count] = j
            count += 1
    w.isle_unknowns[k] = count - start
    for a in range(start, count):
        w.calm_size[a] = row_size(m, w, w.calm_place[a])


@compiled
def take(s: Any, m: Model, w: Work, k: int) -> None:
    """Let the system that is solved be that of calm island k, or of the rest if that is -1."""
    s.island = k
    if k < 0:
        s.unknowns, s.normals = 0, 0
        if s.calm < s.islands:
            s.normals = list_unknowns(s, m, w)
            for a in range(s.unknowns):
                w.size[a] = row_size(m, w, w.unknown[a])
        return
    start = w.begin[k]
    s.unknowns, s.normals = w.isle_unknowns[k], w.isle_normals[k]
    for a in range(s.unknowns):
        w.unknown[a], w.size[a] = w.calm_place[start + a], w.calm_size[start + a]
