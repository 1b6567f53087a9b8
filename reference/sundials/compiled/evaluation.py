"""The reduced equations and the guards at one state, compiled: called once for every look of a SUNDIALS solver.

    [ M   -H_A^T ] [ v'  ]   [ f                                          ]
    [ H_A    0   ] [ lam ] = [ -(H_A' v + a1 h' + a0 h + a2 h^3)_A        ]

The whole matrix goes through elimination with partial pivoting; the compiled loop of `reference.core` forms H M^-1 H^T
instead, and shares no function with this file. A guard is a conjunction of smooth functions, its terms: it fires where
all of them are at or below zero.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import types

from crossbody.reference import kernels
from crossbody.reference._program import address, at_address, bound
from crossbody.reference.cache import compiled
from crossbody.reference.core.bundles import ADDRESSES, TABLE, bundle_type, opener, table
from crossbody.reference.kinds import Array, Floats, Floats2, Index

if TYPE_CHECKING:
    from crossbody.reference._system import System

# What is asked of `evaluate`.
DERIVATIVE, TERMS, FORCES, BEGIN, SCAN, GRID, WATCHED, RESIDUAL = range(8)


class Kind(IntEnum):
    """What a term of a guard is."""

    GAP = 0
    BELOW = 1
    """The gap's negative."""
    RATE = 2
    FORCE = 3
    """The multiplier of an active row."""
    PRESS = 4
    """Minus the multiplier that an inactive row would have."""
    SPENT = 5
    """One side of the hand-over c |h'| + b0 |h| <= eps lam / (G^-1)_ii of a collision."""
    WATCH = 6
    """A function of the mechanism's `watch`."""


GAP, BELOW, RATE, FORCE, PRESS, SPENT, WATCH = (int(kind) for kind in Kind)
SPENT_PART = 0.01  # elastic part of lam at which a collision hands over to contact
GOOD, ILL_POSED, NOT_FINITE = range(3)
CONSISTENT = 1e-9  # part of its terms by which a row that depends on others may be off its law
LIFTED = 1e-3  # of a row's time scale, for which one that was lifted off cannot be told from one that is held
STIFF = 0.3  # step times damped pole beyond which a step counts as bound by stability

DEGREE = 8
_k = np.arange(DEGREE + 1)
NODES = 0.5 - 0.5 * np.cos(np.pi * _k / DEGREE)  # Chebyshev-Lobatto, on the step from 0 to 1
_half = np.where((_k == 0) | (_k == DEGREE), 0.5, 1.0)
TO_SERIES = 2.0 / DEGREE * _half[:, None] * np.cos(np.pi * np.outer(_k, DEGREE - _k) / DEGREE) * _half
DOUBTS = (0.4, 0.6)  # where the quintic is held against the equations; symmetric, so that no parity hides an error
POINTS = 16  # even places of a step at which a re-check looks
CAUTION = 16.0  # errors along the step in units of those seen at two places


