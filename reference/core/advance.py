"""The loop: step, watch, switch, record. It allocates nothing and returns to Python between slices of steps."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from crossbody.reference._cache import compiled, inlined
from crossbody.reference._kinds import Index
from crossbody.reference.core import bogacki, dense, dop853, esdirk, events, exact, machine, record
from crossbody.reference.core.acceleration import scatter
from crossbody.reference.core.dop853_table import STABILITY_LIMIT, STAGES
from crossbody.reference.core.layout import (
    DIVERGED,
    DONE,
    EVENTS_FULL,
    EXACT,
    EXPLICIT,
    ILL_POSED,
    IMPLICIT,
    MODE_CYCLE,
    MORE,
    NODES,
    NOT_FINITE,
    ROWS_FULL,
    SHORT,
    STEP_TOO_SMALL,
    Buffers,
    Model,
    Work,
    open_buffers,
    open_model,
    open_work,
)

SAFETY = 0.9
EXPLICIT_COST = 12.0  # right-hand sides of an explicit step
STALLED_STEPS = 5  # explicit steps at the stability limit before the implicit method is tried
TRIAL_STEPS = 12  # implicit steps before the two are compared
HOLD_STEPS = 400  # explicit steps after a trial that was lost
FAR = 1e30
MAX_REJECTIONS = 60
SHORT_PART = 0.2  # ticks closer than this part of a high-order step are taken by the low-order method
HOLD_SHORT = 16  # ticks by the high-order method after one that was not good enough


class Kernels(NamedTuple):
    """The functions of one mechanism."""

    dynamics: Any
    gaps: Any
    rows: Any
    energy: Any
    power: Any
    solve: Any
    control: Any


@inlined
def _first_step(K: Any, s: Any, m: Model, w: Work) -> float:
    """Hairer's guess for the first step from the sizes of y, y' and y''."""
    size = 2 * s.n
    d0, d1, d2 = 0.0, 0.0, 0.0
    for i in range(size):
        scale = s.atol + s.rtol * abs(w.y[i])
        d0 += (w.y[i] / scale) ** 2
        d1 += (w.k[0, i] / scale) ** 2
    h0 = 1e-6 if d0 < 1e-10 or d1 < 1e-10 else 0.01 * np.sqrt(d0 / d1)
    for i in range(size):
        w.ys[i] = w.y[i] + h0 * w.k[0, i]
    if dop853.derivative(K, s, m, w, s.t + h0, w.ys, dop853.SECOND) != 0:
        return float(h0)
    for i in range(size):
        scale = s.atol + s.rtol * abs(w.y[i])
        d2 += ((w.k[1, i] - w.k[0, i]) / scale) ** 2
    steep = max(np.sqrt(d1 / size), np.sqrt(d2 / size) / h0)
    h1 = max(1e-6, 1e-3 * h0) if steep <= 1e-15 else (0.01 / steep) ** 0.125
    return float(min(100.0 * h0, h1))


@inlined
def _take_inputs(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> None:
    """Put the inputs that hold from now on in force and find the next instant at which they change."""
    while s.next_input < len(b.inputs_t) and b.inputs_t[s.next_input] <= s.t:
        before = s.next_input - 1
        for i in range(s.nu):  # by its change, so that what a controller holds on top stays
            w.u[i] += b.inputs_u[s.next_input, i] - (b.inputs_u[before, i] if before >= 0 else 0.0)
        s.next_input += 1
    if s.has_control and s.next_tick * s.tick <= s.t:
        K.control(s.t, w.y[: s.n], w.y[s.n :], w.u, w.s, m.p)
        s.next_tick += 1
    s.stop = s.t_end
    if s.next_input < len(b.inputs_t):
        s.stop = min(s.stop, b.inputs_t[s.next_input])
    if s.has_control:
        s.stop = min(s.stop, s.next_tick * s.tick)


@compiled
def _restart(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Settle the modes at the present instant and choose how to go on."""
    code = machine.settle(K, s, m, w, b.mode, b.history, b.events_t, b.events)
    if code != 0:
        return int(code)
    s.method = EXPLICIT
    s.stalled, s.hold, s.full_jacobian = 0, 0, 0
    remembered = s.h_active if s.na > 0 else s.h_free
    s.h = remembered if remembered > 0.0 else _first_step(K, s, m, w)
    return 0


