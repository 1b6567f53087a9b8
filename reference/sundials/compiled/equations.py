"""The reduced equations at one state, compiled, and the implicit ones.

    [ M   -H_A^T ] [ v'  ]   [ f                                          ]
    [ H_A    0   ] [ lam ] = [ -(H_A' v + a1 h' + a0 h + a2 h^3)_A        ]

The whole matrix goes through elimination with partial pivoting; the compiled loop of `reference.core` forms H M^-1 H^T
instead, and shares no function with this package.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.kinds import Floats, Floats2, Index
from crossbody.reference.sundials.compiled.workspace import GOOD, ILL_POSED, NOT_FINITE, Workspace

STIFF = 0.3  # step times damped pole beyond which a step counts as bound by stability


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
def solve(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats, idx: Index, na: int, law: Floats2,
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
def put_on_law(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats) -> int:
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
def accelerate(dynamics: Any, rows: Any, s: Workspace, t: float, q: Floats, v: Floats, by_law: bool) -> int:
    """V' into `solution`, multipliers of all rows into `lam`."""
    code = solve(dynamics, rows, s, t, q, v, s.idx, s.size[4], s.law, -1, by_law)
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
def take(s: Workspace, y: Any) -> None:
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
def derivative(
    dynamics: Any, gaps: Any, rows: Any, power: Any, velocity: Any, s: Workspace, t: float, y: Any, yp: Any
) -> int:
    """Y' of q, v and the work done by rows, by inputs and against damping."""
    n, nc, nz, nq = s.size[0], s.size[1], s.size[3], s.size[7]
    ny = nq + n
    _tick(s, t)
    take(s, y)
    code = accelerate(dynamics, rows, s, t, s.q, s.v, False)
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
def residual(
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
    take(s, y)
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
        accelerate(dynamics, rows, s, t, s.q, s.v, False)  # lam of the state itself
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
