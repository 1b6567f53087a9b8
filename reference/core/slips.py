"""Slip velocities from step to step: directions of reference, slips that begin, pass zero or die out."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.coulomb import respond
from crossbody.reference.core.friction import (
    CLEAR,
    bound,
    count_from_none,
    has_begun,
    has_friction,
    is_tangent,
    least_slip,
    slip,
    slip_along,
    small_slip,
)
from crossbody.reference.core.guards import GRAZE, STOP
from crossbody.reference.core.layout import NODES, Model, Work
from crossbody.reference.kinds import Array

FORGETS = 300.0  # times as much as it began with: then it counts from none, which turns it by 3e-3 rad at most
NEAR = 2.0  # times as much as has no direction: what a step may be off turns so slow a slip as well
TURNED = 1e-4  # less than one, of the cosine between where a slip that dies out was last clear of zero and where it is
LINGERS = 10.0  # times as long as it takes to stop what has no direction: what slides so slowly is at rest
HELD = 1e-6  # part of what a contact would yield by itself, below which others hold it


@compiled
def begin(s: Any, m: Model, w: Work) -> None:
    """Forget what another run of the same workspace has left, and note the rows on which the search for modes decides.

    A row that another one follows, which is no friction, is none of them: its multiplier has either sign.
    """
    for i in range(s.nc):
        w.decides[i] = has_friction(m, i) or (m.unilateral[i] and m.follows[i] < 0)
    for i in range(s.nc):
        if m.follows[i] >= 0 and not has_friction(m, m.follows[i]):
            w.decides[m.follows[i]] = 0
    for left in (w.way, w.rest, w.tolerated, w.open_v, w.open_rate):
        left[:] = 0.0
    w.gained[:] = 0.0
    w.off[:], w.begins[:], w.since[:], w.within[:], w.course[:] = 0, 0, -np.inf, np.inf, np.inf


@compiled
def face(m: Model, w: Work, i: int, rate: Array) -> None:
    """Take the direction of the present slip velocity of contact i for that of reference."""
    size = slip(m, w, i, rate)
    for t in range(m.tangent[i], m.tangent[i] + m.tangents[i]):
        w.way[t] = (rate[t] - m.drift[t] - w.rest[t]) / size if size > 0.0 else 0.0


@compiled
def angle(m: Model, w: Work, i: int, rate: Array) -> float:
    """Return the angle of the slip velocity of contact i in its plane."""
    t = m.tangent[i]
    return float(np.arctan2(rate[t + 1] - m.drift[t + 1] - w.rest[t + 1], rate[t] - m.drift[t] - w.rest[t]))


@compiled
def _gain(m: Model, w: Work, j: int) -> float:
    """What a body gains at present while the row at place j returns to its law; -1 for one without friction.

    What drives a row by speeds alone does not count: it vanishes at rest, and is large where contacts run along edges.
    """
    i = w.idx[j]
    returns = max(m.alpha[i, 1], np.sqrt(m.alpha[i, 0])) if has_friction(m, i) else 0.0
    drive = w.scale[j] - abs(w.Hdv[j]) - w.law[i, 1] * abs(w.hda[j])
    return float(drive / returns if returns > 0.0 else -1.0)


@compiled
def _note_gains(s: Any, m: Model, w: Work) -> None:
    """Note what bodies gain at present while a row in contact returns to its law: at rest speeds are those of errors.

    It counts for all rows of the same trees. An open row of trees without contact keeps what it had in the last one.
    """
    for j in range(s.na):
        w.trial[j] = _gain(m, w, j)
    for k in range(s.nc):
        most = -1.0
        for j in range(s.na):
            i = w.idx[j]
            if w.trial[j] > most and m.trees[k, 0] < m.trees[i, 1] and m.trees[i, 0] < m.trees[k, 1]:
                most = w.trial[j]
        if most >= 0.0:
            w.gained[k] = most


@compiled
def note_speed(s: Any, m: Model, w: Work, rate: Array) -> None:
    """Keep the largest speed seen at contacts with friction: of their gaps, and of what makes up their slips."""
    _note_gains(s, m, w)
    for i in range(s.nc):
        if has_friction(m, i):
            s.slip_speed = max(s.slip_speed, slip(m, w, i, rate), abs(rate[i]))
    for j in range(s.na):
        i, size = w.idx[j], 0.0
        for c in range(m.span[i, 0], m.span[i, 1] if is_tangent(m, i) else 0):
            size += abs(w.H[j, c] * w.y[s.nq + c])
        s.slip_speed = max(s.slip_speed, size)


@compiled
def _comes_near_zero(s: Any, m: Model, w: Work, i: int) -> bool:
    """Whether the slip of contact i loses more than half of what it is within the step, or turns by more than 60 deg.

    It may pass zero beside it.
    """
    before, after, along = slip(m, w, i, w.rates[0]), slip(m, w, i, w.rates[NODES - 1]), 0.0
    for t in range(m.tangent[i], m.tangent[i] + m.tangents[i]):
        along += (w.rates[0, t] - m.drift[t] - w.rest[t]) * (w.rates[NODES - 1, t] - m.drift[t] - w.rest[t])
    return bool(before > small_slip(s, w, i) and along < 0.5 * before * max(before, after))


@compiled
def turns_aside(s: Any, m: Model, w: Work) -> bool:
    """Whether slips turn within the step, and friction with them, too fast for what it knows of any guard.

    So where a slip falls to zero along its direction of reference, and goes on across it (rates in w.rate), or comes
    near zero while what fires at s.theta is no stop of its own.
    """
    for i in range(s.nc):
        stops = w.hit[i] <= s.theta and w.kind[i] == STOP
        if stops:
            along = slip_along(m, w, i, w.rate)
            if slip(m, w, i, w.rate) ** 2 - along * along > small_slip(s, w, i) ** 2:
                return True
        elif m.tangents[i] > 1 and w.slides[i] and _comes_near_zero(s, m, w, i):
            return True
    return False


@compiled
def dies_out(s: Any, m: Model, w: Work, i: int) -> bool:
    """Whether the slip of contact i falls in the step, and has turned where it has no direction that is known."""
    size = slip(m, w, i, w.rate)
    falls = size <= NEAR * small_slip(s, w, i) and size < slip(m, w, i, w.rates[0]) and not has_begun(w, i)
    return bool(falls and w.course[i] < np.inf and np.cos(angle(m, w, i, w.rate) - w.course[i]) < 1.0 - TURNED)


@compiled
def _rest(m: Model, w: Work, i: int) -> float:
    """Size of the slip velocity with which contact i began."""
    square = 0.0
    for t in range(m.tangent[i], m.tangent[i] + m.tangents[i]):
        square += w.rest[t] * w.rest[t]
    return float(np.sqrt(square))


@compiled
def _loses(s: Any, m: Model, w: Work, i: int, rate: Array) -> float:
    """How fast contact i, which slides, loses its slip at the present instant as evaluated, m/s^2."""
    size, total = slip(m, w, i, rate), 0.0
    for t in range(m.tangent[i], m.tangent[i] + m.tangents[i]):
        j = w.listed[t]
        change = w.Hdv[j]
        for c in range(m.span[t, 0], m.span[t, 1]):
            change += w.H[j, c] * w.k[0, s.nq + c]
        total -= change * (rate[t] - m.drift[t] - w.rest[t])
    return float(total / size if size > 0.0 else 0.0)


@compiled
def _is_held(s: Any, m: Model, w: Work, i: int) -> bool:
    """Whether other contacts hold what contact i slides on: a force along its direction changes their forces alone."""
    first, end, own, moved = w.listed[m.tangent[i]], w.listed[m.tangent[i]] + m.tangents[i], 0.0, 0.0
    for j in range(s.na):
        w.pushed[j] = 0.0
        for c in range(first, end):
            w.pushed[j] -= w.gram[j, c] * w.along[c]
    respond(s, m, w, w.pushed, w.excess)
    for c in range(first, end):
        own -= w.pushed[c] * w.along[c]
        for j in range(s.na):
            moved += w.along[c] * w.gram[c, j] * w.excess[j]
    return bool(own + moved < HELD * own)


@compiled
def _lingers(s: Any, m: Model, w: Work, i: int, rate: Array) -> bool:
    """Whether contact i has been sliding without a direction for far longer than it takes to stop what has none.

    Others hold the body, and what they leave it dies out without ever passing zero, far slower than friction would have
    it: such a contact is at rest. One that they do not hold loses its slip as it does, by its friction less its weight.
    """
    if has_begun(w, i) or slip(m, w, i, rate) > least_slip(s):
        w.within[i] = np.inf
        return False
    w.within[i] = min(w.within[i], s.t)
    c = w.listed[m.tangent[i]]
    brake = bound(m, i, w.lam0[i]) * w.gram[c, c]
    if m.tangents[i] > 1 and not _is_held(s, m, w, i):
        brake = _loses(s, m, w, i, rate)
    return bool((s.t - w.within[i]) * brake > LINGERS * least_slip(s))


@compiled
def _forget(s: Any, m: Model, w: Work, i: int, size: float) -> None:
    """Let a slip of that size, which has begun, be one like any other, and at last forget with what it began.

    To forget it early would turn the friction of contact i at once, and break others loose that are near their bounds.
    """
    if has_begun(w, i) and size > CLEAR * max(small_slip(s, w, i), _rest(m, w, i)):
        w.since[i], s.watched = -np.inf, 0
    if not has_begun(w, i) and (m.tangents[i] == 1 or size > FORGETS * _rest(m, w, i)):
        count_from_none(m, w, i)


@compiled
def renew(s: Any, m: Model, w: Work, rate: Array) -> bool:
    """Take the directions of the present slip velocities for those of reference, where they are clear of zero.

    Whether contacts have stopped without passing zero: they are marked as if they had passed it.
    """
    note_speed(s, m, w, rate)
    linger = False
    for i in range(s.nc):
        if has_friction(m, i) and w.slides[i]:
            _forget(s, m, w, i, slip(m, w, i, rate))
            along = slip_along(m, w, i, rate)
            slow = m.tangents[i] > 1 and slip(m, w, i, rate) <= least_slip(s)
            if along < -small_slip(s, w, i) if has_begun(w, i) else slow and along < -GRAZE * least_slip(s):
                w.hit[i], w.kind[i], linger = 0.0, STOP, True  # it has passed zero, by less in each step than is known
            elif slip(m, w, i, rate) > small_slip(s, w, i):
                face(m, w, i, rate)
            if m.tangents[i] > 1:
                s.have_jacobian = 0  # it turns at a rate that goes as 1/|v_t|
                if w.course[i] == np.inf or slip(m, w, i, rate) > CLEAR * small_slip(s, w, i):
                    w.course[i] = angle(m, w, i, rate)
            if _lingers(s, m, w, i, rate):
                w.hit[i], w.kind[i], linger = 0.0, STOP, True
    if s.na > 0 and s.dependent_rows > 0:
        s.redundant = max(s.redundant, s.dependent_rows)
    return linger
