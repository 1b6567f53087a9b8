"""What happened at an instant: transitions of rows, changes of discrete variables, mode sets that stood before."""

from __future__ import annotations

from typing import Any

from crossbody.reference.cache import compiled
from crossbody.reference.core.algebra import ULP, copy
from crossbody.reference.core.choice import pole
from crossbody.reference.core.layout import Buffers, Model, Work
from crossbody.reference.kinds import Bytes

FLURRY = 2048  # instants at which contacts switched (corners that take turns for some hundred may come to a jam),
FLURRY_PART = 0.1  # within this part of the time of the fastest law: a chatter


@compiled
def write_event(s: Any, b: Buffers, i: int, before: int, after: int, impulse: float) -> None:
    """Note one transition."""
    e = s.events
    if e < len(b.events_t):
        b.events_t[e] = s.t
        b.events[e, 0], b.events[e, 1], b.events[e, 2] = i, before, after
        b.impulses[e] = impulse
        s.events = e + 1


@compiled
def move(s: Any, b: Buffers, i: int, after: int) -> None:
    """Put row i in another mode, and note it."""
    write_event(s, b, i, b.mode[i], after, 0.0)
    b.mode[i] = after


@compiled
def change(s: Any, b: Buffers, i: int, after: int) -> None:
    """Put row i in another mode; where it has just been moved, at this instant, it was moved there at once."""
    e = s.events - 1
    while e >= 0 and b.events_t[e] == s.t:
        if b.events[e, 0] == i:
            b.events[e, 2] = after
            b.mode[i] = after
            return
        e -= 1
    move(s, b, i, after)


@compiled
def blame(b: Buffers, i: int) -> None:
    """Mark row i alone in the last line of the history, for the message of a run that ends."""
    marks = b.history[len(b.history) - 1]
    marks[:] = 0
    marks[i] = 1


@compiled
def remember(s: Any, b: Buffers) -> bool:
    """Note the mode set; whether it stood here at this instant before."""
    if abs(s.t - s.history_t) > 8.0 * ULP * abs(s.t):
        s.history, s.history_t, s.one_by_one = 0, s.t, 0
    for r in range(s.history):
        if _same(b.history[r], b.mode):
            return True
    if s.history < len(b.history) - 1:
        copy(b.mode, b.history[s.history])
        s.history += 1
        return False
    return True


@compiled
def chatters(s: Any, m: Model, b: Buffers) -> bool:
    """Count an instant at which contacts switched; whether many have come far faster than any law moves a gap.

    Modes that switch to and fro at once have no motion in the limit; the last line of the history marks their rows.
    """
    fastest = 0.0
    for i in range(s.nc):
        fastest = max(fastest, pole(m.alpha[i, 1], m.alpha[i, 0]))
    if (s.t - s.flurry_t) * fastest > FLURRY_PART:
        s.flurry, s.flurry_t = 0, s.t
    s.flurry += 1
    if s.flurry < FLURRY:
        return False
    marks = b.history[len(b.history) - 1]
    marks[:] = 0
    for e in range(max(0, s.events - FLURRY), s.events):
        marks[b.events[e, 0]] = 1
    return True


@compiled
def _same(one: Bytes, other: Bytes) -> bool:
    """Whether two mode sets are equal."""
    differing = 0
    for i in range(len(one)):
        differing += one[i] != other[i]
    return differing == 0


@compiled
def keep_discrete(s: Any, m: Model, w: Work, b: Buffers) -> None:
    """Copy the modes and the discrete variables, to see afterwards what a switch changed."""
    first = len(m.p) - s.latched - s.nd
    for j in range(s.nd):
        w.discrete[j] = m.p[first + j]
    for i in range(s.nc):
        w.before[i] = b.mode[i]


@compiled
def write_discrete(s: Any, m: Model, w: Work, b: Buffers) -> None:
    """Note what a switch changed."""
    first = len(m.p) - s.latched - s.nd
    for j in range(s.nd):
        e, before, after = s.switches, w.discrete[j], m.p[first + j]
        told = j < s.nd - s.kinks or before * after != 0.0  # 0: a kink whose side is not held
        if before != after and told and e < len(b.switches_t):
            b.switches_t[e] = s.t
            b.switches[e, 0], b.switches[e, 1], b.switches[e, 2] = j, int(before), int(after)
            s.switches = e + 1
    for i in range(s.nc):
        if w.before[i] != b.mode[i]:
            write_event(s, b, i, w.before[i], b.mode[i], 0.0)


@compiled
def full(s: Any, b: Buffers) -> bool:
    """Whether the next instant may not find room for its events; those not to be kept are counted and dropped."""
    room = 16 * s.nc + 16
    lacking = bool(s.events + room > len(b.events_t) or s.switches + 16 * s.nd > len(b.switches_t))
    if lacking and not s.keep_events:
        s.dropped += s.events
        s.events, s.switches = 0, 0
        return False
    return lacking
