"""The loop: step, watch, switch, record. It allocates nothing and returns to Python between slices of steps."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core import (
    audit,
    choice,
    cones,
    dense,
    dop853,
    events,
    exact,
    folds,
    instant,
    journal,
    peaks,
    record,
    settle,
    stepping,
    touches,
)
from crossbody.reference.core.acceleration import scatter
from crossbody.reference.core.algebra import ULP, all_finite, copy
from crossbody.reference.core.friction import NOTHING, RENEW, ask
from crossbody.reference.core.holding import MOVED
from crossbody.reference.core.layout import (
    DONE,
    EVENTS_FULL,
    EXACT,
    EXPLICIT,
    ILL_POSED,
    IMPLICIT,
    INCONSISTENT,
    LOST,
    MODE_CYCLE,
    MORE,
    NO_CONSISTENT_MODES,
    NODES,
    NOT_FINITE,
    PAINLEVE,
    ROWS_FULL,
    SHORT,
    STANDSTILL,
    STEP_TOO_SMALL,
    TOO_LONG,
    Buffers,
    Model,
    Work,
    open_buffers,
    open_kernels,
    open_model,
    open_work,
)
from crossbody.reference.core.others import note_first
from crossbody.reference.kernels import GIVEN, START
from crossbody.reference.kernels import LOST as IS_LOST
from crossbody.reference.kinds import Index

AT_STOP = 4.0  # units of rounding beside a stop in which no step fits: what comes so near has come to it
STILL = 4096.0  # units of rounding by which time does not go on: before a jam contacts switch ever sooner
SHORTER = 0.1  # the least part of a step that is taken anew, wherever in it something fires


@compiled
def _take_inputs(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> None:
    """Put the inputs that hold from now on in force and find the next instant at which they change."""
    s.have_free = 0
    while s.next_input < len(b.inputs_t) and b.inputs_t[s.next_input] <= s.t:
        before = s.next_input - 1
        for i in range(s.nu):  # by its change, so that what a controller holds on top stays
            w.u[i] += b.inputs_u[s.next_input, i] - (b.inputs_u[before, i] if before >= 0 else 0.0)
        s.next_input += 1
    if s.has_control and s.next_tick * s.tick <= s.t:
        K.control(s.t, w.y[: s.nq], w.y[s.nq :], w.u, w.s, m.p)
        s.next_tick += 1
    s.stop = s.t_end
    if s.next_input < len(b.inputs_t):
        s.stop = min(s.stop, b.inputs_t[s.next_input])
    if s.has_control:
        s.stop = min(s.stop, s.next_tick * s.tick)
    if s.kinks > 0:
        first = len(m.p) - s.nu
        m.p[first - 1] = s.rtol
        for i in range(s.nu):
            m.p[first + i] = w.u[i]
        settle.switch(K, s, m, w, b, GIVEN)


@compiled
def _restart(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Settle the modes at the present instant and choose how to go on."""
    s.unsettled = 1
    code = instant.ask(instant.SETTLE, K, s, m, w, b)
    if code != 0:
        return int(code)
    s.unsettled, s.jumps, s.watched, s.drifts = 0, 1, 0, 0
    peaks.forget(s, w, b.mode)
    s.method = EXPLICIT
    s.stalled, s.hold, s.full_jacobian = 0, 0, 0
    s.h = s.h_active if s.na > 0 else s.h_free
    return ILL_POSED if s.loops and folds.begin(K, s, m, w) != 0 else 0


@compiled
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
    settle.begin_watch(K, s, m, w)
    return 0


@compiled
def _land(K: Any, s: Any, m: Model, w: Work) -> None:
    """End the step where the first guard fired."""
    dense.state(s, m, w, s.theta, w.y1)
    dense.put_on_rows(K, s, m, w, s.theta, w.y1, dense.ARRIVED)
    if s.ledger and s.method != EXACT:
        dense.ledger(s, w, s.theta, w.z1)


@compiled
def _take_over(s: Any, w: Work) -> None:
    """The end of the whole step becomes the start of the next."""
    last = NODES - 1
    end = s.end
    copy(w.k[end], w.k[0])
    copy(w.kz[end], w.kz[0])
    copy(w.lams[last], w.lam0)
    copy(w.gaps[last], w.gaps[0])
    copy(w.rates[last], w.rates[0])
    copy(w.guards[last], w.guards[0])
    if s.watched:
        copy(w.cones[last], w.cones[0])


@compiled
def _move(s: Any, w: Work, t: float) -> None:
    s.t = t
    copy(w.y1, w.y)
    if s.ledger:
        copy(w.z1, w.z)


