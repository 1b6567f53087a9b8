"""Where inside the step just taken a machine must switch first.

Every step is watched on its dense output at its ends and at three points between. A fired transition is applied as
such, never decided again from a value at round-off.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core import dense, filters
from crossbody.reference.core.acceleration import OWN, accelerate, is_active, scatter
from crossbody.reference.core.algebra import ULP
from crossbody.reference.core.flight import free_flight
from crossbody.reference.core.friction import (
    JAMS,
    NOTHING,
    TURNS_ASIDE,
    WATCH,
    ask,
    decided_to,
    has_begun,
    has_friction,
    is_dry,
    least_slip,
    slip,
    slip_along,
    small_slip,
)
from crossbody.reference.core.guards import (
    CATCH,
    CONE,
    DRIFT,
    GRAZE,
    HANDOVER,
    JAM,
    LEAVE,
    NONE,
    PRESS,
    RELEASE,
    STOP,
    SWITCH,
    TOUCH,
    TOUCH_INSIDE,
    at_node,
    root,
)
from crossbody.reference.core.layout import (
    BALLISTIC,
    COLLISION,
    CONTACT,
    EDGE,
    EXACT,
    EXPLICIT,
    FREE,
    ILL_POSED,
    LEVEL,
    NEVER,
    NODES,
    NOT_FINITE,
    SLIP,
    STICK,
    TOO_LONG,
    Model,
    Work,
)
from crossbody.reference.core.machine import active_mode, known, off_law, released_mode, slow
from crossbody.reference.core.search import first_below, opens
from crossbody.reference.core.slips import dies_out
from crossbody.reference.kinds import Bytes

EARLY = 0.5  # part of a step before which a gap that opens again has been below zero for too few of its places
WITH_IT, BEFORE_IT = 1.2, 0.5  # of what a step up to an event is, that is taken anew with or without it
MATTERS = 1e3  # times as deep as a gap is known to, from which on what presses there is looked for by shorter steps
STEADY = 0.5  # part of what has no direction that a slip must have lost as fast as at its end: one that grazes has less
PULLS = 1e-6  # part of the largest force by which a contact pulls that is no rounding of where it lets go


@compiled
def _first(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """Earliest switching of row i under the level and the memoryless machine; its guard in kind[i]."""
    other = NONE
    if mode[i] == FREE:
        kind = TOUCH_INSIDE if w.gaps[0, i] <= s.touch else TOUCH
    elif is_active(mode[i]):
        kind = RELEASE
        if s.fsm != LEVEL:
            other = LEAVE
        elif mode[i] == COLLISION:
            other = HANDOVER
        elif mode[i] == STICK:
            other = CONE
        elif mode[i] == SLIP:
            other = STOP
    else:
        kind = LEAVE
        other = CATCH if s.fsm == LEVEL else PRESS
        if s.frozen and m.beta[i, 0] > 0.0:
            other = TOUCH_INSIDE  # it collides at once, whatever presses it
    dry = s.frictional and is_dry(m, i)  # it neither lets go nor jams
    w.kind[i] = NONE if dry else kind
    place = NEVER if dry else first_below(K, s, m, w, mode, kind, i)
    if other == CATCH and opens(s, w, i, min(place, 1.0)):
        return place
    if other != NONE:
        second = first_below(K, s, m, w, mode, other, i)
        if not second >= place:  # NaN too
            w.kind[i] = other
            place = second
    if other == CONE or (other == STOP and not dry):
        third = JAM if other == STOP else DRIFT
        second = first_below(K, s, m, w, mode, third, i)
        if not second >= place:
            w.kind[i] = third
            return second
    return place


@compiled
def _first_edge(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """The edge machine looks at the step's ends only, and only for what becomes true."""
    w.bands[:] = 0.0
    last = NODES - 1
    h0, h1, r0, r1 = w.gaps[0, i], w.gaps[last, i], w.rates[0, i], w.rates[last, i]
    if mode[i] == FREE and h0 > 0.0 >= h1:
        w.kind[i] = TOUCH
        return root(K, s, m, w, mode, TOUCH, i, 0.0, h0, 1.0, h1)
    if mode[i] == CONTACT and w.lams[0, i] >= 0.0 > w.lams[last, i]:
        w.kind[i] = RELEASE
        return root(K, s, m, w, mode, RELEASE, i, 0.0, max(w.lams[0, i], 1e-300), 1.0, w.lams[last, i])
    if mode[i] == BALLISTIC and h0 <= 0.0 < h1:
        w.kind[i] = LEAVE
        return root(K, s, m, w, mode, LEAVE, i, 0.0, max(-h0, 1e-300), 1.0, -h1)
    if mode[i] == BALLISTIC and max(h1, r1) < 0.0 and not (h0 <= 0.0 and r0 < 0.0):
        w.kind[i] = TOUCH_INSIDE
        return root(K, s, m, w, mode, TOUCH_INSIDE, i, 0.0, max(h0, r0, 1e-300), 1.0, max(h1, r1))
    return NEVER


