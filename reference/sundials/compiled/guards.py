"""The guards of a step, compiled: a guard is a conjunction of smooth functions, its terms.

It fires where all of them are at or below zero.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.compiled.equations import accelerate, put_on_law, solve, take
from crossbody.reference.sundials.compiled.workspace import (
    BELOW,
    DEGREE,
    FORCE,
    GAP,
    GOOD,
    NOT_FINITE,
    POINTS,
    PRESS,
    RATE,
    SPENT,
    WATCH,
    Workspace,
)

SPENT_PART = 0.01  # elastic part of lam at which a collision hands over to contact
CONSISTENT = 1e-9  # part of its terms by which a row that depends on others may be off its law
LIFTED = 1e-3  # of a row's time scale, for which one that was lifted off cannot be told from one that is held

_k = np.arange(DEGREE + 1)
NODES = 0.5 - 0.5 * np.cos(np.pi * _k / DEGREE)  # Chebyshev-Lobatto, on the step from 0 to 1
_half = np.where((_k == 0) | (_k == DEGREE), 0.5, 1.0)
TO_SERIES = 2.0 / DEGREE * _half[:, None] * np.cos(np.pi * np.outer(_k, DEGREE - _k) / DEGREE) * _half
DOUBTS = (0.4, 0.6)  # where the quintic is held against the equations; symmetric, so that no parity hides an error
CAUTION = 16.0  # errors along the step in units of those seen at two places


@compiled
def _below_law(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats, i: int) -> float:
    """By how much row i is below its law under the active rows; one that they hold at its law counts as below."""
    na, n, law = s.size[4], s.size[0], s.law_if
    if solve(dynamics, rows, s, t, q, v, s.idx, na, s.law, -1, True) != GOOD:
        return -np.inf
    s.trial[0] = i
    s.H[:1] = 0.0
    rows(t, q, v, s.p, s.w, s.trial, 1, s.H, s.h, s.Hdv)
    push, rate, size, h = 0.0, 0.0, abs(s.Hdv[0]), s.h[0]
    for c in range(n):
        push += s.H[0, c] * s.solution[c, 0]
        size += abs(s.H[0, c] * s.solution[c, 0])
        rate += s.H[0, c] * v[c]
    spring = (law[i, 0] + law[i, 2] * h * h) * h
    size += law[i, 1] * abs(rate) + abs(spring)
    open_for = (t - s.let_go[i]) * max(np.sqrt(law[i, 0]), law[i, 1])
    band = CONSISTENT * size if open_for > LIFTED else -CONSISTENT * size
    return float(band - (push + s.Hdv[0] + law[i, 1] * rate + spring))


@compiled
def _would_press(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats, i: int) -> float:
    """Multiplier of the inactive row i if it were active now; -inf where that is ill posed.

    Of one that depends on the active rows by how much it is below its law.
    """
    na = s.size[4]
    if s.tied[i]:
        return float(_below_law(dynamics, rows, s, t, q, v, i))
    for j in range(na):
        s.trial[j] = s.idx[j]
    s.trial[na] = i
    count = na + 1
    for j in range(s.size[1]):
        if s.follows[j] == i:
            s.trial[count] = j
            count += 1
    if solve(dynamics, rows, s, t, q, v, s.trial, count, s.law_if, -1, True) != GOOD:
        return -np.inf
    return float(s.solution[s.size[0] + na, 0])


@compiled
def _spent(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats, e: int) -> float:
    """One side of the hand-over: +-c h' +- b0 h - eps lam_i / (G^-1)_ii, with c = max(b1, sqrt(b0))."""
    i = s.row[e]
    for j in range(s.size[4]):
        if s.idx[j] == i:
            if solve(dynamics, rows, s, t, q, v, s.idx, s.size[4], s.law, j, False) != GOOD:
                return np.nan
            at = s.size[0] + j
            inertial = s.solution[at, 0] / s.solution[at, 1]
            c = max(s.law[i, 1], np.sqrt(s.law[i, 0]))
            elastic = s.side[e, 0] * c * s.rate[i] + s.side[e, 1] * s.law[i, 0] * s.gap[i]
            return float(elastic - SPENT_PART * inertial)
    return np.nan


