"""The system of rows in contact that stick or slide: what is solved for, and its matrix.

A contact that sticks has its tangential rows among those that are solved. One that slides has

    lam_t = -mu lam_n s,    s = v_t / |v_t|

in the columns, so that with G = H M^-1 H^T of all rows in contact the matrix that is solved,

    A = G - mu (G_.t s) in the column of a sliding normal row

is not symmetric.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.friction import has_friction, is_tangent
from crossbody.reference.core.layout import Model, Work
from crossbody.reference.core.loops import bears_nothing, is_loop


@compiled
def is_out(m: Model, w: Work, j: int) -> bool:
    """Whether the row in place j is one of loops, or one that they hold."""
    return is_loop(m, w.idx[j]) or bears_nothing(m, w, j)


@compiled
def list_unknowns(s: Any, m: Model, w: Work) -> int:
    """List in w.unknown the places that are solved for, sticking tangential rows last; how many are not of those.

    Islands that are calm are left out.
    """
    count = 0
    for j in range(s.na):
        if s.calm and w.calm[j]:
            continue
        if not w.off[w.idx[j]] and not is_tangent(m, w.idx[j]) and not (s.loops and is_out(m, w, j)):
            w.unknown[count], w.spot[j] = j, count
            count += 1
    normals = count
    for j in range(s.na):
        i = w.idx[j]
        if s.calm and w.calm[j]:
            continue
        if not w.off[i] and is_tangent(m, i) and not w.slides[i] and not bears_nothing(m, w, j):
            w.unknown[count] = j
            count += 1
    s.unknowns = count
    return normals


@compiled
def row_size(m: Model, w: Work, j: int) -> float:
    """Size of the row in place j, a tangential one by its normal row: it may be none that anything moves."""
    i = w.idx[j]
    normal = w.listed[m.follows[i]] if is_tangent(m, i) else j
    return float(np.sqrt(max(w.gram[normal, normal], w.gram[j, j])))


@compiled
def fill(s: Any, m: Model, w: Work) -> None:
    """A of the unknowns in w.matrix, scaled by their sizes, which stand in w.size."""
    for a in range(s.unknowns):
        w.size[a] = row_size(m, w, w.unknown[a])
    for b in range(s.unknowns):
        k = w.unknown[b]
        i = w.idx[k]
        sliding = has_friction(m, i) and w.slides[i]
        first = w.listed[m.tangent[i]] if sliding else 0
        for a in range(s.unknowns):
            j = w.unknown[a]
            total = w.gram[j, k]
            if sliding:
                for c in range(first, first + m.tangents[i]):
                    total -= m.friction[i] * w.along[c] * w.gram[j, c]
            w.matrix[a, b] = total / (w.size[a] * w.size[b])