@compiled
def _switch(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Apply the transitions that fired at the step's end and settle what follows from them."""
    nq = s.nq
    if s.natural:
        if dop853.derivative(K, s, m, w, s.t, w.y, dop853.START) != 0:
            return ILL_POSED
        scatter(s, w, w.lam0)
    K.gaps(s.t, w.y[:nq], w.y[nq:], m.p, w.gap, w.rate)
    if not (s.frictional and events.pulling(s, m, w, b.mode) >= 0):
        record.here(K, s, m, w, b.mode, b.out, b.modes, False)
    code = instant.ask(instant.FIRE, K, s, m, w, b)
    if code != 0:
        return int(code)
    code = _restart(K, s, m, w, b)
    jam, s.jam = s.jam, 0
    if jam and code == NO_CONSISTENT_MODES:
        return PAINLEVE
    if s.frictional and code == MODE_CYCLE and instant.ask(instant.ALL_JAM, K, s, m, w, b) != 0:
        return PAINLEVE
    if jam and code == 0:
        _leave_open(s)
    if s.frictional and code == 0 and journal.chatters(s, m, b):
        return MODE_CYCLE
    if s.near_jam and code == 0:
        note_first(s, True)
        s.not_unique += 1
    if code == 0 and s.audited:
        code = _audit(K, s, m, w, b)
    if code == 0:
        record.here(K, s, m, w, b.mode, b.out, b.modes, s.audited)
    return int(code)


@compiled
def _audit(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Close the energy account of all, and that of touches with friction; it is judged where it was asked for."""
    if s.frictional:
        touches.follow(s, m, w, b.mode)
    code = int(audit.account(K, s, m, w))
    return code if s.judged else 0


@compiled
def _sticks_too_hard(s: Any, m: Model, w: Work, b: Buffers) -> bool:
    """Whether a contact sticks by more than its bound though nothing has fired; it marks that."""
    i = cones.beyond_bound(s, m, w)
    if i >= 0:
        journal.blame(b, i)
    return bool(i >= 0)


@compiled
def _stuck(K: Any, s: Any, m: Model, w: Work, b: Buffers, code: int) -> int:
    """Have the step taken anew clear of a jam to which contacts are about to come, or say why time does not go on."""
    if not (s.frictional and instant.ask(instant.JAM, K, s, m, w, b) != 0):
        return code
    copy(b.mode, w.before)
    s.jam = 1
    found = _restart(K, s, m, w, b)
    s.jam, s.standing, same = 0, 0, True
    for i in range(s.nc):
        same = same and b.mode[i] == w.before[i]
    if found == 0 and not same:
        _leave_open(s)
        record.here(K, s, m, w, b.mode, b.out, b.modes, False)
        return TOO_LONG
    instant.ask(instant.JAM, K, s, m, w, b)  # it marks them
    return PAINLEVE


@compiled
def _leave_open(s: Any) -> None:
    """Note that from the present instant on other modes go on where contacts jammed, and no law says which."""
    if not s.indeterminate:
        s.indeterminate, s.determined_until = 1, s.t


@compiled
def _try(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """One step or one arc in closed form, and what switches first in it; what ends the run, or has it taken anew."""
    length = exact.plan(s, w, m.unilateral)
    if length > 0.0:
        code = stepping.take_arc(K, s, m, w, b, length)
    else:
        if s.method == EXACT or s.method == SHORT:
            s.method = EXPLICIT
        code = stepping.attempt(K, s, m, w, b)
    if code in (STEP_TOO_SMALL, NOT_FINITE, ILL_POSED):
        return _stuck(K, s, m, w, b, code)
    if code != 0:
        return code
    code = events.scan(K, s, m, w, b.mode)
    if code == TOO_LONG:
        s.rejected += 1
        s.h, s.watched = max(s.theta, SHORTER) * s.hs, 0
        return TOO_LONG
    s.steps += 1
    s.implicit_steps += s.method == IMPLICIT
    if code != 0:
        return _stuck(K, s, m, w, b, code) if code == NOT_FINITE else int(code)
    return NOT_FINITE if s.ng > 0 and not all_finite(w.guards[NODES - 1]) else 0


@compiled
def _step(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """One step, cut short where a machine must switch."""
    if s.stop - s.t <= AT_STOP * ULP * abs(s.stop):
        return _stop_at_once(K, s, m, w, b)
    code = _try(K, s, m, w, b)
    if code != 0:
        return 0 if code == TOO_LONG else int(code)
    fired = s.theta <= 1.0
    at_stop = s.t_old + s.hs >= s.stop - AT_STOP * ULP * abs(s.stop)
    t = s.t_old + s.theta * s.hs if fired else (s.stop if at_stop else s.t_old + s.hs)
    before_rows = s.rhs
    record.within_step(K, s, m, w, b.mode, b.samples, t, b.out, b.modes)
    s.trial_rhs += s.rhs - before_rows  # what is written down is no work of the method, and chooses none
    s.standing = s.standing + 1 if fired and t - s.t_old <= STILL * ULP * abs(t) else 0
    if s.standing > STANDSTILL + s.nc + 1:
        code = _stuck(K, s, m, w, b, STEP_TOO_SMALL)
        return 0 if code == TOO_LONG else code
    if not fired:
        return _arrive(K, s, m, w, b, t, at_stop)
    _land(K, s, m, w)
    _remember_step(s)
    _move(s, w, t)
    return _switch(K, s, m, w, b)


@compiled
def _arrive(K: Any, s: Any, m: Model, w: Work, b: Buffers, t: float, at_stop: bool) -> int:
    """Go on from the end t of a whole step: nothing has fired in it."""
    if s.frictional and _sticks_too_hard(s, m, w, b):
        return INCONSISTENT
    _take_over(s, w)
    _move(s, w, t)
    _remember_step(s)
    if s.frictional and (ask(RENEW, s, m, w, NOTHING) > 0.0 or s.parting) and not at_stop:
        s.theta = 1.0
        return _switch(K, s, m, w, b)
    code = _audit(K, s, m, w, b) if s.audited else 0
    if code != 0:
        return int(code)
    record.step_end(K, s, m, w, b.mode, b.out, b.modes)
    if s.method == EXPLICIT or s.method == IMPLICIT:
        choice.choose_method(s, w)
    if s.idle > 0 or (s.parting and not s.frictional):
        code = _share_anew(K, s, m, w, b)
    if at_stop and s.stop < s.t_end:
        return _go_on(K, s, m, w, b)
    return int(code)


@compiled
def _stop_at_once(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Go to the next stop where contacts have switched so near before it that no step fits between."""
    s.t = s.stop
    K.energy(w.y[: s.nq], w.y[s.nq :], m.p, w.e)
    record.samples_here(s, w, b.mode, b.samples, b.out, b.modes)
    if s.stop < s.t_end:
        return _go_on(K, s, m, w, b)
    record.here(K, s, m, w, b.mode, b.out, b.modes, True)
    return 0


@compiled
def _go_on(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Take the inputs that hold from the present instant on, at which a step has ended."""
    _take_inputs(K, s, m, w, b)
    code = _resume(K, s, m, w, b)
    if code == 0:
        record.here(K, s, m, w, b.mode, b.out, b.modes, False)
    return int(code)


@compiled
def _share_anew(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Ask anew which rows idle: they carry again where they would push, and must have followed their laws."""
    code = instant.ask(instant.SHARE, K, s, m, w, b)
    return _restart(K, s, m, w, b) if code == MOVED else code


@compiled
def _remember_step(s: Any) -> None:
    """The step to start with when the same kind of motion begins again."""
    if s.method == EXPLICIT:
        if s.na > 0:
            s.h_active = s.h
        else:
            s.h_free = s.h


@compiled
def _begin(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Settle the start and write it down, or go on with an instant that found no room for its events."""
    lost = False
    if not s.started:
        s.started = 1
        settle.begin(s, m, w)
        s.history_t, s.collision_t = np.inf, np.inf
        w.highest[:] = -np.inf
        lost = s.has_switch and settle.switch(K, s, m, w, b, START) == IS_LOST
        _take_inputs(K, s, m, w, b)
        if s.audited:
            audit.begin_account(K, s, m, w)
            w.touch_work[:] = np.inf
    code = _restart(K, s, m, w, b)
    if code != 0:
        return code
    if s.audited and s.frictional:
        touches.follow(s, m, w, b.mode)
    K.energy(w.y[: s.nq], w.y[s.nq :], m.p, w.e)
    record.here(K, s, m, w, b.mode, b.out, b.modes, True)
    record.samples_here(s, w, b.mode, b.samples, b.out, b.modes)
    return LOST if lost else 0


@compiled
def _room(s: Any, b: Buffers) -> int:
    """Whether the next step finds room for all that it may write."""
    if s.natural and s.rows + record.ARC_POINTS + s.nc + 4 > len(b.out):
        return ROWS_FULL
    return EVENTS_FULL if journal.full(s, b) else DONE


def advance(functions: Index, state: Any, model: Index, work: Index, buffers: Index, budget: int) -> int:
    """Go on for at most `budget` steps.

    `functions` has the addresses of the mechanism's kernels, `state` is a record of `layout.STATE`, and model, work and
    buffers are the tables of the bundles in `layout`.

    Returns:
        DONE at the horizon, MORE after the budget, ROWS_FULL or EVENTS_FULL where the caller must grow a buffer,
        or a negative code for a numerical failure: NOT_FINITE at the horizon too, if a row that was written is not. All
        that is needed to go on is in the arguments.
    """
    s = state[0]
    K, m, w, b = open_kernels(functions), open_model(model), open_work(work), open_buffers(buffers)
    if not s.started or s.unsettled:
        code = _begin(K, s, m, w, b)
        if code != 0:
            return code
    for _ in range(budget):
        if s.t >= s.t_end:
            break
        room = _room(s, b)
        if room != 0:
            return room
        code = _step(K, s, m, w, b)
        if code != 0:
            return code
    if s.t < s.t_end:
        return MORE
    return NOT_FINITE if s.spoilt else DONE
