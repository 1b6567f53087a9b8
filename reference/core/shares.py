"""Multipliers of rows that depend on each other: a box that lies flat on a floor on its four corners.

Their forces and the motion are determined as long as the rows do not contradict each other, their multipliers are not:
of all that exert the same forces those of least norm are taken, so that no row is preferred by its place in the list.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.algebra import ULP, solve_schur
from crossbody.reference.core.layout import Work
from crossbody.reference.kinds import Array

LENIENT = 4.0  # times what is allowed, within a step: one that finds more is taken anew, a quarter as long
CONSISTENT = 1e-9  # part of its terms by which a row that depends on others may be off its law, and at least rtol
STATE = 64.0 * ULP  # part of the coordinates that rounding moves a gap by


@compiled
def allow(s: Any, w: Work, q: Array, v: Array) -> None:
    """Leave in w.allowed by how much each active row may be off its law."""
    position, speed = 0.0, 0.0
    for a in range(len(q)):
        position = max(position, abs(q[a]))
    for a in range(len(v)):
        speed = max(speed, abs(v[a]))
    part = max(CONSISTENT, s.rtol)
    for j in range(s.na):
        i = w.idx[j]
        w.allowed[j] = part * w.scale[j] + STATE * (w.law[i, 0] * position + w.law[i, 1] * speed)


@compiled
def _null_vector(s: Any, w: Work, d: int, z: Array) -> float:
    """Z = e_d - c with row d = sum of c_j times row j; by how many times what is allowed their laws contradict it."""
    G = w.G
    for j in range(s.na):
        z[j] = -G[d, j] if w.reach[d] <= j < d else 0.0
    z[d] = 1.0
    for j in range(d - 1, -1, -1):
        z[j] /= G[j, j]
        for b in range(w.reach[j], j):
            z[b] -= G[j, b] * z[j]
    total, most = 0.0, 0.0
    for j in range(d + 1):
        total += z[j] * w.r[j]
        most += abs(z[j]) * w.allowed[j]
    return float(abs(total) / most) if total != 0.0 else 0.0


@compiled
def _without(na: int, x: Array, z: Array) -> None:
    """Take from x its part along the unit vector z."""
    along = 0.0
    for j in range(na):
        along += x[j] * z[j]
    for j in range(na):
        x[j] -= along * z[j]


@compiled
def solve_dependent(s: Any, w: Work, q: Array, v: Array) -> bool:
    """Fill la of least norm from r and the factor of rows that depend on each other; False if these contradict.

    They may by s.lenient times what is allowed; s.contradiction has by how many. By as much as they do not agree each
    is off its law: rows that depend on others in one order, and not in another, would else move the rest by that, and
    rows which nothing presses would join and let go for ever.
    """
    na = s.na
    allow(s, w, q, v)
    count = 0
    for d in range(na):
        if w.G[d, d] < np.inf:
            continue
        z = w.null[count]
        s.contradiction = max(s.contradiction, _null_vector(s, w, d, z))
        if not s.contradiction <= s.lenient:
            return False
        for known in range(count):
            _without(na, z, w.null[known])
        size2 = 0.0
        for j in range(na):
            size2 += z[j] * z[j]
        for j in range(na):
            z[j] /= np.sqrt(size2)
        _without(na, w.r, z)
        count += 1
    solve_schur(w.G, na, w.reach, w.r, w.la)
    for known in range(count):
        _without(na, w.la, w.null[known])
    return True
