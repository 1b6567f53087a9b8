"""Loads of rows in contact that depend on each other, as those of a box on its corners do.

The normal rows are fulfilled first, by multipliers of least norm, and the sticking ones in their null space, by those
of least sum |lam_t|^2 / (mu lam_n): a load is shared so that no contact is nearer to its bound than it must be.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.complete import factor_complete, solve_complete
from crossbody.reference.core.friction import is_dry
from crossbody.reference.core.layout import Model, Work
from crossbody.reference.core.symmetric import share_symmetric, start_symmetric
from crossbody.reference.core.unknowns import fill

LIGHT = 1e-12  # part of the largest load at a contact, below which it counts as that
SHARINGS = 3  # times that loads are shared anew: the normal ones follow from the tangential ones
INSIDE = 1.0 - 1e-6  # part of its bound to which a contact is unburdened: loads are refined by less afterwards
MOST_SPREADS = 200  # times more where a contact would bear more than it can: others may for it


@compiled
def factor_in_turn(s: Any, m: Model, w: Work, most: int) -> None:
    """Factor the normal rows alone, and what they leave of the sticking ones, of which `most` count as independent."""
    count, total = s.normals, s.unknowns
    s.most_second, s.spent_factors = most, 0
    fill(s, m, w)
    for a in range(count):
        for b in range(count):
            w.first[a, b] = w.matrix[a, b]
        w.weight[a] = 1.0
    s.rank_first = factor_complete(w.first, count, count, w.down, w.across, count)
    for b in range(count, total):
        for a in range(count):
            w.found[a] = w.matrix[a, b]
        solve_complete(w.first, count, s.rank_first, w.down, w.across, w.weight, w.square, w.beside, w.found)
        for a in range(count, total):
            value = w.matrix[a, b]
            for c in range(count):
                value -= w.matrix[a, c] * w.found[c]
            w.second[a - count, b - count] = value
        for a in range(count):
            w.held[a, b - count] = w.found[a]
    for a in range(count, total):
        for c in range(count):
            w.held[a, c] = w.matrix[a, c]
    s.rank_second = factor_complete(w.second, total - count, total - count, w.down2, w.across2, most)


@compiled
def sticks_depend(s: Any, w: Work) -> bool:
    """Whether sticking rows of the system that is solved depend on others, so that their loads are shared."""
    independent = w.isle_second[s.island] if s.island >= 0 else s.rank_second
    return bool(independent < s.unknowns - s.normals)


@compiled
def _start(s: Any, w: Work) -> None:
    """Leave in w.press what the normal rows alone ask for by w.found, and in w.left what the sticking ones do then."""
    if s.island >= 0:
        start_symmetric(s, w, s.island)
        return
    count, sticking = s.normals, s.unknowns - s.normals
    for a in range(count):
        w.even[a] = 1.0
    solve_complete(w.first, count, s.rank_first, w.down, w.across, w.even, w.square, w.beside, w.found)
    for a in range(sticking):
        value = w.found[count + a]
        for c in range(count):
            value -= w.held[count + a, c] * w.found[c]
        w.left[a] = value
    for a in range(count):
        w.press[a] = w.found[a]


@compiled
def solve_in_turn(s: Any, m: Model, w: Work) -> None:
    """Solve for w.found the normal rows, and in their null space the sticking ones, by loads that suit these."""
    _start(s, w)
    for _ in range(SHARINGS if sticks_depend(s, w) else 1):
        _weigh(s, m, w)
        _share(s, w)


@compiled
def refine(s: Any, w: Work) -> None:
    """Add to w.found what w.off_by, by which rows are off under it, asks for in loads that are shared as they were."""
    for a in range(s.unknowns):
        w.known[a], w.found[a] = w.found[a], w.off_by[a]
    _start(s, w)
    _share(s, w)
    for a in range(s.unknowns):
        w.found[a] += w.known[a]


@compiled
def _share(s: Any, w: Work) -> None:
    """Solve for the sticking rows by w.weight, and for the normal ones beside them."""
    if s.island >= 0:
        share_symmetric(s, w, s.island)
        return
    count, sticking = s.normals, s.unknowns - s.normals
    for a in range(sticking):
        w.found[count + a] = w.left[a]
    solve_complete(
        w.second, sticking, s.rank_second, w.down2, w.across2, w.weight, w.square, w.beside, w.found[count:]
    )  # fmt: skip
    for a in range(count):
        value = w.press[a]
        for c in range(sticking):
            value -= w.held[a, c] * w.found[count + c]
        w.found[a] = value


@compiled
def spread(s: Any, m: Model, w: Work) -> None:
    """Share the loads of sticking contacts anew until none bears more than it can, or it is known that some must.

    Lawson's weights, which grow with what a contact bears of its bound, lead to the sharing whose largest part is the
    least. Squares of the parts, weighted, sum up to no more than the square of that: where they do to 1 none suffices.
    """
    count, sticking = s.normals, s.unknowns - s.normals
    for spread in range(MOST_SPREADS):
        _weigh(s, m, w)
        total, most = 0.0, 0.0
        for a in range(sticking):  # bounds, and parts of them
            w.left2[a] = w.weight[a] / w.size[count + a] ** 2
            square = 0.0
            for c in range(max(a - 1, 0), min(a + 2, sticking)):  # a contact's rows stand side by side
                if m.follows[w.idx[w.unknown[count + c]]] == m.follows[w.idx[w.unknown[count + a]]]:
                    square += (w.found[count + c] / w.size[count + c]) ** 2
            unbounded = m.friction[m.follows[w.idx[w.unknown[count + a]]]] == np.inf
            w.part2[a] = 0.0 if unbounded else np.sqrt(square) / w.left2[a]
            most = max(most, w.part2[a])
            if spread == 0:
                w.share2[a] = w.left2[a]
            total += w.share2[a]
        if not most > INSIDE:
            return
        sum1, sum2 = 0.0, 0.0
        for a in range(sticking):
            w.share2[a] /= total
            sum1 += w.share2[a] * w.part2[a]
            sum2 += w.share2[a] * w.part2[a] ** 2
        if not sum2 <= 1.0:
            return
        for a in range(sticking):
            w.share2[a] = max(w.share2[a] * w.part2[a] / sum1, LIGHT)
            w.weight[a] = (w.left2[a] * w.size[count + a]) ** 2 / w.share2[a]
        _share(s, w)


@compiled
def _weigh(s: Any, m: Model, w: Work) -> None:
    """Leave in w.weight the bound of every sticking row, mu lam_n, in the scale of its unknown."""
    count, most = s.normals, 0.0
    for a in range(s.unknowns - count):
        n = m.follows[w.idx[w.unknown[count + a]]]
        if is_dry(m, n):
            load = m.friction[n]
        else:
            b = w.spot[w.listed[n]]
            load = m.friction[n] * w.found[b] / w.size[b] if m.friction[n] < np.inf else w.found[b] / w.size[b]
        w.weight[a] = max(load, 0.0) * w.size[count + a] ** 2
        most = max(most, w.weight[a])
    for a in range(s.unknowns - count):
        w.weight[a] = max(w.weight[a], LIGHT * most) if most > 0.0 else 1.0
