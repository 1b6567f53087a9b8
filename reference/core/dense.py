"""The state anywhere inside the step just taken, whatever method took it."""

from __future__ import annotations

from typing import Any

from crossbody.reference.cache import compiled
from crossbody.reference.core import bogacki, dop853, esdirk, exact
from crossbody.reference.core.acceleration import GENERAL, OWN, accelerate, push_rows
from crossbody.reference.core.algebra import solve_schur
from crossbody.reference.core.dop853 import powers
from crossbody.reference.core.friction import NOTHING, RESPOND, ask, is_tangent
from crossbody.reference.core.layout import EXACT, EXPLICIT, IMPLICIT, SHORT, Model, Work
from crossbody.reference.kinds import Array

CORRECTIONS = 3  # Newton steps onto the rows' own motion; two see the first one's residue vanish in rounding
RESOLVED = 2.0  # |p| h of the rows' fastest pole p, above which a step tells a gap worse than its law does
INSIDE = 13  # where the powers at quarters of an implicit step stand, behind those of all stages
BEND_PART = 1e-3  # of the step, along which the slope of q' is taken
ARRIVED = 1e-12  # part of the terms behind a multiplier that may be left of the law's: rounding,
ARRIVED_PART = 0.1  # or this part of the relative tolerance, where nothing is switched


@compiled
def prepare(K: Any, s: Any, m: Model, w: Work) -> int:
    """Make the dense output of the step, once; 1 if a stage of it is ill posed."""
    account = s.ledger and s.method == IMPLICIT
    if s.have_dense or (s.method != EXPLICIT and not (s.has_velocity or s.frictional or account)):
        return 0
    s.have_dense = 1
    if s.method == EXPLICIT:
        return dop853.make_dense(K, s, m, w)
    if s.has_velocity:
        _bend(K, s, m, w, s.t_old, w.y, 0, w.bend[0])
        _bend(K, s, m, w, s.t_old + s.hs, w.y1, s.end, w.bend[1])
    if s.has_velocity or s.frictional:
        _travel(s, w)
    return _powers_inside(K, s, m, w) if account else 0


@compiled
def _powers_inside(K: Any, s: Any, m: Model, w: Work) -> int:
    """Leave in w.kz[INSIDE:] the powers at quarters of an implicit step; 1 if one of them is ill posed."""
    for j in range(3):
        theta = 0.25 * (j + 1)
        t = s.t_old + theta * s.hs
        if with_rows(K, s, m, w, theta, t, w.ys, False) != 0:
            return 1
        powers(K, s, m, w, t, w.ys[: s.nq], w.ys[s.nq :], INSIDE + j)
    return 0


@compiled
def _bend(K: Any, s: Any, m: Model, w: Work, t: float, y: Array, stage: int, out: Array) -> None:
    """Out = q'' at an end y of the step: the difference of q' along k[stage]."""
    nq, short = s.nq, BEND_PART * s.hs
    for sign in range(-1, 2, 2):
        for i in range(nq + s.n):
            w.ys[i] = y[i] + sign * short * w.k[stage, i]
        K.velocity(t + sign * short, w.ys[:nq], w.ys[nq:], m.p, w.turn)
        for i in range(nq):
            out[i] = (w.turn[i] - out[i]) / (2.0 * short) if sign > 0 else w.turn[i]


@compiled
def _travel(s: Any, w: Work) -> None:
    """Leave in w.travel what v adds up to over the step, by its stages."""
    v, weight, stages = w.k, esdirk.B, esdirk.STAGES
    if s.has_velocity:
        v = w.stage_v
    if s.method == SHORT:
        weight, stages = bogacki.B, bogacki.STAGES
    for i in range(s.n):
        w.travel[i] = s.hs * weight[0] * w.y[s.nq + i]
        for j in range(1, stages):
            w.travel[i] += s.hs * weight[j] * v[j, i]


