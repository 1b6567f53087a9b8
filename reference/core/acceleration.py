"""Acceleration and multipliers: the right-hand side of the reduced model (docs/explanation/model.md).

    (H_A M^-1 H_A^T) lam_A = -( H_A M^-1 f + H_A' v + a1 h' + a0 h + a2 h^3 )_A
    v' = M^-1 ( f + H_A^T lam_A )

Only active rows are evaluated and solved. Where some depend on each other the multipliers are those of `shares`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.algebra import copy, factor_mass, factor_schur, solve_columns, solve_mass, solve_schur
from crossbody.reference.core.friction import FACTOR, NOTHING, SOLVE, ask, enter
from crossbody.reference.core.layout import BILATERAL, COLLISION, CONTACT, Model, Work
from crossbody.reference.core.shares import solve_dependent
from crossbody.reference.kinds import Array, Bytes, Floats

# numba compiles a function anew for every literal that it is called with; numpy's integers are values, not literals.
OWN, GENERAL, SMOOTH = np.arange(3)
AT_ONCE = 4  # rows on a mass matrix of one block from which on all are solved at once


@compiled
def is_active(mode: int) -> bool:
    """Rows that are in contact, however, or always on carry a multiplier."""
    return bool(mode in (CONTACT, COLLISION) or mode >= BILATERAL)  # STICK and SLIP stand behind it


@compiled
def law_of(m: Model, mode: Bytes, i: int) -> tuple[float, float, float]:
    """a0, a1, a2 of row i: the fast constants in COLLISION if it has any (one that follows may not), else the slow."""
    if mode[i] == COLLISION and (m.beta[i, 0] > 0.0 or m.beta[i, 1] > 0.0):
        return m.beta[i, 0], m.beta[i, 1], m.beta[i, 2]
    return m.alpha[i, 0], m.alpha[i, 1], m.alpha[i, 2]


@compiled
def laws_in_force(s: Any, m: Model, w: Work, mode: Bytes) -> None:
    """Write the constants of every row, by its mode. Nothing else may write them.

    Frozen collisions take no time, so that the slow ones are in force throughout.
    """
    if s.frozen and s.have_laws:
        return
    s.have_laws = 1
    for i in range(s.nc):
        w.law[i, 0], w.law[i, 1], w.law[i, 2] = law_of(m, mode, i)
    if s.frictional:
        enter(s, m, w, mode)


@compiled
def clear(m: Model, w: Work, j: int) -> None:
    """Zero row j of H, so that kernels need not write its zeros."""
    i = w.idx[j]
    for c in range(m.span[i, 0], m.span[i, 1]):
        w.H[j, c] = 0.0


@compiled
def add_row(m: Model, w: Work, j: int, i: int) -> None:
    """Put row i in place j, j rising from 0, and find where its band of the Schur complement begins."""
    w.idx[j] = i
    clear(m, w, j)
    first, last = m.span[i, 0], m.span[i, 1]
    w.reach[j] = j
    b = j - 1
    while b >= 0 and w.ends[b] > first:
        if m.span[w.idx[b], 0] < last and m.span[w.idx[b], 1] > first:
            w.reach[j] = b
        b -= 1
    w.ends[j] = max(last, w.ends[j - 1]) if j > 0 else last


@compiled
def activate(s: Any, m: Model, w: Work, mode: Bytes) -> None:
    """List the active rows and put their constants in force; a row that follows another shares its mode.

    Rows that the others hold are not among them.
    """
    na, idle = 0, 0
    follows, order, idle_rows, sharing = m.follows, w.order, w.idle_rows, s.sharing
    for k in range(s.nc):
        i = order[k] if sharing else k
        if follows[i] >= 0:
            mode[i] = mode[follows[i]]
        if is_active(mode[i]):
            if idle_rows[i]:
                idle += 1
            else:
                add_row(m, w, na, i)
                na += 1
    laws_in_force(s, m, w, mode)
    s.na, s.idle, s.dependent = na, idle, 0


@compiled
def scatter(s: Any, w: Work, lam: Array) -> None:
    """Lam of all rows from lam of the active ones."""
    la, idx = w.la, w.idx
    for i in range(s.nc):
        lam[i] = 0.0
    for j in range(s.na):
        lam[idx[j]] = la[j]


@compiled
def free(dynamics: Any, s: Any, m: Model, w: Work, t: float, q: Array, v: Array) -> int:
    """Vd = M^-1 f; leaves the factor of M. In an affine scene it is worked out once for every set of inputs."""
    if s.have_free:
        copy(w.free, w.vd)
        return 0
    dynamics(t, q, v, w.u, m.p, w.M, w.f, w.w)
    if not (s.constant_mass and s.have_mass):
        if factor_mass(w.M, w.L, m.above, s.n, s.k) != 0:
            return 1
        s.have_mass = 1
    for i in range(s.n):
        w.vd[i] = w.f[i]
    solve_mass(w.L, w.vd, m.above, s.k, 0, s.n)
    if s.affine:
        s.have_free = 1
        copy(w.vd, w.free)
    return 0


@compiled
def _rate_and_drive(s: Any, m: Model, w: Work, on: float, j: int, v: Array) -> None:
    """Rate h' of active row j, and the right-hand side of its multiplier with the size of its terms."""
    i = w.idx[j]
    rate, push = 0.0, 0.0
    for c in range(m.span[i, 0], m.span[i, 1]):
        rate += w.H[j, c] * v[c]
        push += w.H[j, c] * w.vd[c]
    h, law = w.ha[j], w.law
    damping, spring = on * law[i, 1] * rate, on * (law[i, 0] + law[i, 2] * h * h) * h
    w.hda[j] = rate
    w.r[j] = -(push + w.Hdv[j] + damping + spring)
    w.scale[j] = abs(push) + abs(w.Hdv[j]) + abs(damping) + abs(spring)