class Workspace:
    """Everything that `evaluate` reads and writes."""

    size: Index  # n, nc, k, nz, na, terms, guards, nq, 1 where q' is not v, and how many rows stand beside the active
    count: Index  # evaluations, steps, steps in a row that stability binds, the most of these, guards undecided
    clock: Floats  # last instant, fastest damped pole, end of the last step and its start
    p: Floats
    u: Floats
    w: Floats
    blocks: Floats2  # (n, k)
    f: Floats
    q: Floats
    v: Floats
    law_q: Floats  # the state put onto the law
    law_v: Floats
    H: Floats2  # (nc, n), compact, as h, Hdv
    h: Floats
    Hdv: Floats
    gap: Floats
    rate: Floats
    lam: Floats  # (nc,) of all rows at the last evaluation
    lam1: Floats  # at the end of the step
    arc: Floats2  # (nc, 3) instant, gap and rate from which an active row has followed its law; instant NaN: unknown
    two: Floats
    matrix: Floats2  # (n + nc, n + nc + 2): the last columns are right-hand sides
    solution: Floats2  # (n + nc, 2)
    slopes: Floats  # derivative of the solver's vector, where it is implicit
    scale: Floats  # (nc,) of the rows' equations there
    rigid: Index  # (nc,) place of a row's second multiplier there, -1 for a row held by its law
    law: Floats2  # (nc, 3) in force
    law_if: Floats2  # the same, with every inactive row as it would be
    idx: Index  # the active rows; behind them those that share their load, and depend on them
    trial: Index
    let_go: Floats  # (nc,) instant at which others lifted a row off that shared a load with them
    tied: Index  # 1 for open rows that depend on the active ones
    depends: Floats2  # (n + nc, nc) how a row beside the active ones depends on these, below n zeros; a column a row
    share: Floats2  # (nc, 1) multipliers of the rows beside
    follows: Index
    watched: Floats  # (guards of the mechanism,)
    kind: Index  # of every term
    row: Index
    side: Floats2  # (terms, 2) signs of h' and h on one side of the hand-over
    shift: Floats
    group: Index  # the guard that a term belongs to
    values: Floats2  # (nodes, terms)
    check: Floats2  # (4, terms) at two places, without the quintic's error and with it
    grid: Floats2  # (POINTS, terms)
    ends: Floats2  # (2, of the solver's vector) the last step's start and end
    y0: Floats  # (nq + n,) start of the step
    y1: Floats
    qd: Floats  # (nq,) q'
    curve: Floats  # (n,) v' of the quintic
    a0: Floats  # (n,)
    a1: Floats
    undecided: Index  # (guards,) whether a guard may fire inside the step


WORKSPACE = bundle_type(Workspace)
open_work = opener(WORKSPACE)


@compiled
def _eliminate(A: Floats2, x: Floats2, size: int, sides: int) -> int:
    """Solve A[:, :size] x = A[:, size:] by Gaussian elimination with partial pivoting; zeros are passed over."""
    end = size + sides
    for c in range(size):
        best, at = abs(A[c, c]), c
        for r in range(c + 1, size):
            if abs(A[r, c]) > best:
                best, at = abs(A[r, c]), r
        if best == 0.0:
            return 1
        if at != c:
            for j in range(c, end):
                A[c, j], A[at, j] = A[at, j], A[c, j]
        inverse = 1.0 / A[c, c]
        for r in range(c + 1, size):
            factor = A[r, c] * inverse
            if factor != 0.0:
                for j in range(c + 1, end):
                    A[r, j] -= factor * A[c, j]
    for side in range(sides):
        for c in range(size - 1, -1, -1):
            total = A[c, size + side]
            for j in range(c + 1, size):
                total -= A[c, j] * x[j, side]
            x[c, side] = total / A[c, c]
    return 0


@compiled
def linear_arc(a0: float, a1: float, h: float, rate: float, t: float) -> tuple[float, float]:
    """Gap and rate after time t of h'' + a1 h' + a0 h = 0.

    h e^{p1 t} + (h' - p1 h) (e^{p1 t} - e^{p2 t}) / (p1 - p2); near equal poles the quotient by its series.
    """
    half = 0.5 * a1
    root = np.sqrt(complex(half * half - a0))
    p2 = -(half + root)
    p1 = a0 / p2 if p2 != 0.0 else p2  # without cancellation
    e1, e2, x = np.exp(p1 * t), np.exp(p2 * t), root * t
    if abs(x) < 1e-2:
        divided = t * np.exp(-half * t) * (1.0 + x * x / 6.0 * (1.0 + x * x / 20.0 * (1.0 + x * x / 42.0)))
    else:
        divided = (e1 - e2) / (p1 - p2)
    c = rate - p1 * h
    return float((h * e1 + c * divided).real), float((p1 * h * e1 + c * (e1 + p2 * divided)).real)


@compiled
def _assemble(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats, idx: Index, na: int) -> None:
    """The matrix of M and of the rows in idx, and zero right-hand sides; f, H, h, Hdv as the kernels leave them."""
    n, k, A = s.size[0], s.size[2], s.matrix
    s.count[0] += 1
    dynamics(t, q, v, s.u, s.p, s.blocks, s.f, s.w)
    A[: n + na, : n + na + 2] = 0.0
    for i in range(n):
        first = i // k * k
        for j in range(k):
            A[i, first + j] = s.blocks[i, j]
    if na > 0:
        s.H[:na] = 0.0  # kernels need not write the zeros
        rows(t, q, v, s.p, s.w, idx, na, s.H, s.h, s.Hdv)
    for j in range(na):
        for c in range(n):
            A[n + j, c] = s.H[j, c]
            A[c, n + j] = -s.H[j, c]