@compiled
def _quintic(s: Any, w: Work, theta: float, h: float, out: Array) -> None:
    """Hermite interpolant of q, v and v' at both ends; its derivative is v.

    Where q' is not v there are two: one of q, q' and q'', and one of the integral of v, whose derivative is v. With
    friction that takes the place of q1 - q0 too: over a short step the rounding of q would hide when a slip stops.
    """
    n, nq, end_stage = s.n, s.nq, s.end
    x, x2 = theta, theta * theta
    x3 = x2 * x
    end = x3 * (10.0 - 15.0 * x + 6.0 * x2)
    v0, v1 = x * (1.0 - x2 * (6.0 - 8.0 * x + 3.0 * x2)), x3 * (-4.0 + 7.0 * x - 3.0 * x2)
    a0, a1 = x2 * (0.5 - 1.5 * x + 1.5 * x2 - 0.5 * x3), x3 * (0.5 - x + 0.5 * x2)
    end_d = 30.0 * x2 * (1.0 - x) ** 2
    v0_d, v1_d = 1.0 - x2 * (18.0 - 32.0 * x + 15.0 * x2), x2 * (-12.0 + 28.0 * x - 15.0 * x2)
    a0_d, a1_d = x * (1.0 - 4.5 * x + 6.0 * x2 - 2.5 * x3), x2 * (1.5 - 4.0 * x + 2.5 * x2)
    for i in range(n):
        dq, v, ve = w.y1[i] - w.y[i], h * w.y[nq + i], h * w.y1[nq + i]
        a, ae = h * h * w.k[0, nq + i], h * h * w.k[end_stage, nq + i]
        if s.has_velocity or s.frictional:
            dq = w.travel[i]
        if not s.has_velocity:
            out[i] = w.y[i] + dq * end + v * v0 + ve * v1 + a * a0 + ae * a1
        out[nq + i] = (dq * end_d + v * v0_d + ve * v1_d + a * a0_d + ae * a1_d) / h
    for i in range(nq if s.has_velocity else 0):
        dq, v, ve = w.y1[i] - w.y[i], h * w.k[0, i], h * w.k[end_stage, i]
        a, ae = h * h * w.bend[0, i], h * h * w.bend[1, i]
        out[i] = w.y[i] + dq * end + v * v0 + ve * v1 + a * a0 + ae * a1


@compiled
def state(s: Any, m: Model, w: Work, theta: float, out: Array) -> None:
    """Out = (q, v) at the part theta of the step."""
    if s.method == EXACT:
        exact.evaluate(s, m, w, theta * s.hs, out)
    elif theta == 1.0:
        for i in range(s.nq + s.n):
            out[i] = w.y1[i]
    elif s.method == EXPLICIT:
        dop853.evaluate(w.y, w.F, theta, out)
    else:
        _quintic(s, w, theta, s.hs, out)


@compiled
def long_for_rows(s: Any) -> bool:
    """Whether the step is an implicit one, or an explicit one close to its limit of stability."""
    return bool(s.method == IMPLICIT or (s.method == EXPLICIT and s.hs * s.row_rate > RESOLVED))


@compiled
def _shift(K: Any, s: Any, m: Model, w: Work, t: float, q: Array) -> None:
    """Move q by what M^-1 H^T la is in positions: the change of q' with v."""
    w.slip[:] = 0.0
    K.velocity(t, q, w.slip, m.p, w.place)
    push_rows(m, w, s.na, w.la, 1.0, w.slip)
    K.velocity(t, q, w.slip, m.p, w.turn)
    for i in range(s.nq):
        q[i] += w.turn[i] - w.place[i]


@compiled
def tolerated(s: Any) -> float:
    """What may be left of the rows' law where a motion is watched or written down."""
    return float(max(ARRIVED, ARRIVED_PART * s.rtol))


@compiled
def put_on_rows(K: Any, s: Any, m: Model, w: Work, theta: float, out: Array, left: float) -> bool:
    """Move out = (q, v), at the part theta of a step that is long for the rows, to where their law has their gaps.

    A gap under a linear law is known in closed form whatever the masses do. A long step knows it to the tolerance only,
    and the interpolant across curved rows no better: times a0 that drowns the multiplier of a stiff row, and its root
    is the rate of a row that is let go from rest and falls back. The correction is the least one in the metric of M.
    Rows with a cubic term that counts are left as they are. `left` is the part of the terms behind a multiplier that
    the law may still be off by.

    Returns:
        Whether the workspace holds the acceleration and the multipliers there, so that they need not be evaluated.
    """
    if theta == 0.0 or not long_for_rows(s) or s.na == 0 or s.frictional or not exact.is_linear(s, w):
        return False
    q, v = out[: s.nq], out[s.nq :]
    t = theta * s.hs
    for _ in range(CORRECTIONS):
        if accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t_old + t, q, v, GENERAL) != 0:
            return False
        missing = 0.0
        for j in range(s.na):
            i = w.idx[j]
            a0, a1 = w.law[i, 0], w.law[i, 1]
            h, hd = exact.linear_arc(a0, a1, w.gaps[0, i], w.rates[0, i], t)
            # A law without a0 has no memory of a position: its gap may be anything, and only its rate is the law's.
            w.r[j], w.rate[j] = h - w.ha[j] if a0 > 0.0 else 0.0, hd - w.hda[j]
            missing = max(missing, (a0 * abs(w.r[j]) + a1 * abs(w.rate[j])) / max(w.scale[j], 1e-300))
        if missing <= left:
            return not s.has_solve
        solve_schur(w.G, s.na, w.reach, w.r, w.la)
        if s.has_velocity:
            _shift(K, s, m, w, s.t_old + t, q)
        else:
            push_rows(m, w, s.na, w.la, 1.0, q)
        solve_schur(w.G, s.na, w.reach, w.rate, w.la)
        push_rows(m, w, s.na, w.la, 1.0, v)
    return False