@inlined
def _resume(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Go on after a change of the inputs, with the step that was good before."""
    if s.switching:
        h = s.h
        code = _restart(K, s, m, w, b)
        s.h = h
        return code
    if dop853.derivative(K, s, m, w, s.t, w.y, dop853.START) != 0:
        return ILL_POSED
    scatter(s, w, w.lam0)
    return 0


@inlined
def _row_rate(s: Any, w: Work) -> float:
    """Fastest pole of the active rows, 1/s."""
    fastest = 0.0
    for j in range(s.na):
        i = w.idx[j]
        half = 0.5 * w.law[i, 1]
        stiffness = w.law[i, 0] + 3.0 * w.law[i, 2] * w.gaps[0, i] ** 2
        over = half * half - stiffness
        fastest = max(fastest, half + np.sqrt(over) if over > 0.0 else np.sqrt(stiffness))
    return float(fastest)


@inlined
def _choose_method(s: Any, w: Work) -> None:
    """Go implicit where the rows' stability, not accuracy, bounds the explicit step; the cheaper of the two stays."""
    if s.method == EXPLICIT:
        if s.hold > 0:
            s.hold -= 1
        s.stalled = s.stalled + 1 if s.hs * _row_rate(s, w) > 0.4 * STABILITY_LIMIT else 0
        if s.implicit and s.hold == 0 and s.stalled >= STALLED_STEPS:
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


@inlined
def _grow(s: Any, error: float) -> float:
    """Factor for the next step from the error of this one, by the order of the method that took it."""
    order = 8.0 if s.method == EXPLICIT else 4.0
    most = 6.0 if s.method == EXPLICIT else 4.0
    if error == 0.0:
        return most
    return float(min(most, max(0.25, SAFETY * error ** (-1.0 / order))))


@inlined
def _short_step(K: Any, s: Any, m: Model, w: Work) -> bool:
    """Go to the next tick by the low-order method, if the tick is short against the motion and the error allows."""
    h = s.stop - s.t
    if s.hold_short > 0:
        s.hold_short -= 1
        return False
    if h > SHORT_PART * min(s.h, s.h_max) or h < 4.0 * machine.ULP * abs(s.t):
        return False
    if not bogacki.step(K, s, m, w, h) <= 1.0:
        s.hold_short = HOLD_SHORT
        return False
    s.method, s.end, s.hs = SHORT, bogacki.LAST, h
    return True


@inlined
def _attempt(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Take one step of the present method within the tolerance; y1 and the end's derivative are there afterwards."""
    s.have_dense = 0
    if s.has_control and s.method == EXPLICIT and _short_step(K, s, m, w):
        return _finish(K, s, m, w)
    s.end = esdirk.STAGES - 1 if s.method == IMPLICIT else STAGES
    clipped = False
    rejected = False
    ill = 0
    for _ in range(MAX_REJECTIONS):
        h = min(s.h, s.h_max)
        left = s.stop - s.t
        clipped = h >= left or left - h < 0.01 * h
        if clipped:
            h = left
        if h < 4.0 * machine.ULP * abs(s.t):
            break
        error = dop853.step(K, s, m, w, h) if s.method == EXPLICIT else esdirk.step(K, s, m, w, b.mode, h)
        if 0.0 <= error <= 1.0:
            s.hs = h
            proposal = h * min(_grow(s, error), 1.0 if rejected else 6.0)
            s.h = max(s.h, proposal) if clipped and not rejected else proposal
            return _finish(K, s, m, w)
        s.rejected += 1
        rejected = True
        if error > 1.0 and error < 1e300:
            s.h = h * _grow(s, error)
        else:
            ill = 1 if error == -1.0 else 2
            s.h = 0.25 * h
    if ill == 1:
        return ILL_POSED
    return NOT_FINITE if ill == 2 else STEP_TOO_SMALL


@inlined
def _finish(K: Any, s: Any, m: Model, w: Work) -> int:
    """Evaluate the end of the step: derivative, multipliers, gaps."""
    n = s.n
    last = NODES - 1
    end = s.end
    t = s.t + s.hs
    # Anew after an implicit step too: lam is then the law's at y1, not what Newton's residue makes of it.
    if s.method != SHORT and dop853.derivative(K, s, m, w, t, w.y1, end) != 0:
        return ILL_POSED
    scatter(s, w, w.lams[last])
    K.gaps(t, w.y1[:n], w.y1[n:], m.p, w.gaps[last], w.rates[last])
    for i in range(s.nc):
        w.lams[0, i] = w.lam0[i]
        if not (np.isfinite(w.gaps[last, i]) and np.isfinite(w.rates[last, i]) and np.isfinite(w.lams[last, i])):
            return NOT_FINITE
    for i in range(2 * n):
        if not np.isfinite(w.k[end, i]):
            return NOT_FINITE
        if abs(w.y1[i]) > FAR:
            return DIVERGED
    s.t_old = s.t
    return 0


@inlined
def _take_arc(K: Any, s: Any, m: Model, w: Work, length: float) -> int:
    """One step in closed form."""
    s.method, s.end = EXACT, STAGES
    s.have_dense = 1
    s.hs = min(length, s.stop - s.t, s.h_max)
    exact.begin(K, s, m, w)
    exact.evaluate(s, w, s.hs, w.y1)
    s.exact_steps += 1
    if s.ledger:
        w.z1[:] = w.z
    return _finish(K, s, m, w)


@inlined
def _land(K: Any, s: Any, m: Model, w: Work) -> None:
    """End the step where the first guard fired."""
    dense.state(s, w, s.theta, w.y1)
    if s.ledger and s.method != EXACT:
        dense.ledger(s, w, s.theta, w.z1)


@inlined
def _take_over(s: Any, w: Work) -> None:
    """The end of the whole step becomes the start of the next."""
    last = NODES - 1
    end = s.end
    w.k[0] = w.k[end]
    w.kz[0] = w.kz[end]
    w.lam0[:] = w.lams[last]
    w.gaps[0] = w.gaps[last]
    w.rates[0] = w.rates[last]


@inlined
def _move(s: Any, w: Work, t: float) -> None:
    s.t = t
    w.y[:] = w.y1
    if s.ledger:
        w.z[:] = w.z1


@inlined
def _switch(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Apply the transitions that fired at the step's end and settle what follows from them."""
    n = s.n
    if s.natural:
        if dop853.derivative(K, s, m, w, s.t, w.y, dop853.START) != 0:
            return ILL_POSED
        scatter(s, w, w.lam0)
        record.here(K, s, m, w, b.mode, b.out, b.modes)
    K.gaps(s.t, w.y[:n], w.y[n:], m.p, w.gap, w.rate)
    machine.remember(s, b.history, b.mode)
    for i in range(s.nc):
        if w.hit[i] <= s.theta:
            after = events.after(s, m, w, b.mode, i, w.gap[i])
            machine.write_event(s, b.events_t, b.events, i, b.mode[i], after)
            b.mode[i] = after
    if machine.remember(s, b.history, b.mode):
        if s.one_by_one:
            return MODE_CYCLE
        s.one_by_one, s.history = 1, 0
    code = _restart(K, s, m, w, b)
    record.here(K, s, m, w, b.mode, b.out, b.modes)
    return code


@compiled
def _step(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """One step, cut short where a machine must switch."""
    length = exact.plan(s, w, m.unilateral)
    if length > 0.0:
        before = s.method
        code = _take_arc(K, s, m, w, length)
    else:
        if s.method == EXACT or s.method == SHORT:
            s.method = EXPLICIT
        before = s.method
        code = _attempt(K, s, m, w, b)
    if code != 0:
        return code
    s.steps += 1
    s.implicit_steps += s.method == IMPLICIT
    if events.scan(K, s, m, w, b.mode) != 0:
        return ILL_POSED
    fired = s.theta <= 1.0
    at_stop = s.t_old + s.hs >= s.stop - 4.0 * machine.ULP * abs(s.stop)
    t = s.t_old + s.theta * s.hs if fired else (s.stop if at_stop else s.t_old + s.hs)
    record.within_step(K, s, m, w, b.mode, b.samples, t, b.out, b.modes)
    if fired:
        _land(K, s, m, w)
        _remember_step(s, before)
        _move(s, w, t)
        return _switch(K, s, m, w, b)
    _take_over(s, w)
    _move(s, w, t)
    _remember_step(s, before)
    record.here(K, s, m, w, b.mode, b.out, b.modes)
    if s.method == EXPLICIT or s.method == IMPLICIT:
        _choose_method(s, w)
    if at_stop and s.stop < s.t_end:
        _take_inputs(K, s, m, w, b)
        code = _resume(K, s, m, w, b)
        record.here(K, s, m, w, b.mode, b.out, b.modes)
    return code


@inlined
def _remember_step(s: Any, method: int) -> None:
    """The step to start with when the same kind of motion begins again."""
    if method == EXPLICIT and s.method == EXPLICIT:
        if s.na > 0:
            s.h_active = s.h
        else:
            s.h_free = s.h


@inlined
def _begin_run(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    s.started = 1
    for i in range(s.nc):
        s.switching |= m.unilateral[i]
    s.history_t = np.inf
    _take_inputs(K, s, m, w, b)
    code = _restart(K, s, m, w, b)
    if code == 0:
        record.here(K, s, m, w, b.mode, b.out, b.modes)
        while s.next_sample < len(b.samples) and b.samples[s.next_sample] <= s.t:
            record.write_row(K, s, m, w, b.mode, s.t, w.y, w.lam0, w.z, b.out, b.modes)
            s.next_sample += 1
    return code


@inlined
def _room(s: Any, b: Buffers) -> int:
    """Whether the next step finds room for all that it may write."""
    if s.natural and s.rows + record.ARC_POINTS + 4 > len(b.out):
        return ROWS_FULL
    return EVENTS_FULL if s.events + 16 * s.nc + 16 > len(b.events_t) else DONE


def advance(
    dynamics: Any, gaps: Any, rows: Any, energy: Any, power: Any, solve: Any, control: Any,
    state: Any, model: Index, work: Index, buffers: Index, budget: int,
) -> int:  # fmt: skip
    """Go on for at most `budget` steps.

    The seven kernels are the mechanism's, `state` is a record of `layout.STATE`, and model, work and buffers are the
    tables of the bundles in `layout`.

    Returns:
        DONE at the horizon, MORE after the budget, ROWS_FULL or EVENTS_FULL where the caller must grow a buffer,
        or a negative code for a numerical failure. All that is needed to go on is in the arguments.
    """
    s = state[0]
    K = Kernels(dynamics, gaps, rows, energy, power, solve, control)
    m, w, b = open_model(model), open_work(work), open_buffers(buffers)
    if not s.started:
        code = _begin_run(K, s, m, w, b)
        if code != 0:
            return code
    for _ in range(budget):
        if s.t >= s.t_end:
            return DONE
        room = _room(s, b)
        if room != 0:
            return room
        code = _step(K, s, m, w, b)
        if code != 0:
            return code
    return DONE if s.t >= s.t_end else MORE
