"""Multipliers of rows in contact that stick or slide with Coulomb friction: factors of A, and solutions by them."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.complete import factor_complete, largest_left, solve_complete
from crossbody.reference.core.directions import take_directions
from crossbody.reference.core.friction import has_friction, is_dry
from crossbody.reference.core.layout import Model, Work
from crossbody.reference.core.loads import factor_in_turn, refine, solve_in_turn, spread
from crossbody.reference.core.loops import eliminate, leave_unmoved
from crossbody.reference.core.unknowns import fill, list_unknowns
from crossbody.reference.kinds import Array

REFINEMENTS = 2  # of multipliers of rows that depend on each other,
ROUNDED = 1e-13  # part of what is asked of the rows by which they are off by rounding alone
GROWN = 1e-8  # pivot from which on a row does not depend on others that did
FURTHER = 10.0  # and at least so many times what it was


@compiled
def factor(s: Any, m: Model, w: Work, turning: bool) -> int:
    """Factor A of the rows in contact from G in the lower triangle of w.G; 1 if that is not finite.

    The rates of tangential rows count from here on against what the surface does by itself. Directions of slip are
    those of the present velocities if they are `turning`, else those of reference.
    """
    for j in range(s.na):
        i = w.idx[j]
        w.listed[i] = j
        if m.drift[i] != 0.0:
            w.hda[j] -= m.drift[i]
            w.r[j] += w.law[i, 1] * m.drift[i]
    for j in range(s.na):
        for c in range(j + 1):
            value = w.G[j, c] if c >= w.reach[j] else 0.0
            w.gram[j, c] = value
            w.gram[c, j] = value
    if s.loops and eliminate(s, m, w) != 0:
        return 1
    leave_unmoved(s, m, w)
    take_directions(s, m, w, turning)
    factor_as_held(s, m, w)
    return int(s.rank == 0 and s.unknowns > 0)


@compiled
def factor_set(s: Any, m: Model, w: Work) -> None:
    """Factor A of the rows that are not off, from w.gram, w.slides and w.along."""
    s.normals = list_unknowns(s, m, w)
    _factor_listed(s, m, w)


@compiled
def _factor_listed(s: Any, m: Model, w: Work) -> None:
    """Factor A of the unknowns that are listed."""
    fill(s, m, w)
    s.rank = factor_complete(w.matrix, s.unknowns, s.unknowns, w.down, w.across, s.unknowns)
    s.dependent_rows = s.unknowns - s.rank
    if s.dependent_rows > 0:
        factor_in_turn(s, m, w, s.unknowns)


@compiled
def factor_as_held(s: Any, m: Model, w: Work) -> None:
    """Factor A; sticking rows that depended on others when modes were decided do so until they are decided anew.

    Near there rounding says whether they do, and what they bear is nothing like what they bear where they do not.
    s.growth says how far they are from what calls for a new decision, 1 where that is.
    """
    s.normals = list_unknowns(s, m, w)
    sticking = s.unknowns - s.normals
    if s.held_unknowns != s.unknowns or s.held_rank >= sticking:
        _factor_listed(s, m, w)
        s.held_unknowns, s.growth = s.unknowns, 0.0
        s.held_rank = s.rank_second if s.dependent_rows > 0 else sticking
        s.grown = max(GROWN, FURTHER * _left(s, w))
        return
    factor_in_turn(s, m, w, s.held_rank)
    s.rank = s.rank_first + s.rank_second
    s.dependent_rows = s.unknowns - s.rank
    s.growth = _left(s, w) / s.grown


@compiled
def _left(s: Any, w: Work) -> float:
    """The largest pivot of a sticking row that depends on others; 0 if none does."""
    return float(largest_left(w.second, s.held_rank, s.unknowns - s.normals))


@compiled
def solve(s: Any, m: Model, w: Work, r: Array, la: Array) -> None:
    """Fill la of all rows in contact from the right-hand side r and what `factor` left; rows that are off get none.

    Those that slide with a bound of their own get it, and their forces count on the right-hand side.
    """
    for j in range(s.na):
        w.pushed[j] = r[j]
    for c in range(s.na):
        if is_dry(m, w.idx[c]) and w.slides[w.idx[c]]:
            force = -m.friction[w.idx[c]] * w.along[c]
            for j in range(s.na):
                w.pushed[j] -= w.gram[j, c] * force
    _solve_unknowns(s, m, w, w.pushed)
    if s.dependent_rows > 0 and s.rank_second < s.unknowns - s.normals:
        spread(s, m, w)
    _give(s, m, w, la)
    if s.dependent_rows > 0:
        _refine(s, m, w, la)
    for c in range(s.na):
        if is_dry(m, w.idx[c]) and w.slides[w.idx[c]]:
            la[c] = -m.friction[w.idx[c]] * w.along[c]


@compiled
def _off(s: Any, w: Work, la: Array) -> float:
    """Leave in w.off_by what the rows of the unknowns are off under la; its size."""
    square = 0.0
    for a in range(s.unknowns):
        total = w.pushed[w.unknown[a]]
        for c in range(s.na):
            total -= w.gram[w.unknown[a], c] * la[c]
        w.off_by[a] = total / w.size[a]
        square += w.off_by[a] ** 2
    return float(np.sqrt(square))


@compiled
def _refine(s: Any, m: Model, w: Work, la: Array) -> None:
    """Solve again for what rows are off under la: nearly dependent ones with loads that are unlike lose digits."""
    off, asked = _off(s, w, la), 0.0
    for a in range(s.unknowns):
        asked += (w.pushed[w.unknown[a]] / w.size[a]) ** 2
    for _ in range(REFINEMENTS if off > ROUNDED * np.sqrt(asked) else 0):
        refine(s, w)
        _give(s, m, w, la)
        now = _off(s, w, la)
        if not now < off:
            for a in range(s.unknowns):
                w.found[a] = w.known[a]
            _give(s, m, w, la)
            break
        off = now


@compiled
def respond(s: Any, m: Model, w: Work, r: Array, la: Array) -> None:
    """Fill la of all rows in contact by how it changes with r: constant forces of rows that slide have no part."""
    _solve_unknowns(s, m, w, r)
    _give(s, m, w, la)


@compiled
def _solve_unknowns(s: Any, m: Model, w: Work, r: Array) -> None:
    """Leave in w.found the unknowns, scaled by their sizes."""
    if s.dependent_rows > 0 and s.spent_factors:
        factor_in_turn(s, m, w, s.most_second)
    for a in range(s.unknowns):
        w.found[a] = r[w.unknown[a]] / w.size[a]
    if s.dependent_rows > 0:
        solve_in_turn(s, m, w)
    else:
        solve_complete(w.matrix, s.unknowns, s.rank, w.down, w.across, w.weight, w.square, w.beside, w.found)


@compiled
def _give(s: Any, m: Model, w: Work, la: Array) -> None:
    """Multipliers of all rows in contact from the unknowns."""
    for j in range(s.na):
        la[j] = 0.0
    for a in range(s.unknowns):
        la[w.unknown[a]] = w.found[a] / w.size[a]
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and w.slides[i] and not (w.off[i] or is_dry(m, i)):
            first = w.listed[m.tangent[i]]
            for c in range(first, first + m.tangents[i]):
                la[c] = -m.friction[i] * la[j] * w.along[c]
