"""Event iteration: what is switched at one instant, until nothing changes any more."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import GENERAL, accelerate, is_active
from crossbody.reference.core.algebra import copy
from crossbody.reference.core.collisions import collide
from crossbody.reference.core.friction import BEGIN, DECIDE, NOTHING, SETTLED, ask, has_friction, is_decided
from crossbody.reference.core.holding import MOVED, doubtful, hold
from crossbody.reference.core.journal import change, keep_discrete, move, remember, write_discrete
from crossbody.reference.core.layout import (
    EDGE,
    FREE,
    ILL_POSED,
    LEVEL,
    LOST,
    MEMORYLESS,
    MODE_CYCLE,
    Buffers,
    Model,
    Work,
)
from crossbody.reference.core.machine import (
    active_mode,
    change_of_acceleration,
    evaluate,
    next_mode,
    noise,
    released_mode,
    touching,
)
from crossbody.reference.kernels import LOST as IS_LOST
from crossbody.reference.kernels import TOUCHED, UNCHANGED

SAME_CHANGE = 1e-9  # part by which changes of v' may differ and count as equal: rounding does not choose
ALONE = np.int64(2)  # of one_by_one: rows join one after another, however alike
SWITCH_ROUNDS = 32  # switches that follow one another at one instant


@compiled
def _want(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> None:
    """Where every row belongs by the mode set as it stands, into w.struck; of a machine that pivots, the first alone.

    The others than the level machine pivot by least index, as a complementarity problem is solved.
    """
    mode, struck, gap, level, touch = b.mode, w.struck, w.gap, s.fsm == LEVEL, s.touch
    for i in range(s.nc):
        struck[i] = mode[i]
    for i in range(s.nc):
        now = mode[i]
        apart = level and now == FREE and gap[i] > touch  # most rows: they stay so
        if not apart and m.unilateral[i] and m.follows[i] < 0:
            struck[i] = next_mode(K, s, m, w, mode, i)
            if not level and struck[i] != now:
                return


@compiled
def _keep_strongest(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> None:
    """Of the rows that want to switch let those that only change their name, else those that change v' most.

    Rows that change it equally switch together, so that their order does not choose; where they depend on each other it
    has to, and the first one switches alone. The changes stand in w.hit.
    """
    most, alone = -1.0, s.one_by_one == ALONE
    for i in range(s.nc):
        if w.struck[i] != b.mode[i]:
            w.hit[i] = np.inf
            if is_active(b.mode[i]) or is_active(w.struck[i]):
                w.hit[i] = change_of_acceleration(K, s, m, w, b.mode, i)
            most = max(most, w.hit[i])
    for i in range(s.nc):
        if w.struck[i] != b.mode[i]:
            if not w.hit[i] >= most * (1.0 - SAME_CHANGE):
                w.struck[i] = b.mode[i]
            elif alone:
                most = np.inf


@compiled
def _pass(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Switch every row that wants to (only the strongest once all together repeated); how many did.

    All are judged before any is switched, so that the order of the rows does not matter.
    """
    count = 0
    changed = b.history[len(b.history) - 1]
    _want(K, s, m, w, b)
    if s.one_by_one and s.fsm == LEVEL:
        _keep_strongest(K, s, m, w, b)
    mode, struck = b.mode, w.struck
    for i in range(s.nc):
        if struck[i] != mode[i]:
            if s.frictional and is_active(b.mode[i]):
                w.let_go[i] = s.t
            move(s, b, i, w.struck[i])
            changed[i] = 1
            count += 1
    return count


@compiled
def _consistent(K: Any, s: Any, m: Model, w: Work) -> None:
    """What a machine asks for besides `evaluate`: the general algebra's rows and the noise of the multipliers."""
    if s.fsm != EDGE and s.na > 0:
        if s.has_solve:
            accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[: s.nq], w.y[s.nq :], GENERAL)
        noise(s, m, w)


