"""Rank that rows which are always on lose along the motion: a loop that folds flat.

There the equations do not determine the motion: which branch a step comes out on is chance. Two triggers tell it. The
least pivot of the rows, in the metric of M^-1, falls below a thousandth of what it was; or the step has passed through
the fold, where with H, M of its start and of its end

    det(H_0 M_0^-1 H_1^T) < 0

since by Cauchy and Binet this is the product of both row volumes, with their signs, for a step that turns the tangent
by less than a right angle.
"""

from __future__ import annotations

from typing import Any

from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import GENERAL, accelerate
from crossbody.reference.core.algebra import factor_lu
from crossbody.reference.core.layout import ILL_POSED, Buffers, Model, Work

FLAT = 1e-3  # part of its value at the start below which a pivot has vanished
LEANING = 0.5  # part of it above which no step can have passed through a fold


@compiled
def _keep_rows(s: Any, m: Model, w: Work) -> None:
    """Remember M^-1 H^T for the step that begins here."""
    for j in range(s.na):
        i = w.idx[j]
        if not m.unilateral[i]:
            for c in range(m.span[i, 0], m.span[i, 1]):
                w.X0[i, c] = w.X[j, c]


@compiled
def begin(K: Any, s: Any, m: Model, w: Work) -> int:
    """Take the pivots and the rows of the present instant as those of the start; 1 if ill posed."""
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[: s.nq], w.y[s.nq :], GENERAL) != 0:
        return 1
    w.pivot0[:] = 0.0  # of rows that are off
    for j in range(s.na):
        w.pivot0[w.idx[j]] = w.G[j, j]
    _keep_rows(s, m, w)
    return 0


@compiled
def _turned_over(s: Any, m: Model, w: Work) -> bool:
    """Whether det(H_0 M_0^-1 H_1^T) of the rows that are always on is negative."""
    a = 0
    for j in range(s.na):
        if m.unilateral[w.idx[j]]:
            continue
        b = 0
        for i in range(s.nc):
            if not m.unilateral[i] and w.pivot0[i] > 0.0:
                total = 0.0
                for c in range(max(m.span[i, 0], m.span[w.idx[j], 0]), min(m.span[i, 1], m.span[w.idx[j], 1])):
                    total += w.H[j, c] * w.X0[i, c]
                w.overlap[a, b] = total
                b += 1
        a += 1
    if factor_lu(w.overlap, a, w.pivot) != 0:
        return True
    sign = 1.0
    for c in range(a):
        if (w.overlap[c, c] < 0.0) != (w.pivot[c] != c):
            sign = -sign
    return bool(sign < 0.0)


@compiled
def passed(s: Any, m: Model, w: Work, b: Buffers) -> int:
    """ILL_POSED if the rows at the step's end, just evaluated, have lost rank on the way; 0 if not.

    The rows that did are marked in the last line of the history, for the message.
    """
    least = 1.0
    marks = b.history[len(b.history) - 1]
    for j in range(s.na):
        i = w.idx[j]
        if not m.unilateral[i]:
            part = w.G[j, j] / w.pivot0[i]
            marks[i] = part < FLAT
            least = min(least, part)
    if least < FLAT or (least < LEANING and _turned_over(s, m, w)):
        for i in range(s.nc):
            marks[i] = m.unilateral[i] == 0 if not least < FLAT else marks[i]
        return ILL_POSED
    _keep_rows(s, m, w)
    return 0
