"""The transitions that fired at a step's end, and whether contacts jam there: once an event, as `instant` asks."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core import events, guards, journal, settle
from crossbody.reference.core.acceleration import GENERAL, accelerate, activate, is_active, scatter
from crossbody.reference.core.friction import (
    BEGIN_SLIP,
    DETERMINANT,
    DIES_INTO_JAM,
    NEAR_JAM,
    NOTHING,
    ask,
    has_friction,
    is_dry,
)
from crossbody.reference.core.jams import JAMMING
from crossbody.reference.core.layout import (
    BALLISTIC,
    FREE,
    LOST,
    MODE_CYCLE,
    PAINLEVE,
    SLIP,
    STANDSTILL,
    STICK,
    Buffers,
    Model,
    Work,
)
from crossbody.reference.core.machine import active_mode
from crossbody.reference.core.stops import presses_alone
from crossbody.reference.kernels import LOST as IS_LOST


@compiled
def fire(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Apply the transitions that fired at the step's end; a code where nothing can follow from them."""
    journal.remember(s, b)
    moved, touched, stopped, drifts, caught = False, False, False, False, False
    s.jam = s.frictional and _slip_or_jam(K, s, m, w, b)
    if s.frictional and s.standing > STANDSTILL + s.nc:  # ever sooner before a jam: what goes on is clear of it
        s.jam = s.jam or jams(K, s, m, w, b)
    if s.frictional and _stops_in_a_jam(K, s, m, w, b):
        if presses_alone(s, m, w):
            return PAINLEVE
        s.jam = True  # others may go on without it, and no law says which
    for i in range(s.nc):
        if w.hit[i] <= s.theta:
            after = events.after(s, m, w, b.mode, i, w.gap[i])
            stopped = stopped or events.stops(s, m, w, i)
            drifts = drifts or w.kind[i] == guards.DRIFT
            caught = caught or w.kind[i] == guards.CATCH
            if s.frictional and w.kind[i] == guards.RELEASE and not has_friction(m, i):
                w.let_go[i] = s.t
            if after != b.mode[i]:
                touched = touched or b.mode[i] == FREE
                journal.move(s, b, i, after)
                moved = True
    for i in range(s.nc if stopped else 0):
        if events.stops_too(s, m, w, b.mode, i):
            journal.move(s, b, i, STICK)
    s.drifts = drifts
    for i in range(s.nc if caught else 0):
        if events.catches_too(K, s, m, w, b.mode, i):
            journal.move(s, b, i, active_mode(s, m, w, i))
    for i in range(s.nc if touched else 0):
        if events.touches_too(s, m, w, b.mode, i):
            journal.move(s, b, i, active_mode(s, m, w, i))
    if moved and journal.remember(s, b):
        if s.one_by_one and s.standing > STANDSTILL:
            return PAINLEVE if s.frictional and all_jam(K, s, m, w, b) else MODE_CYCLE
        s.one_by_one, s.history = 1, 0
    for i in range(s.ng):
        if w.guard_hit[i] <= s.theta:
            s.jumps = 1
            if settle.switch(K, s, m, w, b, np.int64(i)) == IS_LOST:
                return LOST
    return 0


@compiled
def _slip_or_jam(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> bool:
    """Let contacts that begin to slide do so against what held them; whether some have jammed.

    One that lets go where it pulls has jammed if its force has changed its sign through infinity. Leaves in s.jumps
    whether loads jump: not where a force reaches its bound or vanishes.
    """
    slips, jam, released, s.jumps, s.near_jam = False, False, False, 0, 0
    for i in range(s.nc):
        if w.hit[i] <= s.theta:
            s.jumps |= w.kind[i] not in (guards.CONE, guards.RELEASE, guards.LEAVE)
            jam = jam or (w.kind[i] == guards.JAM and not events.stops(s, m, w, i))
            slips = slips or w.kind[i] == guards.CONE
            released = released or (w.kind[i] == guards.RELEASE and b.mode[i] == SLIP)
    nq, known = s.nq, slips or released
    if known and accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[:nq], w.y[nq:], GENERAL) == 0:
        scatter(s, w, w.lam0)
        pulls = events.pulling(s, m, w, b.mode) if released else -1
        jam = jam or (pulls >= 0 and w.kind[pulls] == guards.RELEASE and ask(DETERMINANT, s, m, w, pulls) <= 0.0)
        if slips:
            ask(BEGIN_SLIP, s, m, w, NOTHING)
        s.near_jam = ask(NEAR_JAM, s, m, w, NOTHING) > 0.0
    return jam


@compiled
def _stops_in_a_jam(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> bool:
    """Whether a contact whose slip comes to its end jams first, too slow for any step to see; it marks this one."""
    nq, known = s.nq, False
    for i in range(s.nc):
        if not (w.hit[i] <= s.theta and m.tangents[i] > 1 and events.stops(s, m, w, i)):
            continue
        if not known and accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[:nq], w.y[nq:], GENERAL) != 0:
            return False
        known = True
        if ask(DIES_INTO_JAM, s, m, w, i) > 0.0:
            journal.blame(b, i)
            return True
    return False


@compiled
def all_jam(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> bool:
    """Whether contacts that let go in turn would jam, or nearly, if all pressed that close, or all but one of them.

    It marks these. Without a row that lets go others may jam that go on beside it.
    """
    for i in range(s.nc):
        closes = has_friction(m, i) and b.mode[i] == BALLISTIC and w.gap[i] <= 0.0 and w.rate[i] < 0.0
        if closes and not is_dry(m, i):
            b.mode[i] = active_mode(s, m, w, i)
    activate(s, m, w, b.mode)
    if jams(K, s, m, w, b):
        return True
    marks = b.history[len(b.history) - 1]
    for i in range(s.nc):
        if marks[i] and m.unilateral[i] and not is_dry(m, i) and is_active(b.mode[i]):
            before = b.mode[i]
            b.mode[i] = BALLISTIC
            activate(s, m, w, b.mode)
            jam = jams(K, s, m, w, b)
            b.mode[i] = before
            activate(s, m, w, b.mode)
            if jam:
                return True
    return False


@compiled
def jams(K: Any, s: Any, m: Model, w: Work, b: Buffers) -> bool:
    """Whether contacts that slide jam, or come near to it; it marks these, and leaves other marks where none does.

    Before they jam their forces grow without bound, so that no step is short enough, unless what drives them vanishes
    as well.
    """
    nq, found, marks = s.nq, False, b.history[len(b.history) - 1]
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[:nq], w.y[nq:], GENERAL) == 0:
        for i in range(s.nc):
            slides = has_friction(m, i) and b.mode[i] == SLIP and not is_dry(m, i)
            if slides and ask(DETERMINANT, s, m, w, i) < JAMMING:
                if not found:
                    marks[:] = 0
                marks[i], found = 1, True
    return found