@compiled
def _by_law(s: Workspace, law: Floats2, i: int, t: float) -> tuple[float, float]:
    """Gap and rate of a row that has followed its linear law since a known instant."""
    h, rate = linear_arc(law[i, 0], law[i, 1], s.arc[i, 1], s.arc[i, 2], t - s.arc[i, 0])
    return h, rate


@compiled
def _solve(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats, idx: Index, na: int, law: Floats2,
           unit: int, by_law: bool) -> int:  # fmt: skip
    """V' and lam of the rows in idx into `solution`; with unit >= 0 the response to that row alone beside it.

    With `by_law` the gaps of rows that have followed a linear law since a known instant are those of the law.
    """
    n, A = s.size[0], s.matrix
    size = n + na
    _assemble(dynamics, rows, s, t, q, v, idx, na)
    for i in range(n):
        A[i, size] = s.f[i]
    for j in range(na):
        rate = 0.0
        for c in range(n):
            rate += s.H[j, c] * v[c]
        h, i = s.h[j], idx[j]
        if by_law and not np.isnan(s.arc[i, 0]):
            h, rate = _by_law(s, law, i, t)
        A[n + j, size] = -(s.Hdv[j] + law[i, 1] * rate + (law[i, 0] + law[i, 2] * h * h) * h)
    if unit >= 0:
        A[n + unit, size + 1] = 1.0
    total = 0.0
    for i in range(size):
        for j in range(size + 1):
            total += A[i, j]
    if _eliminate(A, s.solution, size, 2 if unit >= 0 else 1) != 0:
        return ILL_POSED if np.isfinite(total) else NOT_FINITE
    for i in range(size):
        if not np.isfinite(s.solution[i, 0]):
            return ILL_POSED if np.isfinite(total) else NOT_FINITE
    return GOOD


@compiled
def _put_on_law(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats) -> int:
    """Move q and v by one Newton step to where linear laws have the active rows' gaps: the least change in M's norm.

    What is left is of the second order in the solver's error.
    """
    n, na, A = s.size[0], s.size[4], s.matrix
    _assemble(dynamics, rows, s, t, q, v, s.idx, na)
    for j in range(na):
        i = s.idx[j]
        if np.isnan(s.arc[i, 0]):
            continue
        h, rate = _by_law(s, s.law, i, t)
        A[n + j, n + na] = h - s.h[j] if s.law[i, 0] > 0.0 else 0.0  # a law of rates knows no gap
        A[n + j, n + na + 1] = rate
        for c in range(n):
            A[n + j, n + na + 1] -= s.H[j, c] * v[c]
    if _eliminate(A, s.solution, n + na, 2) != 0:
        return ILL_POSED
    for i in range(n):
        q[i] += s.solution[i, 0]
        v[i] += s.solution[i, 1]
    return GOOD


@compiled
def _share(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats) -> int:
    """Let the rows beside the active ones bear their share of `lam`: the least multipliers that exert the same forces.

    A row beside is H_d = C H_A: M x - H_A^T C^T = -H_d^T, H_A x = 0 has x = 0. Then lam_d = (1 + C C^T)^-1 C lam_A, and
    lam_A less C^T lam_d. C turns with the configuration.
    """
    n, na, beside, A, C = s.size[0], s.size[4], s.size[9], s.matrix, s.depends
    _assemble(dynamics, rows, s, t, q, v, s.idx[na:], beside)
    for d in range(beside):
        for c in range(n):
            C[c, d] = -s.H[d, c]
    _assemble(dynamics, rows, s, t, q, v, s.idx, na)
    for d in range(beside):
        for c in range(n + na):
            A[c, n + na + d] = C[c, d] if c < n else 0.0
    if _eliminate(A, C, n + na, beside) != 0:
        return ILL_POSED
    for d in range(beside):
        A[d, beside] = 0.0
        for e in range(beside):
            A[d, e] = 1.0 if d == e else 0.0
        for j in range(n, n + na):
            A[d, beside] += C[j, d] * s.lam[s.idx[j - n]]
            for e in range(beside):
                A[d, e] += C[j, d] * C[j, e]
    if _eliminate(A, s.share, beside, 1) != 0:
        return ILL_POSED
    for d in range(beside):
        s.lam[s.idx[na + d]] = s.share[d, 0]
        for j in range(na):
            s.lam[s.idx[j]] -= C[n + j, d] * s.share[d, 0]
    return GOOD