@compiled
def copy(x: Floats, y: Floats) -> None:
    """Copy entry by entry: to say why arrays do not fit numba compiles all that strings need."""
    for i in range(len(y)):
        y[i] = x[i]


@compiled
def terms(
    dynamics: Any, gaps: Any, rows: Any, watch: Any, s: Workspace, t: float, q: Floats, v: Floats, out: Any
) -> int:
    """All terms of all guards at one state."""
    gaps(t, q, v, s.p, s.gap, s.rate)
    if len(s.watched) > 0:
        watch(t, q, v, s.p, s.watched)
    known = False
    for e in range(s.size[5]):
        kind = s.kind[e]
        if kind == FORCE and not known:
            copy(q, s.law_q)
            copy(v, s.law_v)
            # Positions that turn stay where they are: the law's own gaps are most of what counts.
            if not s.size[8] and put_on_law(dynamics, rows, s, t, s.law_q, s.law_v) != GOOD:
                return NOT_FINITE
            if accelerate(dynamics, rows, s, t, s.law_q, s.law_v, True) != GOOD:
                return NOT_FINITE
            known = True
        i = s.row[e]
        if kind == GAP:
            value = s.gap[i]
        elif kind == BELOW:
            value = -s.gap[i]
        elif kind == RATE:
            value = s.rate[i]
        elif kind == FORCE:
            value = s.lam[i]
        elif kind == PRESS:
            value = -_would_press(dynamics, rows, s, t, q, v, i)
        elif kind == SPENT:
            value = _spent(dynamics, rows, s, t, q, v, e)
        else:
            value = s.watched[i]
        out[e] = value + s.shift[e]
        if np.isnan(value):
            return NOT_FINITE
    for i in range(s.size[1]):
        if not np.isfinite(s.gap[i]) or not np.isfinite(s.rate[i]):
            return NOT_FINITE
    return GOOD


@compiled
def _hermite(s: Workspace, theta: float, length: float) -> None:
    """Quintic through q, v and v' at both ends of the step, and its derivatives, into q, v and `curve`."""
    n = s.size[0]
    for i in range(n):
        q0, q1 = s.y0[i], s.y1[i]
        v0, v1 = length * s.y0[n + i], length * s.y1[n + i]
        a0, a1 = 0.5 * length * length * s.a0[i], 0.5 * length * length * s.a1[i]
        # In powers of theta, from q0 on: c3, c4, c5 close the other end.
        d, dv, da = q1 - q0 - v0 - a0, v1 - v0 - 2.0 * a0, 2.0 * (a1 - a0)
        c3, c4, c5 = 10.0 * d - 4.0 * dv + 0.5 * da, -15.0 * d + 7.0 * dv - da, 6.0 * d - 3.0 * dv + 0.5 * da
        s.q[i] = q0 + theta * (v0 + theta * (a0 + theta * (c3 + theta * (c4 + theta * c5))))
        slope = v0 + theta * (2.0 * a0 + theta * (3.0 * c3 + theta * (4.0 * c4 + theta * 5.0 * c5)))
        s.v[i] = slope / length
        curve = 2.0 * a0 + theta * (6.0 * c3 + theta * (12.0 * c4 + theta * 20.0 * c5))
        s.curve[i] = curve / (length * length)


@compiled
def _doubt(dynamics: Any, gaps: Any, rows: Any, watch: Any, s: Workspace, t: float) -> int:
    """Terms on the quintic of the step that ends at t, and with its error taken off, at two places.

    What is left out of the quintic is about C r(x), r = (x (1 - x))^3. The equations tell by how much v' is off, which
    is C r''; the same C makes C r of q and C r' of v.
    """
    start, n = s.clock[2], s.size[0]
    length = t - start
    for j in range(2):
        x = DOUBTS[j]
        u, at = x * (1.0 - x), start + x * length
        rest, slope = u**3, 3.0 * u * u * (1.0 - 2.0 * x)
        curvature = 6.0 * u * (1.0 - 2.0 * x) ** 2 - 6.0 * u * u
        _hermite(s, x, length)
        code = terms(dynamics, gaps, rows, watch, s, at, s.q, s.v, s.check[2 + j])
        if code == GOOD:
            code = accelerate(dynamics, rows, s, at, s.q, s.v, False)
        if code != GOOD:
            return int(code)
        for i in range(n):
            size = (s.solution[i, 0] - s.curve[i]) * length * length / curvature
            s.q[i] += size * rest
            s.v[i] += size * slope / length
        code = terms(dynamics, gaps, rows, watch, s, at, s.q, s.v, s.check[j])
        if code != GOOD:
            return int(code)
    return GOOD


