"""One step of an L-stable, stiffly accurate ESDIRK pair of order 4(3) with six stages.

The implicit half of ARK4(3)6L[2]SA: Kennedy and Carpenter, Applied Numerical Mathematics 44 (2003). Each stage solves
for its velocity V alone, since Q = Q* + h g V:

    V - V* - h g a(Q, V) = 0,    Newton matrix  I - h g da/dv - (h g)^2 da/dq

Where q' is not v but N(q) v + r(q), a stage's positions follow from its velocities by iteration, and da/dq N stands in
the place of da/dq.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import GENERAL, OWN, SMOOTH, accelerate, push_rows
from crossbody.reference.core.algebra import ULP, copy, factor_lu, solve_lu, solve_schur
from crossbody.reference.core.dop853 import (
    keep_velocity,
    powers,
    watch_gaps,
    watch_guards,
    watch_multipliers,
)
from crossbody.reference.core.friction import NOTHING, RESPOND, TURN_PART, TURNING_RATE, ask, has_friction, is_tangent
from crossbody.reference.core.layout import Model, Work

GAMMA = 0.25
STAGES = 6
C = np.array([0.0, 1 / 2, 83 / 250, 31 / 50, 17 / 20, 1.0])
A = np.zeros((6, 6))
A[1, :1] = [1 / 4]
A[2, :2] = [8611 / 62500, -1743 / 31250]
A[3, :3] = [5012029 / 34652500, -654441 / 2922500, 174375 / 388108]
A[4, :4] = [15267082809 / 155376265600, -71443401 / 120774400, 730878875 / 902184768, 2285395 / 8070912]
A[5, :5] = [82889 / 524892, 0.0, 15625 / 83664, 69875 / 102672, -2260 / 8211]
B = np.array([*A[5, :5], GAMMA])
E = B - np.array(
    [4586570599 / 29645900160, 0.0, 178811875 / 945068544, 814220225 / 1159782912, -3700637 / 11593932, 61727 / 225920]
)
NEWTON_STEPS = 8
FOLLOW_STEPS = 60  # of positions after velocities: each leaves h g |dq'/dq|, a tenth and less, of what is missing


@compiled
def jacobian(K: Any, s: Any, m: Model, w: Work, h: float) -> int:
    """Stiff part of da/dq and da/dv from the rows: -M^-1 H^T G^-1 (a0 + 3 a2 h^2, a1) H; the rest by differences."""
    nq = s.nq
    q, v = w.y[:nq], w.y[nq:]
    w.Jq[:] = 0.0
    w.Jv[:] = 0.0
    if s.full_jacobian and _smooth_part(K, s, m, w) != 0:
        return 1
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, q, v, GENERAL) != 0:
        return 1
    for j in range(s.na):
        _row_part(s, m, w, j)
        if s.frictional and has_friction(m, w.idx[j]):
            _slip_part(s, m, w, w.idx[j])
    s.have_jacobian = 1
    return _newton_matrix(s, w, h)


@compiled
def _tangent(K: Any, s: Any, m: Model, w: Work, q: Any) -> None:
    """Columns of N(q), from q' at unit velocities less q' at rest."""
    w.slip[:] = 0.0
    K.velocity(s.t, q, w.slip, m.p, w.place)
    for c in range(s.n):
        w.slip[c] = 1.0
        K.velocity(s.t, q, w.slip, m.p, w.turn)
        w.slip[c] = 0.0
        for a in range(s.nq):
            w.tangent[a, c] = w.turn[a] - w.place[a]


@compiled
def _displace(s: Any, w: Work, c: int, step: float) -> None:
    """Leave in ys the state moved by a step of position c, or of velocity c - n."""
    copy(w.y, w.ys)
    if c >= s.n:
        w.ys[s.nq + c - s.n] = w.y[s.nq + c - s.n] + step
    elif s.has_velocity:
        for a in range(s.nq):
            w.ys[a] += step * w.tangent[a, c]
    else:
        w.ys[c] = w.y[c] + step


@compiled
def _row_part(s: Any, m: Model, w: Work, j: int) -> None:
    """Subtract M^-1 H^T (G^-1)_.j (a0_j + 3 a2_j h_j^2, a1_j) H_j."""
    i = w.idx[j]
    if s.frictional and w.slides[i] and is_tangent(m, i):
        return  # what slides has no law of its own
    w.r[: s.na] = 0.0
    w.r[j] = 1.0
    if s.frictional:
        ask(RESPOND, s, m, w, NOTHING)
    else:
        solve_schur(w.G, s.na, w.reach, w.r, w.la)
    spring = w.law[i, 0] + 3.0 * w.law[i, 2] * w.ha[j] ** 2
    w.d[:] = 0.0
    push_rows(m, w, s.na, w.la, 1.0, w.d)
    for a in range(s.n):
        for c in range(m.span[i, 0], m.span[i, 1]):
            w.Jq[a, c] -= w.d[a] * spring * w.H[j, c]
            w.Jv[a, c] -= w.d[a] * w.law[i, 1] * w.H[j, c]


@compiled
def _slip_part(s: Any, m: Model, w: Work, i: int) -> None:
    """Add what follows from friction that turns with the slip of contact i."""
    if ask(TURN_PART, s, m, w, i) == 0.0:
        return
    c, t = w.listed[m.tangent[i]], m.tangent[i]
    w.d[:] = 0.0
    push_rows(m, w, s.na, w.la, 1.0, w.d)
    for a in range(s.n):
        for b in range(m.span[t, 0], m.span[t, 1]):
            w.Jv[a, b] += w.d[a] * (w.bent[t] * w.H[c, b] + w.bent[t + 1] * w.H[c + 1, b])


@compiled
def _smooth_part(K: Any, s: Any, m: Model, w: Work) -> int:
    """Central differences of the acceleration without the rows' law, so that no stiff term is differenced."""
    n, nq = s.n, s.nq
    failed = 0
    for c in range(2 * n):
        step = 1e-6 * max(1.0, abs(w.y[c] if c < n else w.y[nq + c - n]))
        _displace(s, w, c, step)
        failed |= accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.ys[:nq], w.ys[nq:], SMOOTH)
        copy(w.vd, w.d)
        _displace(s, w, c, -step)
        failed |= accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.ys[:nq], w.ys[nq:], SMOOTH)
        for a in range(n):
            slope = (w.d[a] - w.vd[a]) / (2.0 * step)
            if c < n:
                w.Jq[a, c] = slope
            else:
                w.Jv[a, c - n] = slope
    return failed