@compiled
def _accelerate(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats, by_law: bool) -> int:
    """V' into `solution`, multipliers of all rows into `lam`."""
    code = _solve(dynamics, rows, s, t, q, v, s.idx, s.size[4], s.law, -1, by_law)
    s.lam[:] = 0.0
    for j in range(s.size[4]):
        s.lam[s.idx[j]] = s.solution[s.size[0] + j, 0]
    if s.size[9] and code == GOOD:
        code = _share(dynamics, rows, s, t, q, v)
    return int(code)


@compiled
def _tick(s: Workspace, t: float) -> None:
    """Count a step tried, and how many of them in a row stability binds."""
    if t != s.clock[0]:
        s.count[1] += 1
        s.count[2] = s.count[2] + 1 if (t - s.clock[0]) * s.clock[1] > STIFF else 0
        s.clock[0] = t


@compiled
def _take(s: Workspace, y: Any) -> None:
    """Q and v of the solver's vector."""
    nq = s.size[7]
    for i in range(nq):
        s.q[i] = y[i]
    for i in range(s.size[0]):
        s.v[i] = y[nq + i]


@compiled
def _rates(velocity: Any, s: Workspace, t: float) -> None:
    """Q' at the state taken."""
    if s.size[8]:
        velocity(t, s.q, s.v, s.p, s.qd)
    else:
        for i in range(s.size[0]):
            s.qd[i] = s.v[i]


@compiled
def _derivative(
    dynamics: Any, gaps: Any, rows: Any, power: Any, velocity: Any, s: Workspace, t: float, y: Any, yp: Any
) -> int:
    """Y' of q, v and the work done by rows, by inputs and against damping."""
    n, nc, nz, nq = s.size[0], s.size[1], s.size[3], s.size[7]
    ny = nq + n
    _tick(s, t)
    _take(s, y)
    code = _accelerate(dynamics, rows, s, t, s.q, s.v, False)
    _rates(velocity, s, t)
    for i in range(nq):
        yp[i] = s.qd[i]
    for i in range(n):
        yp[nq + i] = s.solution[i, 0]
    if code == GOOD and nz > 0:
        gaps(t, s.q, s.v, s.p, s.gap, s.rate)
        power(t, s.q, s.v, s.u, s.p, s.two)
        for i in range(nc):
            yp[ny + i] = s.lam[i] * s.rate[i]
        yp[ny + nc], yp[ny + nc + 1] = s.two[0], s.two[1]
        for i in range(ny, ny + nz):
            if not np.isfinite(yp[i]):
                return NOT_FINITE
    return int(code)