@compiled
def _decide(s: Workspace) -> int:
    """Mark the guards that may fire inside the step: none of their terms is positive beyond its error throughout."""
    guards = s.size[6]
    for g in range(guards):
        s.undecided[g] = 1
    for e in range(s.size[5]):
        error, reach, middle, tail = 0.0, 0.0, 0.0, 0.0
        for j in range(2):
            error = max(error, abs(s.check[j, e] - s.check[2 + j, e]))
        for c in range(DEGREE + 1):
            coefficient = 0.0
            for j in range(DEGREE + 1):
                coefficient += TO_SERIES[c, j] * s.values[j, e]
            if c == 0:
                middle = coefficient
            else:
                reach += abs(coefficient)
            if c >= DEGREE - 1:
                tail += abs(coefficient)
        margin = reach + CAUTION * (error + tail)
        if middle > margin or (s.kind[e] == WATCH and middle < -margin):  # one that has fired must rise first
            s.undecided[s.group[e]] = 0
    left = 0
    for g in range(guards):
        left += s.undecided[g]
    return int(left)


@compiled
def carry(dynamics: Any, rows: Any, s: Workspace, t: float, y: Any) -> int:
    """The end of the step becomes the start of the next one."""
    n = s.size[0]
    take(s, y)
    for i in range(s.size[7] + n):
        s.y1[i] = y[i]
    code = accelerate(dynamics, rows, s, t, s.q, s.v, False)
    for i in range(n):
        s.a1[i] = s.solution[i, 0]
    copy(s.lam, s.lam1)
    return int(code)


@compiled
def move_on(s: Workspace, t: float, y: Any) -> None:
    """The last step ends at t; what was its end is its start."""
    s.clock[3], s.clock[2] = s.clock[2], t
    copy(s.y1, s.y0)
    copy(s.a1, s.a0)
    for i in range(len(y)):
        s.ends[0, i], s.ends[1, i] = s.ends[1, i], y[i]


@compiled
def scan(dynamics: Any, gaps: Any, rows: Any, watch: Any, s: Workspace, t: float, y: Any) -> int:
    """Look whether a guard can fire inside the step that ends at t; minus a code, or the number of undecided guards.

    A bound on the terms along the quintic decides, with a margin for its error. Where q' is not v there is no such
    quintic: every guard is undecided.
    """
    start = s.clock[2]
    code = carry(dynamics, rows, s, t, y)
    if s.size[8] and code == GOOD:
        s.undecided[:] = 1
        s.count[4] = s.size[6]
        move_on(s, t, y)
        return int(s.count[4])
    for j in range(DEGREE + 1):
        if code == GOOD:
            _hermite(s, NODES[j], t - start)
            code = terms(dynamics, gaps, rows, watch, s, start + NODES[j] * (t - start), s.q, s.v, s.values[j])
    if code == GOOD:
        code = _doubt(dynamics, gaps, rows, watch, s, t)
    if code != GOOD:
        return int(-code)
    s.count[4] = _decide(s)
    move_on(s, t, y)
    return int(s.count[4])


@compiled
def grid(dynamics: Any, gaps: Any, rows: Any, watch: Any, s: Workspace, t: float, y: Any) -> int:
    """Terms at even places of the step that ends at t, on the quintic, and what its error makes of them."""
    start = s.clock[2]
    code = carry(dynamics, rows, s, t, y)
    for j in range(POINTS):
        if code == GOOD:
            _hermite(s, (j + 0.5) / POINTS, t - start)
            at = start + (j + 0.5) / POINTS * (t - start)
            code = terms(dynamics, gaps, rows, watch, s, at, s.q, s.v, s.grid[j])
    if code == GOOD:
        code = _doubt(dynamics, gaps, rows, watch, s, t)
    move_on(s, t, y)
    return int(code)