@compiled
def share(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Let the rows in contact share what they carry, and evaluate them; MOVED if some let go instead, or a code.

    Leaves k[0], lam0 and the gaps of node 0 for the next step, as `settle` does.
    """
    before, s.lenient = s.lenient, np.inf
    code = hold(K, s, m, w, b)
    if code == 0:
        code = evaluate(K, s, m, w, b.mode)
        _keep(w)
    s.lenient = before
    return int(code)


@compiled
def _keep(w: Work) -> None:
    """Take multipliers, gaps and rates of the present instant for the start of the next step."""
    copy(w.lam, w.lam0)
    copy(w.gap, w.gaps[0])
    copy(w.rate, w.rates[0])


@compiled
def _decide_friction(s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Put every contact in the mode that the present instant asks for, after it was evaluated.

    Returns:
        0, or NO_CONSISTENT_MODES or PAINLEVE; with one of these the last line of the history marks contacts.
    """
    code = int(ask(DECIDE, s, m, w, NOTHING))
    for i in range(s.nc):
        if code != 0:
            b.history[len(b.history) - 1, i] = w.wants[i]
        elif is_decided(w, i) and is_active(b.mode[i]):
            after = w.state[i] if has_friction(m, i) else b.mode[i]
            if w.state[i] == FREE:
                after, w.let_go[i] = released_mode(b.mode[i], w.gap[i]), s.t
            if after != b.mode[i]:
                change(s, b, i, after)
    return code


@compiled
def _bars(s: Any, m: Model, w: Work, b: Buffers) -> bool:
    """Bar a contact that lets go for ever as long as it may press, if others may carry on for it; whether there is one.

    The share of least norm leaves it no load, but without it there is another such share, under which it presses.
    """
    if not s.frictional or s.dependent_rows == 0 or s.barred != 0:
        return False
    for i in range(s.nc):
        if has_friction(m, i) and is_active(b.mode[i]) and not is_active(w.settled[i]):
            s.barred = i + 1
    return bool(s.barred != 0)


@compiled
def _decide_together(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Decide once on all rows that take turns, whether they press or not; 0, a code, or MODE_CYCLE if they go on.

    Of rows that press and let go in turn each one decision has seen a part: one on all knows what is consistent.
    """
    if not s.frictional or s.fsm != LEVEL:
        return int(MODE_CYCLE)
    for i in range(s.nc):
        if b.history[len(b.history) - 1, i] and is_decided(w, i) and not is_active(b.mode[i]):
            change(s, b, i, active_mode(s, m, w, i))
    code = evaluate(K, s, m, w, b.mode)
    if code == 0:
        code = _decide_friction(s, m, w, b)
    if code == 0:
        code = evaluate(K, s, m, w, b.mode)
    if code != 0:
        return int(code)
    _consistent(K, s, m, w)
    _want(K, s, m, w, b)
    for i in range(s.nc):
        if w.struck[i] != b.mode[i]:
            return int(MODE_CYCLE)
    return 0


@compiled
def _iterate(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Collide and switch until the mode set is consistent; 0 or a code."""
    changed = b.history[len(b.history) - 1]
    changed[:] = 0
    remember(s, b)
    events, joined = s.events, False
    while True:
        code = evaluate(K, s, m, w, b.mode)
        if s.frictional and code == 0:
            code = _decide_friction(s, m, w, b)
            if code == 0:
                code = evaluate(K, s, m, w, b.mode)
        if s.sharing and (code == ILL_POSED or s.idle > 0 or (s.na > 1 and doubtful(s, w))):
            code = share(K, s, m, w, b)
            if code == MOVED:
                continue
        if code == ILL_POSED and joined and s.fsm == LEVEL and s.one_by_one != ALONE:
            # Rows that joined together depend on each other: back, and one by one. What is left closes by itself.
            copy(w.settled, b.mode)
            s.events, s.one_by_one, joined = events, ALONE, False
            continue
        if code != 0:
            return int(code)
        _consistent(K, s, m, w)
        copy(b.mode, w.settled)
        events, joined = s.events, True
        if _pass(K, s, m, w, b) == 0:
            if not s.frozen:
                return 0
            struck = s.collisions
            code = collide(K, s, m, w, b)
            if code != 0 or s.collisions == struck:
                return int(code)
            s.history, s.one_by_one = 0, 0  # another velocity: mode sets may stand again
            continue
        if remember(s, b):
            if s.one_by_one and _bars(s, m, w, b):
                s.history = 0
                continue
            if s.one_by_one:  # the set that stands again is the one of rows that depend on each other, or a cycle
                code = evaluate(K, s, m, w, b.mode) if s.one_by_one == ALONE else 0
                return int(code) if code != 0 else _decide_together(K, s, m, w, b)
            s.one_by_one, s.history = 1, 0
            changed[:] = 0


@compiled
def begin(s: Any, m: Model, w: Work) -> None:
    """Note whether rows switch, and which of them may share a load with rows that they depend on.

    A row that another follows has no part in it: the other's multiplier has either sign. Nor have machines but the
    level one, collisions that take no time, and systems with an algebra of their own.
    """
    w.idle_rows[:], w.spent[:], w.let_go[:], s.jumps = 0, 0, -np.inf, 1
    if s.frictional:
        ask(BEGIN, s, m, w, NOTHING)
    may = s.fsm == LEVEL and not s.frozen and not s.has_solve and not s.frictional
    for i in range(s.nc):
        w.order[i] = i
        s.switching |= m.unilateral[i]
        w.shares[i] = may and m.unilateral[i] and m.follows[i] < 0
    for i in range(s.nc):
        if m.follows[i] >= 0:
            w.shares[m.follows[i]] = 0
    for i in range(s.nc):
        s.sharing |= w.shares[i]


@compiled
def switch(K: Any, s: Any, m: Model, w: Work, b: Buffers, fired: int) -> int:
    """Let the mechanism change its discrete variables; UNCHANGED, CHANGED or LOST of the kernels."""
    keep_discrete(s, m, w, b)
    result = K.switch(s.t, w.y[: s.nq], w.y[s.nq :], m.p, b.mode, fired)
    write_discrete(s, m, w, b)
    s.have_free = 0
    return int(result)


@compiled
def begin_watch(K: Any, s: Any, m: Model, w: Work) -> None:
    """Guards of the discrete variables at the start of the next step."""
    if s.ng > 0:
        K.watch(s.t, w.y[: s.nq], w.y[s.nq :], m.p, w.guards[0])


@compiled
def settle(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Iterate until modes and discrete variables agree; leaves k[0], lam0, gaps and guards of node 0 for the next step.

    Returns:
        0, EVENTS_FULL if the caller must make room and come again, or a negative code. After MODE_CYCLE the last line
        of the history marks the rows that switch forever.
    """
    s.lenient, s.barred = np.inf if s.frictional else 1.0, 0
    if s.frozen or s.frictional or s.fsm == MEMORYLESS:
        s.touch = touching(s, w)
    code = _iterate(K, s, m, w, b)
    rounds = 0
    while code == 0 and s.has_switch:
        result = switch(K, s, m, w, b, TOUCHED)
        if result == IS_LOST:
            return LOST
        if result == UNCHANGED:
            break
        rounds += 1
        if rounds > SWITCH_ROUNDS:
            return MODE_CYCLE
        s.history, s.one_by_one = 0, 0
        code = _iterate(K, s, m, w, b)
    w.spent[:] = 0
    _keep(w)
    if s.frictional and code == 0:
        code = evaluate(K, s, m, w, b.mode)
        ask(SETTLED, s, m, w, NOTHING)
    if s.frictional:
        s.touch = 0.0
    begin_watch(K, s, m, w)
    s.lenient = np.inf
    return int(code)