@compiled
def _fill_nodes(K: Any, s: Any, m: Model, w: Work, multipliers: bool) -> int:
    """Gaps and rates, and the multipliers if asked, at the inner nodes; at the end as well where the rows move it."""
    for node in range(1, NODES if s.method == EXPLICIT and dense.long_for_rows(s) else NODES - 1):
        dense.state(s, m, w, at_node(node), w.ys)
        known = dense.put_on_rows(K, s, m, w, at_node(node), w.ys, dense.tolerated(s))
        t = s.t_old + at_node(node) * s.hs
        q, v = w.ys[: s.nq], w.ys[s.nq :]
        K.gaps(t, q, v, m.p, w.gaps[node], w.rates[node])
        s.guards += 1
        if multipliers:
            if not known and accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, q, v, OWN) != 0:
                return 1
            scatter(s, w, w.lams[node])
            if s.frictional:
                ask(WATCH, s, m, w, node)
    if s.frictional and multipliers:
        return _watch_ends(K, s, m, w)
    return 0


@compiled
def _watch_ends(K: Any, s: Any, m: Model, w: Work) -> int:
    """How far contacts are from sliding, and from jams, at the step's ends; what its last one has told holds still."""
    for node in range(NODES - 1 if s.watched else 0, NODES, NODES - 1):
        t, y = (s.t_old, w.y) if node == 0 else (s.t_old + s.hs, w.y1)
        if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, y[: s.nq], y[s.nq :], OWN) != 0:
            return 1
        ask(WATCH, s, m, w, node)
    s.watched = 1
    return 0


@compiled
def _scan_switches(K: Any, s: Any, m: Model, w: Work, mode: Bytes) -> int:
    """Take the discrete variables' guards into s.theta; 0 or a negative code."""
    watched = False
    K.watch(s.t_old + s.hs, w.y1[: s.nq], w.y1[s.nq :], m.p, w.guards[NODES - 1])
    for i in range(s.ng):
        w.guard_hit[i] = NEVER
        watched = watched or filters.switch_may_fire(s, w, i)
    if not watched:
        return 0
    if dense.prepare(K, s, m, w) != 0:
        return ILL_POSED
    for node in range(NODES - 1):
        dense.state(s, m, w, at_node(node), w.ys)
        K.watch(s.t_old + at_node(node) * s.hs, w.ys[: s.nq], w.ys[s.nq :], m.p, w.guards[node])
    for i in range(s.ng):
        w.guard_hit[i] = first_below(K, s, m, w, mode, SWITCH, i)
        if np.isnan(w.guard_hit[i]):
            return NOT_FINITE
        s.theta = min(s.theta, w.guard_hit[i])
    return 0


@compiled
def _all_free(s: Any, m: Model, mode: Bytes) -> bool:
    """Whether nothing but free flight in closed form is under way."""
    if s.method != EXACT or s.na > 0 or s.fsm == EDGE:
        return False
    others = 0
    for i in range(s.nc):
        others += m.unilateral[i] and m.follows[i] < 0 and mode[i] != FREE
    return others == 0