@compiled
def _newton_matrix(s: Any, w: Work, h: float) -> int:
    g = h * GAMMA
    for a in range(s.n):
        for c in range(s.n):
            w.J[a, c] = -g * (w.Jv[a, c] + g * w.Jq[a, c])
        w.J[a, a] += 1.0
    s.jacobian_scale = h
    s.factorisations += 1
    return factor_lu(w.J, s.n, w.pivot)


@compiled
def _residual(s: Any, w: Work, g: float) -> None:
    """D = -(V - V* - g a) with V* kept in w.g."""
    n, nq = s.n, s.nq
    for a in range(n):
        w.d[a] = w.g[a] + g * w.vd[a] - w.ys[nq + a]


@compiled
def _update(K: Any, s: Any, m: Model, w: Work, t: float, g: float) -> float:
    """Solve for the correction, apply it to V and Q; returns its size in units of the tolerance.

    One of rounding is none: a slip is a sum of all velocities, known to no more than the fastest of them.
    """
    n, nq = s.n, s.nq
    solve_lu(w.J, n, w.pivot, w.d)
    size, fastest, rounding = 0.0, 0.0, True
    for a in range(n):
        fastest = max(fastest, abs(w.ys[nq + a]))
    for a in range(n):
        rounding = rounding and abs(w.d[a]) <= ULP * fastest
        w.ys[nq + a] += w.d[a]
        size = max(size, abs(w.d[a]) / _scale(s, w, nq + a))
        if not s.has_velocity:
            w.ys[a] += g * w.d[a]
            size = max(size, g * abs(w.d[a]) / _scale(s, w, a))
    if s.has_velocity:
        moved = _follow(K, s, m, w, t, g)
        size, rounding = max(size, moved), rounding and moved < np.inf
    return 0.0 if rounding else size


@compiled
def _follow(K: Any, s: Any, m: Model, w: Work, t: float, g: float) -> float:
    """Move Q to where Q = Q* + g q'(Q, V), with Q* in w.place.

    Returns:
        By how much it moves, in units of the tolerance; infinite if it does not arrive.
    """
    first = -1.0
    for _ in range(FOLLOW_STEPS):
        K.velocity(t, w.ys[: s.nq], w.ys[s.nq :], m.p, w.turn)
        size, left = 0.0, 0.0
        for a in range(s.nq):
            move = w.place[a] + g * w.turn[a] - w.ys[a]
            w.ys[a] += move
            size = max(size, abs(move) / _scale(s, w, a))
            left = max(left, abs(move) - 4.0 * ULP * (abs(w.ys[a]) + 1.0))
        first = size if first < 0.0 else first
        if left <= 0.0:
            return first
    return np.inf


@compiled
def _scale(s: Any, w: Work, i: int) -> float:
    """Tolerance of component i, floored where rounding of a stiff row's gap would drown it."""
    return float(max(w.atol[i] + s.rtol * abs(w.y[i]), 1e-15 * (1.0 + abs(w.y[i]))))