@compiled
def _residual(
    dynamics: Any, gaps: Any, rows: Any, power: Any, velocity: Any, s: Workspace, t: float, y: Any, out: Any
) -> int:
    """The implicit equations of (q, v, lam, mu, z), with the derivative in `slopes`; all rows of `lam`.

    M v' = f + H^T lam, and of every active row H M^-1 (f + H^T lam) + H' v + a1 h' + a0 h + a2 h^3 = 0: with v' of the
    solver in its place, the rounding of a difference over a short step would stand in the multiplier.
    """
    n, nc, k, nz, na, A = s.size[0], s.size[1], s.size[2], s.size[3], s.size[4], s.matrix
    nq = s.size[7]
    ny = nq + n
    mu = ny + nc
    _tick(s, t)
    _take(s, y)
    _rates(velocity, s, t)
    s.count[0] += 1
    dynamics(t, s.q, s.v, s.u, s.p, s.blocks, s.f, s.w)
    s.H[:na] = 0.0
    if na > 0:
        rows(t, s.q, s.v, s.p, s.w, s.idx, na, s.H, s.h, s.Hdv)
    A[:n, : n + 1] = 0.0
    for i in range(nq):
        out[i] = s.slopes[i] - s.qd[i]
    for i in range(n):
        first = i // k * k
        out[nq + i], A[i, n] = 0.0, s.f[i]
        for j in range(k):
            A[i, first + j] = s.blocks[i, j]
            out[nq + i] += s.blocks[i, j] * s.slopes[nq + first + j]
        for j in range(na):
            A[i, n] += s.H[j, i] * y[ny + s.idx[j]]
        out[nq + i] -= A[i, n]
    if na > 0 and _eliminate(A, s.solution, n, 1) != 0:
        return ILL_POSED
    for i in range(ny, mu):
        out[i] = y[i]
    for j in range(na):
        i = s.idx[j]
        rate, push, h = 0.0, 0.0, s.h[j]
        for c in range(n):
            rate += s.H[j, c] * s.v[c]
            push += s.H[j, c] * s.solution[c, 0]
        drive = s.law[i, 1] * rate + (s.law[i, 0] + s.law[i, 2] * h * h) * h
        out[ny + i] = (push + s.Hdv[j] + drive) * s.scale[i]
        if s.rigid[i] >= 0:
            out[ny + i], out[mu + s.rigid[i]] = h, rate
            for c in range(n):
                out[c] -= s.H[j, c] * y[mu + s.rigid[i]]
    if nz > 0:
        _accelerate(dynamics, rows, s, t, s.q, s.v, False)  # lam of the state itself
        gaps(t, s.q, s.v, s.p, s.gap, s.rate)
        power(t, s.q, s.v, s.u, s.p, s.two)
        at = len(y) - nz
        for i in range(nc):
            out[at + i] = s.slopes[at + i] - s.lam[i] * s.rate[i]
        for i in range(2):
            out[at + nc + i] = s.slopes[at + nc + i] - s.two[i]
    for i in range(len(y)):
        if not np.isfinite(out[i]):
            return NOT_FINITE
    return GOOD


@compiled
def _below_law(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats, i: int) -> float:
    """By how much row i is below its law under the active rows; one that they hold at its law counts as below."""
    na, n, law = s.size[4], s.size[0], s.law_if
    if _solve(dynamics, rows, s, t, q, v, s.idx, na, s.law, -1, True) != GOOD:
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
    if _solve(dynamics, rows, s, t, q, v, s.trial, count, s.law_if, -1, True) != GOOD:
        return -np.inf
    return float(s.solution[s.size[0] + na, 0])


@compiled
def _spent(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats, e: int) -> float:
    """One side of the hand-over: +-c h' +- b0 h - eps lam_i / (G^-1)_ii, with c = max(b1, sqrt(b0))."""
    i = s.row[e]
    for j in range(s.size[4]):
        if s.idx[j] == i:
            if _solve(dynamics, rows, s, t, q, v, s.idx, s.size[4], s.law, j, False) != GOOD:
                return np.nan
            at = s.size[0] + j
            inertial = s.solution[at, 0] / s.solution[at, 1]
            c = max(s.law[i, 1], np.sqrt(s.law[i, 0]))
            elastic = s.side[e, 0] * c * s.rate[i] + s.side[e, 1] * s.law[i, 0] * s.gap[i]
            return float(elastic - SPENT_PART * inertial)
    return np.nan


@compiled
def _copy(x: Floats, y: Floats) -> None:
    """Copy entry by entry: to say why arrays do not fit numba compiles all that strings need."""
    for i in range(len(y)):
        y[i] = x[i]