@compiled
def scan(K: Any, s: Any, m: Model, w: Work, mode: Bytes) -> int:
    """Set s.theta to the first switching in the step, NEVER if none, and hit[i] for all.

    Returns:
        0, TOO_LONG where the part s.theta of the step is taken in its place, or a negative code.
    """
    s.theta = NEVER
    if s.ng > 0:
        code = _scan_switches(K, s, m, w, mode)
        if code != 0:
            return int(code)
    any_gap, any_multiplier, watched = False, False, s.watched
    s.watched = 0
    hit, kind, unilateral, follows = w.hit, w.kind, m.unilateral, m.follows
    s.jammed = s.frictional and s.na > 0 and ask(JAMS, s, m, w, NODES - 1) < 0.0
    for i in range(s.nc):
        hit[i] = NEVER
        kind[i] = NONE
        leads = unilateral[i] and (follows[i] < 0 or follows[i] == i)
        if leads and not w.idle_rows[i] and filters.row_may_switch(s, m, w, mode, i):
            hit[i] = 1.0
            any_gap = True
            any_multiplier = any_multiplier or is_active(mode[i])
    if not any_gap:
        return 0
    if _all_free(s, m, mode):
        first = s.theta
        for i in range(s.nc):
            if hit[i] == 1.0:
                hit[i] = free_flight(s, w, i)
                first = min(first, hit[i])
        s.theta = first
        if s.theta <= 1.0:
            _tie(s, w)
        return 0
    s.watched = watched and any_multiplier
    if dense.prepare(K, s, m, w) != 0 or _fill_nodes(K, s, m, w, any_multiplier) != 0:
        return ILL_POSED
    for i in range(s.nc):
        if w.hit[i] == 1.0:
            if s.fsm == EDGE:
                w.hit[i] = _first_edge(K, s, m, w, mode, i)
            else:
                w.hit[i] = _first(K, s, m, w, mode, i)
            if np.isnan(w.hit[i]):
                return NOT_FINITE
            s.theta = min(s.theta, w.hit[i])
    if s.frictional and s.theta > 1.0 and _ends_beyond_zero(s, m, w, mode):
        s.theta = BEFORE_IT
        return TOO_LONG
    if s.theta <= 1.0:
        _tie(s, w)
        early = _leaves_early(s, w, mode)
        if early < EARLY:
            s.theta = WITH_IT * early
            return TOO_LONG
        if s.frictional:
            _stop_first(K, s, m, w, mode)
            if ask(TURNS_ASIDE, s, m, w, NOTHING) > 0.0:
                s.theta *= BEFORE_IT
                return TOO_LONG
    return 0


@compiled
def _leaves_early(s: Any, w: Work, mode: Bytes) -> float:
    """Where a gap that nothing presses shut, and that is below the surface, first passes out of it; NEVER if none does.

    Free flight may be one step of any length: in one so long its places show nothing of when the contact presses. Where
    another event comes before, that counts for a gap that goes far deeper than it is known to.
    """
    first = NEVER
    for i in range(s.nc if s.method != EXACT else 0):
        if w.kind[i] == LEAVE and mode[i] == BALLISTIC and w.hit[i] < first:
            depth = -0.25 * w.rates[0, i] * w.hit[i] * s.hs  # of a parabola
            below = w.gaps[0, i] < -known(s, w) or w.rates[0, i] < -slow(s, w, i)  # not by rounding, as one that rests
            if below and (w.hit[i] <= s.theta or depth > MATTERS * known(s, w)):
                first = w.hit[i]
    return float(first)


@compiled
def _ends_beyond_zero(s: Any, m: Model, w: Work, mode: Bytes) -> bool:
    """Whether a slip passes zero, and the step ends before it is known to stop: the next one could not tell where.

    One that turns, and loses less in a step than it may pass zero by, stops if it fell as steadily since it was slow.
    """
    for i in range(s.nc):
        if mode[i] == SLIP and has_friction(m, i) and not has_begun(w, i):
            start, end = slip_along(m, w, i, w.rates[0]), slip_along(m, w, i, w.rates[NODES - 1])
            below = GRAZE * least_slip(s)
            if -below <= end < 0.0 and start > below:
                return True
            if m.tangents[i] > 1 and -below <= end < 0.0 < start:
                part = start / (start - end)
                since = s.t_old + part * s.hs - w.within[i]
                if (start - end) * since > STEADY * least_slip(s) * s.hs:
                    w.hit[i], w.kind[i] = part, STOP
                    s.theta = min(s.theta, part)
    return False


@compiled
def _stop_first(K: Any, s: Any, m: Model, w: Work, mode: Bytes) -> None:
    """Let contacts stop whose slips turn as they die out, in place of what lets go or breaks loose beside them.

    As a slip turns through zero forces jump, for a time that is none: what follows from that no motion does. Which
    contacts go on is decided for all of them together, as at any stop. Leaves gaps and rates at s.theta in w.
    """
    dense.state(s, m, w, s.theta, w.ys)
    K.gaps(s.t_old + s.theta * s.hs, w.ys[: s.nq], w.ys[s.nq :], m.p, w.gap, w.rate)
    for i in range(s.nc):
        if m.tangents[i] > 1 and mode[i] == SLIP and dies_out(s, m, w, i):
            for k in range(s.nc):
                if k != i and w.hit[k] <= s.theta and w.kind[k] in (CONE, RELEASE):
                    w.hit[k], w.hit[i], w.kind[i] = NEVER, s.theta, STOP


