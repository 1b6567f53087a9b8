"""Which method takes the next step, and how long the step is."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core import dop853
from crossbody.reference.core.acceleration import push_rows
from crossbody.reference.core.algebra import ULP, solve_schur
from crossbody.reference.core.dop853_table import E3, STABILITY_LIMIT, STAGES
from crossbody.reference.core.friction import BEGUN, NOTHING, TURNING_RATE, ask
from crossbody.reference.core.layout import EXPLICIT, IMPLICIT, Model, Work

SAFETY = 0.9
CAUTION = 0.75  # instead, of explicit steps soon after one that was rejected: others follow where the error varies
CAUTIOUS_STEPS = 10
EXPLICIT_COST = 12.0  # right-hand sides of an explicit step
LEAST_COST = 10.0  # of an implicit one: two for every stage
STALLED_STEPS = 5  # explicit steps at the stability limit before the implicit method is tried
STALLED_PART = 0.35  # of the limit, where a stiff row that every step excites keeps an explicit step at rtol 1e-6
TRIAL_STEPS = 12  # implicit steps before the two are compared
HOLD_STEPS = 400  # explicit steps after a trial that was lost
ROUNDED = 1e3  # units of rounding of the velocities by which stages must differ to tell of a rate
ERROR_PART = 0.0531  # what the implicit estimate of order 3 is of the explicit one: E A^3 1 of both tables


@compiled
def first_step(K: Any, s: Any, m: Model, w: Work) -> float:
    """Hairer's guess for the first step from the sizes of y, y' and y''."""
    size = s.nq + s.n
    d0, d1, d2 = 0.0, 0.0, 0.0
    for i in range(size):
        scale = w.atol[i] + s.rtol * abs(w.y[i])
        d0 += (w.y[i] / scale) ** 2
        d1 += (w.k[0, i] / scale) ** 2
    h0 = 1e-6 if d0 < 1e-10 or d1 < 1e-10 else 0.01 * np.sqrt(d0 / d1)
    for i in range(size):
        w.ys[i] = w.y[i] + h0 * w.k[0, i]
    if dop853.derivative(K, s, m, w, s.t + h0, w.ys, dop853.SECOND) != 0:
        return float(h0)
    for i in range(size):
        scale = w.atol[i] + s.rtol * abs(w.y[i])
        d2 += ((w.k[1, i] - w.k[0, i]) / scale) ** 2
    steep = max(np.sqrt(d1 / size), np.sqrt(d2 / size) / h0)
    h1 = max(1e-6, 1e-3 * h0) if steep <= 1e-15 else (0.01 / steep) ** 0.125
    return float(min(100.0 * h0, h1))


@compiled
def longest_step(s: Any, m: Model, w: Work) -> float:
    """The longest step that may be tried: an explicit one is stable for the active rows and for slips just begun.

    Beyond that what the error estimate lets pass is far larger inside the step, where events are located: the dense
    output of a decayed pole p departs from it by 300 times the estimate at |p| h = 16, by 10 at the limit.
    """
    s.row_rate = 0.0
    if s.method != EXPLICIT or s.na == 0:
        return float(s.h_max)
    s.row_rate = _row_rate(s, w)
    rate = s.row_rate
    if s.frictional:
        s.slip_rate = ask(TURNING_RATE, s, m, w, BEGUN)
        rate = max(s.row_rate, s.slip_rate)
        if s.blurred:  # slips of rounding's size beside fast bodies: none but their own law tells how stiff they are
            s.slip_rate = max(s.slip_rate, ask(TURNING_RATE, s, m, w, NOTHING))
    return float(min(s.h_max, STABILITY_LIMIT / rate) if rate > 0.0 else s.h_max)


@compiled
def pole(damping: float, stiffness: float) -> float:
    """Faster of the two poles of x'' + damping x' + stiffness x = 0, 1/s."""
    half = 0.5 * damping
    over = half * half - stiffness
    return float(half + np.sqrt(over) if over > 0.0 else np.sqrt(stiffness))