@compiled
def _predict(K: Any, s: Any, m: Model, w: Work, stage: int, h: float) -> bool:
    """Q*, V* of the stage in ys and g, and a first V that continues the last acceleration; False if no Q follows."""
    nq, g = s.nq, h * GAMMA
    for a in range(s.n):
        v = w.y[nq + a]
        for j in range(stage):
            v += h * A[stage, j] * w.k[j, nq + a]
        w.g[a] = v
        w.ys[nq + a] = v + g * w.k[stage - 1, nq + a]
    for a in range(nq):
        q = w.y[a]
        for j in range(stage):
            q += h * A[stage, j] * w.k[j, a]
        if s.has_velocity:
            w.place[a] = q
            w.ys[a] = q + g * w.k[stage - 1, a]
        else:
            w.ys[a] = q + g * w.ys[nq + a]
    return bool(not s.has_velocity or _follow(K, s, m, w, s.t + C[stage] * h, g) < np.inf)


@compiled
def _stage(K: Any, s: Any, m: Model, w: Work, stage: int, h: float) -> int:
    """Newton for one stage; 0 done, 1 ill posed, 2 no convergence."""
    n, nq, g, t = s.n, s.nq, h * GAMMA, s.t + C[stage] * h
    if not _predict(K, s, m, w, stage, h):
        return 2
    before = np.inf
    for _ in range(NEWTON_STEPS):
        if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, w.ys[:nq], w.ys[nq:], OWN) != 0:
            return 1
        _residual(s, w, g)
        size = _update(K, s, m, w, t, g)
        if not size < 2.0 * before:  # NaN and divergence
            return 2
        if size < 0.01:
            for a in range(n):
                w.k[stage, nq + a] = (w.ys[nq + a] - w.g[a]) / g
            for a in range(nq):
                w.k[stage, a] = (w.ys[a] - w.place[a]) / g if s.has_velocity else w.ys[nq + a]
            keep_velocity(s, w, stage)
            if s.ledger:
                powers(K, s, m, w, t, w.ys[: s.nq], w.ys[s.nq :], stage)
            return 0
        before = size
    return 2


@compiled
def _error(s: Any, w: Work, h: float) -> float:
    """Embedded estimate, filtered by the Newton matrix so that decayed stiff modes do not count."""
    n, nq, g = s.n, s.nq, h * GAMMA
    for a in range(nq + n):
        total = 0.0
        for j in range(STAGES):
            total += E[j] * w.k[j, a]
        w.ys[a] = h * total
    for a in range(n):
        w.d[a] = w.ys[nq + a]
        for c in range(n):
            w.d[a] += g * w.Jq[a, c] * (_slipped(s, w, c, h) if s.has_velocity else w.ys[c])
    solve_lu(w.J, n, w.pivot, w.d)
    total = 0.0
    for a in range(nq):
        move = w.d[a] if a < n else 0.0
        ed = move / _scale(s, w, nq + a) if a < n else 0.0
        if s.has_velocity:
            move = 0.0
            for c in range(n):
                move += w.tangent[a, c] * w.d[c]
        e = (w.ys[a] + g * move) / _scale(s, w, a)
        total += e * e + ed * ed
    return float(np.sqrt(total / (nq + n)))


@compiled
def _slipped(s: Any, w: Work, c: int, h: float) -> float:
    """Embedded estimate of what v adds up to over the step: a position's, in the coordinates of v."""
    total = E[0] * w.y[s.nq + c]
    for j in range(1, STAGES):
        total += E[j] * w.stage_v[j, c]
    return float(h * total)


@compiled
def step(K: Any, s: Any, m: Model, w: Work, h: float) -> float:
    """From y and k[0] to y1; the error in units of the tolerance, -1 if ill posed, inf if Newton failed."""
    if s.has_velocity:
        _tangent(K, s, m, w, w.y[: s.nq])
    if not s.have_jacobian:
        before, s.lenient = s.lenient, np.inf  # states beside the motion may contradict rows that depend on each other
        code = jacobian(K, s, m, w, h)
        s.lenient = before
        if code != 0:
            return -1.0
    elif s.jacobian_scale != h and _newton_matrix(s, w, h) != 0:
        return -1.0
    for stage in range(1, STAGES):
        code = _stage(K, s, m, w, stage, h)
        if code == 1:
            return -1.0
        if code == 2:
            if not (s.frictional and h * ask(TURNING_RATE, s, m, w, NOTHING) > 1.0):
                s.full_jacobian = 1  # else slips have turned within the step, and a shorter one helps
            s.have_jacobian = 0
            return np.inf
        watch_multipliers(s, m, w, stage)
        if s.switching and s.na < s.nc and 2 <= stage <= 4:
            watch_gaps(K, s, m, w, s.t + C[stage] * h, stage - 2)
        if s.ng > 0 and 2 <= stage <= 4:
            watch_guards(K, s, m, w, s.t + C[stage] * h, stage - 2)
    copy(w.ys, w.y1)
    for i in range(s.nz):
        w.z1[i] = w.z[i]
        for j in range(STAGES):
            w.z1[i] += h * B[j] * w.kz[j, i]
    return _error(s, w, h)