@compiled
def _off_laws(s: Any, m: Model, w: Work, t: float, of_gaps: bool) -> float:
    """Leave in w.r by how much gaps, or rates, are off their laws a time t into a step; what part of forces that is.

    Gaps follow their laws whatever friction does to the loads, and what sticks decays. A row that slides has none.
    """
    most = 0.0
    for j in range(s.na):
        i = w.idx[j]
        a0, a1 = w.law[i, 0], w.law[i, 1]
        h, hd = exact.linear_arc(a0, a1, w.gaps[0, i], w.rates[0, i] - m.drift[i], t)
        off = (h - w.ha[j] if a0 > 0.0 else 0.0) if of_gaps else hd - w.hda[j]
        w.r[j] = 0.0 if is_tangent(m, i) and w.slides[i] else off
        most = max(most, (a0 if of_gaps else a1) * abs(w.r[j]) / max(w.scale[j], 1e-300))
    return float(most)


@compiled
def _put_on_rubbing_rows(K: Any, s: Any, m: Model, w: Work, theta: float, out: Array) -> None:
    """Move out = (q, v) likewise where some rows have friction, inside a step that is long for them, where it is told.

    What is watched is not moved: where forces that stick or slide reach their bounds all of a step's own stages count.
    """
    if theta in (0.0, 1.0) or not long_for_rows(s) or s.loops or not exact.is_linear(s, w):
        return
    q, v, t = out[: s.nq], out[s.nq :], theta * s.hs
    for _ in range(CORRECTIONS - 1):
        if accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t_old + t, q, v, GENERAL) != 0:
            return
        if _off_laws(s, m, w, t, False) + _off_laws(s, m, w, t, True) <= tolerated(s):
            return
        ask(RESPOND, s, m, w, NOTHING)
        if s.has_velocity:
            _shift(K, s, m, w, s.t_old + t, q)
        else:
            push_rows(m, w, s.na, w.la, 1.0, q)
        _off_laws(s, m, w, t, False)
        ask(RESPOND, s, m, w, NOTHING)
        push_rows(m, w, s.na, w.la, 1.0, v)


@compiled
def with_rows(K: Any, s: Any, m: Model, w: Work, theta: float, t: float, out: Array, told: bool) -> int:
    """Out = (q, v) at the part theta of the step, the time t, and leave the multipliers there; 1 if ill posed.

    Where they are `told`, and not for a sum alone, they are no further off than at the ends of the step.
    """
    state(s, m, w, theta, out)
    if told and s.frictional and s.na > 0:
        _put_on_rubbing_rows(K, s, m, w, theta, out)
    if s.na > 0 and not put_on_rows(K, s, m, w, theta, out, tolerated(s)):
        return int(accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, out[: s.nq], out[s.nq :], OWN))
    return 0


@compiled
def ledger(s: Any, w: Work, theta: float, out: Array) -> None:
    """Out = the ledger at the part theta of the step."""
    if s.method == EXPLICIT:
        dop853.evaluate(w.z, w.Fz, theta, out)
        return
    if s.method == IMPLICIT:
        _quadrature(s, w, theta, out)
        return
    x, h = theta, s.hs
    for i in range(s.nz):
        dz, p0, p1 = w.z1[i] - w.z[i], h * w.kz[0, i], h * w.kz[s.end, i]
        out[i] = w.z[i] + x * (p0 + x * (3.0 * dz - 2.0 * p0 - p1 + x * (p0 + p1 - 2.0 * dz)))


@compiled
def _quadrature(s: Any, w: Work, theta: float, out: Array) -> None:
    """Out = the ledger, by the quartic through the powers at ends and quarters; it ends where the step's own does."""
    kz, x = w.kz, theta
    end = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
    for i in range(s.nz):
        p0, p1, p2, p3, p4 = kz[0, i], kz[INSIDE, i], kz[INSIDE + 1, i], kz[INSIDE + 2, i], kz[s.end, i]
        d1 = (-25.0 * p0 + 48.0 * p1 - 36.0 * p2 + 16.0 * p3 - 3.0 * p4) / 6.0
        d2 = (70.0 * p0 - 208.0 * p1 + 228.0 * p2 - 112.0 * p3 + 22.0 * p4) / 9.0
        d3 = (-40.0 * p0 + 144.0 * p1 - 192.0 * p2 + 112.0 * p3 - 24.0 * p4) / 6.0
        d4 = (32.0 * p0 - 128.0 * p1 + 192.0 * p2 - 128.0 * p3 + 32.0 * p4) / 15.0
        whole = (7.0 * (p0 + p4) + 32.0 * (p1 + p3) + 12.0 * p2) / 90.0
        along = x * (p0 + x * (d1 + x * (d2 + x * (d3 + x * d4))))
        out[i] = w.z[i] + s.hs * (along - end * whole) + end * (w.z1[i] - w.z[i])