@compiled
def push_of(s: Any, m: Model, w: Work, j: int) -> None:
    """Row j of M^-1 H^T."""
    first, last = m.span[w.idx[j], 0], m.span[w.idx[j], 1]
    for c in range(first, last):
        w.X[j, c] = w.H[j, c]
    solve_mass(w.L, w.X[j], m.above, s.k, first, last)


@compiled
def entry_of(m: Model, w: Work, j: int, b: int) -> float:
    """Entry of H M^-1 H^T of rows j, of which that of M^-1 H^T is known, and b."""
    total, i, k = 0.0, w.idx[j], w.idx[b]
    for c in range(max(m.span[i, 0], m.span[k, 0]), min(m.span[i, 1], m.span[k, 1])):
        total += w.X[j, c] * w.H[b, c]
    return float(total)


@compiled
def _schur_row(s: Any, m: Model, w: Work, j: int) -> None:
    """Row j of M^-1 H^T and of G, as far as its band goes."""
    push_of(s, m, w, j)
    for b in range(w.reach[j], j + 1):
        w.G[j, b] = entry_of(m, w, j, b)


@compiled
def _schur_at_once(s: Any, m: Model, w: Work) -> None:
    """Fill M^-1 H^T and G of all rows, to the same digits as `_schur_row`: every entry is summed in the same order.

    Of each coordinate the entries of all rows stand side by side, so that one vector operation takes several.
    """
    na, right, solved, G = s.na, w.right, w.solved, w.G
    for j in range(na):
        first, last = m.span[w.idx[j], 0], m.span[w.idx[j], 1]
        for c in range(s.n):
            right[c, j] = w.H[j, c] if first <= c < last else 0.0
            solved[c, j] = right[c, j]
    solve_columns(w.L, solved, m.above, 0, 0, s.n, na)
    for j in range(na):
        for b in range(j + 1):
            G[j, b] = 0.0
        for c in range(s.n):
            part = solved[c, j]
            w.X[j, c] = part
            for b in range(j + 1):
                G[j, b] += part * right[c, b]


@compiled
def assemble(rows: Any, s: Any, m: Model, w: Work, on: float, t: float, q: Array, v: Array) -> int:
    """Evaluate the active rows, their law on (1) or off (0), and factor their Schur complement G = H M^-1 H^T.

    Returns:
        1 if a row depends on others that must not.
    """
    na = s.na
    at_once = s.k == s.n and na >= AT_ONCE
    rows(t, q, v, m.p, w.w, w.idx, na, w.H, w.ha, w.Hdv)
    for j in range(na):
        _rate_and_drive(s, m, w, on, j, v)
        if not (at_once or s.frictional):
            _schur_row(s, m, w, j)
    if s.frictional:  # its rows are coupled by islands
        return int(ask(FACTOR, s, m, w, np.int64(on > 0.0)))
    if at_once:
        _schur_at_once(s, m, w)
    s.dependent = factor_schur(w.G, na, w.reach, w.idx, w.shares)
    return int(s.dependent < 0)


