"""Multipliers of rows in contact that stick or slide with Coulomb friction: factors of A, and solutions by them."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.algebra import ROUNDING
from crossbody.reference.core.complete import factor_complete, largest_left, solve_complete
from crossbody.reference.core.directions import take_directions
from crossbody.reference.core.friction import has_friction, is_dry
from crossbody.reference.core.islands import REST, couple, find, list_island, take
from crossbody.reference.core.layout import Model, Work
from crossbody.reference.core.loads import factor_in_turn, refine, solve_in_turn, spread, sticks_depend
from crossbody.reference.core.loops import eliminate, leave_unmoved
from crossbody.reference.core.shares import allow
from crossbody.reference.core.symmetric import factor_symmetric, solve_full
from crossbody.reference.core.unknowns import fill, list_unknowns
from crossbody.reference.kinds import Array

REFINEMENTS = 2  # of multipliers of rows that depend on each other,
ROUNDED = 1e-13  # part of what is asked of the rows by which they are off by rounding alone
GROWN = 1e-8  # pivot from which on a row does not depend on others that did
FURTHER = 10.0  # and at least so many times what it was


@compiled
def factor(s: Any, m: Model, w: Work, turning: bool) -> int:
    """Factor A of the rows in contact, from H, island by island; 1 if that is not finite.

    The rates of tangential rows count from here on against what the surface does by itself. Directions of slip are
    those of the present velocities if they are `turning`, else those of reference.
    """
    if s.islands < 0:
        find(s, m, w)
    couple(s, m, w)
    for j in range(s.na):
        i = w.idx[j]
        w.listed[i], w.carried[j] = j, 0.0
        if m.drift[i] != 0.0:
            w.hda[j] -= m.drift[i]
            w.r[j] += w.law[i, 1] * m.drift[i]
    if s.loops and eliminate(s, m, w) != 0:
        return 1
    if s.dry:
        leave_unmoved(s, m, w)
    take_directions(s, m, w, turning)
    sound = _factor_calm(s, m, w)
    take(s, m, w, REST)
    factor_as_held(s, m, w)
    return int(not sound or (s.rank == 0 and s.unknowns > 0))


@compiled
def _factor_calm(s: Any, m: Model, w: Work) -> bool:
    """Factor the systems of calm islands, sticking rows as `factor_as_held` does; whether each has a pivot."""
    sound, total = True, 0
    for k in range(s.calm):
        list_island(s, m, w, k)
        total += w.isle_unknowns[k]
    anew = total != s.held_calm
    s.held_calm, s.calm_dependent, s.calm_growth = total, 0, 0.0
    for k in range(s.calm):
        take(s, m, w, k)
        decided = anew or w.isle_held[k] >= s.unknowns - s.normals
        left = factor_symmetric(s, w, k, s.unknowns if decided else w.isle_held[k])
        if decided:
            w.isle_held[k], w.isle_grown[k] = w.isle_second[k], max(GROWN, FURTHER * left)
        else:
            s.calm_growth = max(s.calm_growth, left / w.isle_grown[k])
        s.calm_dependent += s.unknowns - w.isle_rank[k]
        sound = sound and (w.isle_rank[k] > 0 or s.unknowns == 0)
    return sound


@compiled
def factor_set(s: Any, m: Model, w: Work) -> None:
    """Factor A of the rows that are not off, from w.gram, w.slides and w.along, all together."""
    s.islands, s.calm, s.island, s.calm_dependent = -1, 0, REST, 0
    s.normals = list_unknowns(s, m, w)
    _factor_listed(s, m, w)


@compiled
def _factor_listed(s: Any, m: Model, w: Work) -> None:
    """Factor A of the unknowns that are listed."""
    fill(s, m, w)
    s.rank = factor_complete(w.matrix, s.unknowns, s.unknowns, w.down, w.across, s.unknowns)
    if s.unknowns > s.rank:
        factor_in_turn(s, m, w, s.unknowns)
    _count_dependent(s)


@compiled
def _count_dependent(s: Any) -> None:
    """Count the rows that depend on others, of the rest and of all, by the rank of the rest."""
    s.short = s.unknowns - s.rank
    s.dependent_rows = s.short + s.calm_dependent


@compiled
def factor_as_held(s: Any, m: Model, w: Work) -> None:
    """Factor A of the rest; sticking rows that depended on others when modes were decided do so until that is anew.

    Near there rounding says whether they do, and what they bear is nothing like what they bear where they do not.
    s.growth says how far they are from what calls for a new decision, 1 where that is.
    """
    s.normals = list_unknowns(s, m, w)
    sticking = s.unknowns - s.normals
    if s.held_unknowns != s.unknowns or s.held_rank >= sticking:
        _factor_listed(s, m, w)
        s.held_unknowns, s.growth = s.unknowns, s.calm_growth
        s.held_rank = s.rank_second if s.short > 0 else sticking
        s.grown = max(GROWN, FURTHER * _left(s, w))
        return
    factor_in_turn(s, m, w, s.held_rank)
    s.rank = s.rank_first + s.rank_second
    _count_dependent(s)
    s.growth = max(s.calm_growth, _left(s, w) / s.grown)


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
        la[j] = 0.0
    for c in range(s.na if s.dry else 0):
        if is_dry(m, w.idx[c]) and w.slides[w.idx[c]]:
            force = -m.friction[w.idx[c]] * w.along[c]
            for j in range(s.na):
                w.pushed[j] -= w.gram[j, c] * force
    for k in range(s.calm):
        take(s, m, w, k)
        _solve_system(s, m, w, la)
    if s.calm > 0:
        take(s, m, w, REST)
    _solve_system(s, m, w, la)
    for c in range(s.na if s.dry else 0):
        if is_dry(m, w.idx[c]) and w.slides[w.idx[c]]:
            la[c] = -m.friction[w.idx[c]] * w.along[c]


@compiled
def is_short(s: Any, w: Work) -> bool:
    """Whether rows of the system that is solved depend on others."""
    return bool(w.isle_rank[s.island] < s.unknowns if s.island >= 0 else s.short > 0)


@compiled
def _solve_system(s: Any, m: Model, w: Work, la: Array) -> None:
    """Fill la of the rows of the system that is solved from w.pushed, loads shared so that all can bear theirs."""
    _solve_unknowns(s, m, w, w.pushed)
    if not is_short(s, w):
        _give(s, m, w, la)
        return
    if sticks_depend(s, w):
        spread(s, m, w)
    _give(s, m, w, la)
    _refine(s, m, w, la)


@compiled
def _off(s: Any, w: Work, la: Array) -> float:
    """Leave in w.off_by what the rows of the unknowns are off under la; its size."""
    for a in range(s.unknowns):
        w.off_by[a] = w.pushed[w.unknown[a]]
    for c in range(s.na):
        if la[c] != 0.0:
            for a in range(s.unknowns):
                w.off_by[a] -= w.gram[c, w.unknown[a]] * la[c]
    square = 0.0
    for a in range(s.unknowns):
        w.off_by[a] /= w.size[a]
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
    for j in range(s.na):
        la[j] = 0.0
    for k in range(s.calm):
        take(s, m, w, k)
        _solve_unknowns(s, m, w, r)
        _give(s, m, w, la)
    if s.calm > 0:
        take(s, m, w, REST)
    _solve_unknowns(s, m, w, r)
    _give(s, m, w, la)


@compiled
def _solve_unknowns(s: Any, m: Model, w: Work, r: Array) -> None:
    """Leave in w.found the unknowns of the system that is solved, scaled by their sizes."""
    short = is_short(s, w)
    if short and s.island < 0 and s.spent_factors:
        factor_in_turn(s, m, w, s.most_second)
    for a in range(s.unknowns):
        w.found[a] = r[w.unknown[a]] / w.size[a]
    if short:
        solve_in_turn(s, m, w)
    elif s.island >= 0:
        solve_full(s, w, s.island)
    else:
        solve_complete(w.matrix, s.unknowns, s.rank, w.down, w.across, w.weight, w.square, w.beside, w.found)


@compiled
def _give(s: Any, m: Model, w: Work, la: Array) -> None:
    """Multipliers of the rows of the system that is solved from its unknowns."""
    for a in range(s.unknowns):
        la[w.unknown[a]] = w.found[a] / w.size[a]
    for j in range(s.na if s.island < 0 else 0):
        i = w.idx[j]
        if has_friction(m, i) and w.slides[i] and not (w.off[i] or is_dry(m, i)):
            first = w.listed[m.tangent[i]]
            for c in range(first, first + m.tangents[i]):
                la[c] = -m.friction[i] * la[j] * w.along[c]


@compiled
def contradiction(s: Any, m: Model, w: Work, la: Array) -> float:
    """By how many times what is allowed the normal rows of systems of less than full rank are off w.r under la."""
    allow(s, w, w.y[: s.nq], w.y[s.nq :])
    most = 0.0
    for k in range(REST, s.calm):
        if s.calm > 0:
            take(s, m, w, k)
        if is_short(s, w):
            most = max(most, _apart(s, w, la))
    if s.calm > 0:
        take(s, m, w, REST)
    return most


@compiled
def _apart(s: Any, w: Work, la: Array) -> float:
    """By how many times what is allowed a normal row of the system that is solved is off w.r under la."""
    most = 0.0
    for a in range(s.normals):
        j = w.unknown[a]
        total, size = -w.r[j], 0.0
        for c in range(s.na):
            part = w.gram[j, c] * la[c]
            total += part
            size += abs(part)
        most = max(most, abs(total) / (w.allowed[j] + ROUNDING * size) if total != 0.0 else 0.0)
    return float(most)