@compiled
def _tie(s: Any, w: Work) -> None:
    """Rows that switch within rounding of the first switch together, at the last of them."""
    together = s.theta + 8.0 * ULP * max(abs(s.t_old) / s.hs, 1.0)
    for i in range(s.nc):
        if w.hit[i] <= together:
            s.theta = max(s.theta, w.hit[i])


@compiled
def touches_too(s: Any, m: Model, w: Work, mode: Bytes, i: int) -> bool:
    """Whether row i touches with another that has just been found to: it closes, and is as near as positions are known.

    What a touch exchanges may have third rows let go for good: rounding must not choose which of two comes first.
    Beside friction one that stands still touches too: a load shared by the corners that rounding alone has closing
    would have the others slide, however slowly, and slides jam.
    """
    if s.fsm != LEVEL or mode[i] != FREE or not m.unilateral[i] or m.follows[i] >= 0:
        return False
    collides = s.frozen and m.beta[i, 0] > 0.0
    most = slow(s, w, i) if s.frictional else -slow(s, w, i)
    return bool(not collides and w.rate[i] < most and abs(w.gap[i]) <= known(s, w))


@compiled
def catches_too(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> bool:
    """Whether contact i begins to press where another one just does, as two on an edge do: they share what presses.

    The rows still in contact are those before either. One of them alone would press for both, and rounding choose it.
    """
    closes = s.frictional and mode[i] == BALLISTIC and w.gap[i] <= 0.0 and w.rate[i] < 0.0
    return bool(closes and abs(off_law(K, s, m, w, i, s.t, w.y[: s.nq], w.y[s.nq :])) <= decided_to(s))


@compiled
def stops_too(s: Any, m: Model, w: Work, mode: Bytes, i: int) -> bool:
    """Whether contact i slides no faster than what has no direction, where another one stops: they stop together.

    Rounding has one of them stop first. One that has just begun to slide goes on.
    """
    slides = has_friction(m, i) and mode[i] == SLIP and not has_begun(w, i)
    return bool(slides and slip(m, w, i, w.rate) <= small_slip(s, w, i))


@compiled
def pulling(s: Any, m: Model, w: Work, mode: Bytes) -> int:
    """The contact that slides and pulls most, multipliers as in w.lam0; -1 if none does by more than rounding.

    It has let go before, or lets go here because its force jumps: forces with it are no motion's.
    """
    found, most, scale = -1, 0.0, 0.0
    for i in range(s.nc):
        scale = max(scale, abs(w.lam0[i]))
        if has_friction(m, i) and mode[i] == SLIP and not is_dry(m, i) and w.lam0[i] < most:
            found, most = i, w.lam0[i]
    return found if most < -PULLS * scale else -1


@compiled
def stops(s: Any, m: Model, w: Work, i: int) -> bool:
    """Whether what fired of contact i is the end of its slip: without a direction, as far as known, none jams in it."""
    return bool(w.kind[i] == STOP or (w.kind[i] == JAM and slip(m, w, i, w.rate) <= small_slip(s, w, i)))


@compiled
def after(s: Any, m: Model, w: Work, mode: Bytes, i: int, h: float) -> int:
    """The mode that the fired guard of row i leads to.

    A gap that opens where it touches has dipped below zero in the interpolant alone, as one may that was let go from
    rest: the instant tells whether it presses.
    """
    kind = w.kind[i]
    if kind == RELEASE and (s.dependent > 0 or s.idle > 0):
        w.spent[i] = 1  # others may carry on for it
        return int(mode[i])
    if kind == RELEASE:
        return BALLISTIC if s.fsm != LEVEL else released_mode(mode[i], h)
    if kind == LEAVE:
        return FREE
    if kind == HANDOVER:
        return CONTACT
    if kind == CONE and s.growth >= 1.0 and not w.begins[i]:
        return int(mode[i])  # rows that depended on others do so no more: what that makes of the modes is decided
    if kind == CONE:
        return SLIP
    if stops(s, m, w, i):
        return STICK
    if kind in (JAM, DRIFT):
        return int(mode[i])  # whether any other set of modes goes on is decided with all of them
    if kind == TOUCH and s.fsm == LEVEL and w.rate[i] > 0.0:
        return int(mode[i])
    if s.frozen and m.beta[i, 0] > 0.0:
        return int(mode[i])  # a frozen collision settles it
    return active_mode(s, m, w, i)
