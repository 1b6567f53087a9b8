"""Whether other sets of modes are consistent as well: none can be, all are tried, or there are too many to try.

Contacts that do not act on each other, through others either, are islands: each has its own sets.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.friction import has_friction, is_decided, is_dry
from crossbody.reference.core.layout import SLIP, Model, Work
from crossbody.reference.core.mode_search import aim, choices, judge, vary
from crossbody.reference.core.mode_set import (
    DIFFERENT,
    evaluate_set,
    jammed,
    keep,
    put_as_they_stand,
    put_back,
)
from crossbody.reference.core.unknowns import fill, list_unknowns
from crossbody.reference.kinds import Floats

DEFINITE = 1e-6  # square of a pivot, of rows of size 1, from which on a matrix is definite


@compiled
def _take_digits(s: Any, m: Model, w: Work, place: int, island: int) -> None:
    """Leave in w.digit, for `vary`, what stands at a place among all combinations of `choices` of an island."""
    for j in range(s.na):
        i = w.idx[j]
        if is_decided(w, i) and w.island[j] == island:
            w.digit[i], place = place % choices(m, w, i), place // choices(m, w, i)


@compiled
def _part(s: Any, m: Model, w: Work) -> None:
    """Leave in w.island the lowest place of the rows that act on each one, through others too, or share its contact."""
    for j in range(s.na):
        w.island[j] = j
    grows = True
    while grows:
        grows = False
        for a in range(s.na):
            for b in range(a):
                beside = m.follows[w.idx[a]] == w.idx[b] or m.follows[w.idx[b]] == w.idx[a]
                if (beside or w.gram[a, b] != 0.0) and w.island[a] != w.island[b]:
                    least = min(w.island[a], w.island[b])
                    w.island[a], w.island[b], grows = least, least, True


@compiled
def _is_monotone(s: Any, m: Model, w: Work) -> bool:
    """Whether no two motions can be consistent, whatever acts: then no other set has to be searched for.

    With x the difference of two solutions and A the matrix in which all that stands sticks, the laws of the contacts
    leave x.Ax <= sum mu |x_n| |(A x)_t| over those that stand: normal forces and accelerations exclude each other, and
    friction opposes a slip with all that it has. There is none if the symmetric part of A exceeds
    mu/2 (c x_n^2 + |(A x)_t|^2/c) for some c > 0: here c is the size of the tangential rows of A.
    """
    put_as_they_stand(s, m, w)
    list_unknowns(s, m, w)
    fill(s, m, w)
    A, S, count = w.matrix, w.square, s.unknowns
    for a in range(count):
        for b in range(count):
            S[a, b] = 0.5 * (A[a, b] + A[b, a])
    for n in range(count):
        i = w.idx[w.unknown[n]]
        if has_friction(m, i) and w.stands[i] and not is_dry(m, i):
            _take_friction(m, w, n, count)
    return _is_definite(S, count)


@compiled
def _take_friction(m: Model, w: Work, n: int, count: int) -> None:
    """Take from w.square the most that friction of the normal row at place n of the unknowns can do between two."""
    A, S, i, size2, longer = w.matrix, w.square, w.idx[w.unknown[n]], 0.0, 1.0
    for t in range(count):
        if m.follows[w.idx[w.unknown[t]]] == i:
            longer = max(longer, w.size[t] / w.size[n])
            for b in range(count):
                size2 += A[t, b] ** 2
    if size2 == 0.0:
        return
    half = 0.5 * m.friction[i] * longer
    S[n, n] -= half * np.sqrt(size2)
    for t in range(count):
        if m.follows[w.idx[w.unknown[t]]] == i:
            for a in range(count):
                for b in range(count):
                    S[a, b] -= half * A[t, a] * A[t, b] / np.sqrt(size2)


@compiled
def _is_definite(S: Floats, n: int) -> bool:
    """Whether a symmetric matrix, which is overwritten, is positive definite, clear of rounding."""
    for a in range(n):
        for b in range(a + 1):
            total = S[a, b]
            for c in range(b):
                total -= S[a, c] * S[b, c]
            if a == b:
                if not total > DEFINITE:
                    return False
                S[a, a] = np.sqrt(total)
            else:
                S[a, b] = total / S[b, b]
    return True


@compiled
def _has_cones(s: Any, m: Model, w: Work) -> bool:
    """Whether a bound of friction grows with a load: without, the motion is that of least constraint, and unique."""
    count = 0
    for j in range(s.na):
        count += has_friction(m, w.idx[j]) and not is_dry(m, w.idx[j])
    return bool(count > 0)


@compiled
def note_first(s: Any, found: bool) -> None:
    """Note the first instant from which on more than one motion keeps the law, or none is known to."""
    if found and s.not_unique + s.unmet == 0:
        s.unique_until = s.t


@compiled
def _sets(s: Any, m: Model, w: Work, island: int) -> int:
    """How many sets of modes an island has; no more are counted than are tried, and a few."""
    sets = 1
    for j in range(s.na):
        if w.island[j] == island and is_decided(w, w.idx[j]) and sets <= s.most_sets:
            sets *= choices(m, w, w.idx[j])
    return sets


@compiled
def _moves_otherwise(s: Any, m: Model, w: Work, island: int, sets: int) -> bool:
    """Whether another set of an island is consistent that leads to another motion; modes are put back."""
    found = False
    for place in range(1, sets):
        for i in range(s.nc):
            w.way[i] = w.kept_other[i]
        _take_digits(s, m, w, place, island)
        vary(s, m, w, island)
        if judge(s, m, w) < 0 and jammed(s, m, w) < 0:
            for j in range(s.na):
                found = found or abs(w.excess[j] - w.chosen[j]) > DIFFERENT * s.push_scale
    put_back(s, m, w)
    return found


@compiled
def count_others(s: Any, m: Model, w: Work) -> None:
    """Note whether another set is consistent as well and leads to another motion, or that there are too many to try.

    Contacts that all slide may be such: friction makes what they do to each other no P-matrix, though it is symmetric.
    """
    if not _has_cones(s, m, w):
        return
    keep(s, w)
    monotone = _is_monotone(s, m, w)
    put_back(s, m, w)
    if monotone:
        return
    evaluate_set(s, m, w)
    for j in range(s.na):
        w.chosen[j] = w.excess[j]
    for j in range(s.na):
        if has_friction(m, w.idx[j]) and w.stands[w.idx[j]] and w.state[w.idx[j]] != SLIP:
            aim(m, w, w.idx[j])
    for i in range(s.nc):
        w.kept_other[i] = w.way[i]
    _part(s, m, w)
    found, all_tried = False, True
    for island in range(s.na):
        sets = _sets(s, m, w, island)
        all_tried = all_tried and sets <= s.most_sets
        if 1 < sets <= s.most_sets:
            found = _moves_otherwise(s, m, w, island, sets) or found
    put_back(s, m, w)
    if not all_tried:
        s.searched_until = s.t if s.not_searched == 0 else s.searched_until
        s.not_searched += 1
    note_first(s, found)
    s.not_unique += found