@compiled
def push_rows(m: Model, w: Work, na: int, x: Array, factor: float, out: Array) -> None:
    """Out += factor M^-1 H^T x."""
    for j in range(na):
        i = w.idx[j]
        for c in range(m.span[i, 0], m.span[i, 1]):
            out[c] += factor * w.X[j, c] * x[j]


@compiled
def weigh(s: Any, m: Model, w: Work, x: Array) -> None:
    """Sum up the sizes of what multipliers x of the active rows do to every coordinate, in w.pull and w.shift."""
    for c in range(s.n):
        w.pull[c], w.shift[c] = 0.0, 0.0
    for j in range(s.na):
        i = w.idx[j]
        for c in range(m.span[i, 0], m.span[i, 1]):
            w.pull[c] += abs(w.H[j, c] * x[j])
            w.shift[c] += abs(w.X[j, c] * x[j])


@compiled
def pushed(m: Model, w: Work, j: int) -> float:
    """Size of the terms by which the multipliers that were weighed accelerate the row in place j.

    H M^-1 H^T is symmetrical, its rounding is not: what is zero for one row may not be so for the other.
    """
    total, i = 0.0, w.idx[j]
    for c in range(m.span[i, 0], m.span[i, 1]):
        total += abs(w.H[j, c]) * w.shift[c] + abs(w.X[j, c]) * w.pull[c]
    return float(total)


@compiled
def _scalar(dynamics: Any, rows: Any, s: Any, p: Floats, w: Work, on: float, t: float, q: Array, v: Array) -> int:
    """One coordinate and at most one active row: everything is scalar."""
    M, f = w.M, w.f
    dynamics(t, q, v, w.u, p, M, f, w.w)
    inverse = 1.0 / M[0, 0]
    free = f[0] * inverse
    w.vd[0] = free
    if not inverse > 0.0:
        return 1
    if s.na == 0:
        return 0
    Hs, ha, Hdvs = w.H, w.ha, w.Hdv
    rows(t, q, v, p, w.w, w.idx, 1, Hs, ha, Hdvs)
    H, h, i, law = Hs[0, 0], ha[0], w.idx[0], w.law
    push, rate = H * free, H * v[0]
    damping, spring = on * law[i, 1] * rate, on * (law[i, 0] + law[i, 2] * h * h) * h
    X = H * inverse
    G = H * X
    w.X[0, 0], w.hda[0], w.G[0, 0] = X, rate, np.sqrt(G)
    w.scale[0] = abs(push) + abs(Hdvs[0]) + abs(damping) + abs(spring)
    lam = -(push + Hdvs[0] + damping + spring) / G
    w.la[0] = lam
    w.vd[0] = free + X * lam
    return 0 if G > 0.0 else 1


@compiled
def accelerate(
    dynamics: Any, rows: Any, solve: Any, s: Any, m: Model, w: Work, t: float, q: Array, v: Array, general: int
) -> int:
    """Fill w.vd, and w.la, w.hda of the active rows; 1 if ill posed.

    With general = GENERAL it leaves H, X and the factor of G even if the system brings its own algebra (OWN). With
    SMOOTH the rows follow h'' = 0, whatever law is in force: what is left when the law's own terms are taken away.
    """
    s.rhs += 1
    s.contradiction = 0.0
    na = s.na
    on = 0.0 if general == SMOOTH else 1.0
    if s.has_solve and general == OWN:
        return int(solve(t, q, v, w.u, m.p, w.w, w.law, w.idx, na, w.vd, w.la, w.hda))
    if s.n == 1 and na <= 1 and not s.frictional:
        return _scalar(dynamics, rows, s, m.p, w, on, t, q, v)
    if free(dynamics, s, m, w, t, q, v) != 0:
        return 1
    if na == 0:
        return 0
    if assemble(rows, s, m, w, on, t, q, v) != 0:
        return 1
    if s.frictional:
        ask(SOLVE, s, m, w, NOTHING)
        if s.contradiction > s.lenient:
            return 1
    elif s.dependent == 0:
        solve_schur(w.G, na, w.reach, w.r, w.la)
    elif not solve_dependent(s, w, q, v):
        return 1
    push_rows(m, w, na, w.la, 1.0, w.vd)
    return 0