@compiled
def _row_rate(s: Any, w: Work) -> float:
    """Fastest pole of the active rows, 1/s."""
    fastest = 0.0
    for j in range(s.na):
        i = w.idx[j]
        fastest = max(fastest, pole(w.law[i, 1], w.law[i, 0] + 3.0 * w.law[i, 2] * w.gaps[0, i] ** 2))
    return float(fastest)


@compiled
def stage_rate(s: Any, w: Work) -> float:
    """Fastest rate, 1/s, that two stages at the end of an explicit step show: by how much their accelerations differ.

    Hairer, Noersett and Wanner, Solving Ordinary Differential Equations I, section II.10. 0 where rounding parts them.
    """
    apart, faster, speed = 0.0, 0.0, 0.0
    for a in range(s.nq, s.nq + s.n):
        apart += (w.y1[a] - w.ys[a]) ** 2
        faster += (w.k[STAGES, a] - w.k[STAGES - 1, a]) ** 2
        speed += w.y1[a] ** 2
    return float(np.sqrt(faster / apart) if apart > (ROUNDED * ULP) ** 2 * speed else 0.0)


@compiled
def promised_step(s: Any, m: Model, w: Work, h: float) -> float:
    """The step that the implicit method could take, by the explicit step h just taken; infinite if not known.

    Both have an estimate of order 3, h^4 y'''' but for a factor. What the rows' own decay puts into it, an
    implicit step does not follow: velocities that the rows do not see are left.
    """
    if s.frictional or s.has_solve or s.dependent != 0:
        return np.inf
    nq, e, r = s.nq, w.d, w.r
    for a in range(s.n):
        e[a] = 0.0
        for j in range(STAGES):
            e[a] += E3[j] * w.k[j, nq + a]
    for j in range(s.na):
        r[j] = 0.0
        for c in range(m.span[w.idx[j], 0], m.span[w.idx[j], 1]):
            r[j] += w.H[j, c] * e[c]
    solve_schur(w.G, s.na, w.reach, r, w.la)
    push_rows(m, w, s.na, w.la, -1.0, e)
    total = 0.0
    for a in range(s.n):
        total += (h * e[a] / (w.atol[nq + a] + s.rtol * abs(w.y1[nq + a]))) ** 2
    return float(h * (ERROR_PART * np.sqrt(total / s.n)) ** -0.25) if total > 0.0 else np.inf


@compiled
def choose_method(s: Any, w: Work) -> None:
    """Go implicit where the rows' stability, not accuracy, bounds the explicit step; the cheaper of the two stays."""
    if s.method == EXPLICIT:
        if s.hold > 0:
            s.hold -= 1
        rate = max(s.row_rate, s.slip_rate) if s.frictional else s.row_rate
        s.stalled = s.stalled + 1 if s.hs * rate > STALLED_PART * STABILITY_LIMIT else 0
        pays = s.promised / LEAST_COST > s.hs / EXPLICIT_COST
        if s.implicit and s.hold == 0 and s.stalled >= STALLED_STEPS and pays:
            s.method, s.have_jacobian = IMPLICIT, 0
            s.explicit_rate = s.hs / EXPLICIT_COST
            s.trial_steps, s.trial_rhs, s.trial_t = 0, s.rhs, s.t
    elif s.method == IMPLICIT:
        s.trial_steps += 1
        if s.trial_steps >= TRIAL_STEPS:
            if s.t - s.trial_t < s.explicit_rate * (s.rhs - s.trial_rhs):
                s.method, s.hold, s.stalled = EXPLICIT, HOLD_STEPS, 0
                s.h = s.explicit_rate * EXPLICIT_COST
            s.trial_steps, s.trial_rhs, s.trial_t = 0, s.rhs, s.t


@compiled
def grow(s: Any, error: float) -> float:
    """Factor for the next step from the error of this one, by the order of the method that took it."""
    if s.method == EXPLICIT:
        order, most, safety = 8.0, 6.0, CAUTION if s.cautious > 0 else SAFETY
    else:
        order, most, safety = 4.0, 4.0, SAFETY
    if error == 0.0:
        return most
    return float(min(most, max(0.25, safety * error ** (-1.0 / order))))