@compiled
def _terms(
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
            _copy(q, s.law_q)
            _copy(v, s.law_v)
            # Positions that turn stay where they are: the law's own gaps are most of what counts.
            if not s.size[8] and _put_on_law(dynamics, rows, s, t, s.law_q, s.law_v) != GOOD:
                return NOT_FINITE
            if _accelerate(dynamics, rows, s, t, s.law_q, s.law_v, True) != GOOD:
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
        code = _terms(dynamics, gaps, rows, watch, s, at, s.q, s.v, s.check[2 + j])
        if code == GOOD:
            code = _accelerate(dynamics, rows, s, at, s.q, s.v, False)
        if code != GOOD:
            return int(code)
        for i in range(n):
            size = (s.solution[i, 0] - s.curve[i]) * length * length / curvature
            s.q[i] += size * rest
            s.v[i] += size * slope / length
        code = _terms(dynamics, gaps, rows, watch, s, at, s.q, s.v, s.check[j])
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
def _carry(dynamics: Any, rows: Any, s: Workspace, t: float, y: Any) -> int:
    """The end of the step becomes the start of the next one."""
    n = s.size[0]
    _take(s, y)
    for i in range(s.size[7] + n):
        s.y1[i] = y[i]
    code = _accelerate(dynamics, rows, s, t, s.q, s.v, False)
    for i in range(n):
        s.a1[i] = s.solution[i, 0]
    _copy(s.lam, s.lam1)
    return int(code)


@compiled
def _move_on(s: Workspace, t: float, y: Any) -> None:
    """The last step ends at t; what was its end is its start."""
    s.clock[3], s.clock[2] = s.clock[2], t
    _copy(s.y1, s.y0)
    _copy(s.a1, s.a0)
    for i in range(len(y)):
        s.ends[0, i], s.ends[1, i] = s.ends[1, i], y[i]


@compiled
def _scan(dynamics: Any, gaps: Any, rows: Any, watch: Any, s: Workspace, t: float, y: Any) -> int:
    """Look whether a guard can fire inside the step that ends at t; minus a code, or the number of undecided guards.

    A bound on the terms along the quintic decides, with a margin for its error. Where q' is not v there is no such
    quintic: every guard is undecided.
    """
    start = s.clock[2]
    code = _carry(dynamics, rows, s, t, y)
    if s.size[8] and code == GOOD:
        s.undecided[:] = 1
        s.count[4] = s.size[6]
        _move_on(s, t, y)
        return int(s.count[4])
    for j in range(DEGREE + 1):
        if code == GOOD:
            _hermite(s, NODES[j], t - start)
            code = _terms(dynamics, gaps, rows, watch, s, start + NODES[j] * (t - start), s.q, s.v, s.values[j])
    if code == GOOD:
        code = _doubt(dynamics, gaps, rows, watch, s, t)
    if code != GOOD:
        return int(-code)
    s.count[4] = _decide(s)
    _move_on(s, t, y)
    return int(s.count[4])


@compiled
def _grid(dynamics: Any, gaps: Any, rows: Any, watch: Any, s: Workspace, t: float, y: Any) -> int:
    """Terms at even places of the step that ends at t, on the quintic, and what its error makes of them."""
    start = s.clock[2]
    code = _carry(dynamics, rows, s, t, y)
    for j in range(POINTS):
        if code == GOOD:
            _hermite(s, (j + 0.5) / POINTS, t - start)
            at = start + (j + 0.5) / POINTS * (t - start)
            code = _terms(dynamics, gaps, rows, watch, s, at, s.q, s.v, s.grid[j])
    if code == GOOD:
        code = _doubt(dynamics, gaps, rows, watch, s, t)
    _move_on(s, t, y)
    return int(code)


def evaluate(
    dynamics: Any, gaps: Any, rows: Any, power: Any, velocity: Any, watch: Any,
    what: int, t: float, y: Floats, out: Floats, lines: Any,
) -> int:  # fmt: skip
    """Do what is asked at (t, y); GOOD or what went wrong, except for SCAN, as `_scan`.

    DERIVATIVE: y' into out. TERMS: all terms into out. FORCES: the multipliers. BEGIN: a step begins here. SCAN, GRID:
    a step ends here. WATCHED: as SCAN, unless it is looked at again; out[0] is 0 where the solver is to stop, else 1.
    RESIDUAL: of the implicit equations into out, with the derivative in `slopes`.
    """
    s = open_work(lines)
    if what == DERIVATIVE:
        return int(_derivative(dynamics, gaps, rows, power, velocity, s, t, y, out))
    if what == TERMS:
        _take(s, y)
        return int(_terms(dynamics, gaps, rows, watch, s, t, s.q, s.v, out))
    if what == FORCES:
        _take(s, y)
        return int(_accelerate(dynamics, rows, s, t, s.q, s.v, False))
    if what == BEGIN:
        code = _carry(dynamics, rows, s, t, y)
        _move_on(s, t, y)
        return int(code)
    if what == GRID:
        return int(_grid(dynamics, gaps, rows, watch, s, t, y))
    if what == RESIDUAL:
        return int(_residual(dynamics, gaps, rows, power, velocity, s, t, y, out))
    if what == WATCHED:
        out[0] = 1.0
        if t <= s.clock[2]:  # the solver looks back
            return GOOD
        left = _scan(dynamics, gaps, rows, watch, s, t, y)
        if left > 0 or s.count[2] >= s.count[3]:
            out[0] = 0.0
        return int(min(left, 0))
    return int(_scan(dynamics, gaps, rows, watch, s, t, y))


_USED = ("dynamics", "gaps", "rows", "power", "velocity", "watch")
_ARGUMENTS = (
    types.int64, types.float64, types.Array(types.float64, 1, "C", readonly=True), types.float64[::1], TABLE,
)  # fmt: skip


dynamics_at, gaps_at, rows_at, power_at, velocity_at, watch_at = (at_address(kernels.REAL[name]) for name in _USED)
SIGNATURE = types.int64(*(kernels.function_type(name) for name in _USED), *_ARGUMENTS)
evaluate_at = at_address(SIGNATURE)


def _evaluate_at(at, what, t, y, out, lines):  # type: ignore[no-untyped-def]
    call = evaluate_at(at[6])
    return call(
        dynamics_at(at[0]), gaps_at(at[1]), rows_at(at[2]), power_at(at[3]), velocity_at(at[4]), watch_at(at[5]),
        what, t, y, out, lines,
    )  # fmt: skip


@cache
def compile_equations() -> tuple[Any, int]:
    """`evaluate` as it is called from Python, and where it stands."""
    call = compiled(_evaluate_at, [types.int64(ADDRESSES, *_ARGUMENTS)])
    return call, address(compiled(evaluate, [SIGNATURE]), SIGNATURE)


def entry(system: System) -> Callable[..., int]:
    """The compiled `evaluate(what, t, y, out, lines)` of one system."""
    call, program = compile_equations()
    return bound(call, _USED, [system.kernels[name] for name in _USED], program)


def workspace(system: System, p: Floats, u: Floats, terms: int, nz: int) -> tuple[dict[str, Array], Array]:
    """Arrays of `Workspace` by name, and the table that compiled code reads them by.

    Args:
        system: the mechanism.
        p: parameters in force, shared and not copied.
        u: inputs in force, likewise.
        terms: largest number of terms of its guards.
        nz: accounts of work.
    """
    n, nq, nc, all_ = system.n, system.nq, system.nc, system.n + system.nc
    ny = nq + n
    shapes: dict[str, tuple[int, ...]] = {
        "size": (10,), "count": (5,), "clock": (4,), "w": (system.scratch,), "blocks": (n, system.mass_block),
        "depends": (all_, nc), "share": (nc, 1),
        **dict.fromkeys(("q", "qd", "law_q"), (nq,)), **dict.fromkeys(("f", "v", "law_v", "a0", "a1", "curve"), (n,)),
        "H": (nc, n), "two": (2,), "matrix": (all_, all_ + 2), "solution": (all_, 2), "law": (nc, 3),
        "law_if": (nc, 3), "arc": (nc, 3), "trial": (nc + 1,), "slopes": (ny + 2 * nc + nz,),
        "watched": (system.guards if system.watch is not None else 0,),
        **dict.fromkeys(("kind", "row", "shift", "group", "undecided"), (terms,)), "side": (terms, 2),
        "values": (DEGREE + 1, terms), "check": (4, terms), "grid": (POINTS, terms),
        "y0": (ny,), "y1": (ny,), "ends": (2, ny + 2 * nc + nz),
    }  # fmt: skip
    kinds = {"Index": np.int64}
    arrays = {
        name: np.zeros(shapes.get(name, (nc,)), dtype=kinds.get(kind, np.float64))
        for name, kind in Workspace.__annotations__.items()
    }
    arrays["p"], arrays["u"] = p, u
    arrays["follows"][:] = system.follows
    arrays["arc"][:, 0], arrays["let_go"][:] = np.nan, -np.inf
    arrays["size"][:4] = n, nc, system.mass_block, nz
    arrays["size"][7:9] = nq, system.velocity is not None
    return arrays, table([*arrays.values()])
