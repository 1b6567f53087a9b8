"""One set of modes of the contacts at an instant: how it is put, and what moves under its forces."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.algebra import ROUNDING
from crossbody.reference.core.coulomb import factor_set, solve
from crossbody.reference.core.friction import has_friction, is_decided, is_dry, most_drift, slip, small_slip
from crossbody.reference.core.jams import JAMMED, determinant
from crossbody.reference.core.layout import FREE, SLIP, STICK, Model, Work
from crossbody.reference.core.loops import is_idle, is_loop
from crossbody.reference.core.shares import allow
from crossbody.reference.kinds import Array

CLEAR_OF_A_JAM = 1e-5  # determinant, of rows of size 1, of what goes on where others jam
DIFFERENT = 1e-6  # part of the largest acceleration by which motions differ


@compiled
def first_row(m: Model, w: Work, i: int) -> int:
    """Place of the first tangential row of contact i."""
    return int(w.listed[m.tangent[i]])


@compiled
def look(s: Any, m: Model, w: Work) -> None:
    """Leave the right-hand sides of the rows in contact without what pulls sticking ones back in w.bare.

    Which contacts stand is left in w.stands, 0 for those that slide on: their direction is that of their slip. Where
    loads do not jump one that is small does so too: to begin anew would turn it, and with it what others carry.
    """
    s.push_scale = 0.0
    for j in range(s.na):
        i = w.idx[j]
        tangential = m.follows[i] >= 0 and has_friction(m, m.follows[i])
        w.bare[j] = w.r[j] + (w.law[i, 1] * w.hda[j] if tangential else 0.0)
        if is_idle(w, j) or (s.loops and is_loop(m, i)):
            w.bare[j] = w.carried[j] if tangential else 0.0
        else:
            s.push_scale = max(s.push_scale, w.scale[j])
    for j in range(s.na):
        i = w.idx[j]
        if is_decided(w, i):
            size = slip(m, w, i, w.rate)
            w.slid[i] = w.slides[i] and size > 0.0
            fresh = w.begins[i] or w.since[i] == s.t or (s.jumps and size <= small_slip(s, w, i))
            carried_off = s.jumps and size > most_drift(s, w, i)  # its place has jumped, to where it is faster
            w.stands[i] = fresh or not (w.slides[i] or carried_off)
            if not w.stands[i] and size > small_slip(s, w, i):
                for c in range(first_row(m, w, i), first_row(m, w, i) + m.tangents[i]):
                    w.along[c] = (w.hda[c] - w.rest[w.idx[c]]) / size
                    w.way[w.idx[c]] = w.along[c]


@compiled
def put_as_they_are(s: Any, m: Model, w: Work) -> None:
    """Let contacts that stand stick, unless they have reached their bounds, and the others slide."""
    for j in range(s.na):
        i = w.idx[j]
        if is_decided(w, i):
            put(m, w, i, STICK if w.stands[i] and not w.begins[i] else SLIP)


@compiled
def put_as_they_stand(s: Any, m: Model, w: Work) -> None:
    """Let all contacts that stand stick, and the others slide."""
    for j in range(s.na):
        i = w.idx[j]
        if is_decided(w, i):
            put(m, w, i, STICK if w.stands[i] else SLIP)


@compiled
def put(m: Model, w: Work, i: int, state: int) -> None:
    """Let contact i stick, slide along its direction of reference, or as it does already, or be off (FREE)."""
    w.state[i] = state
    first = first_row(m, w, i)
    w.off[i], w.slides[i] = state == FREE, state == SLIP
    for c in range(first, first + m.tangents[i]):
        w.off[w.idx[c]], w.slides[w.idx[c]] = state == FREE, state == SLIP
        if w.stands[i]:
            w.along[c] = w.way[w.idx[c]]


@compiled
def evaluate_set(s: Any, m: Model, w: Work) -> None:
    """Multipliers of the set as it stands in w.la, and in w.excess by how much faster than its law each row moves.

    What pulls sticking rows back counts for the excess of normal rows and for w.load, their multipliers, by which they
    press or not: the rows move with it.
    """
    factor_set(s, m, w)
    pulled = False
    for j in range(s.na):
        n, w.full[j] = m.follows[w.idx[j]], w.bare[j]
        if n >= 0 and has_friction(m, n) and w.state[n] == STICK:
            w.full[j] -= m.alpha[w.idx[j], 1] * w.hda[j]
            pulled = True
    if pulled:
        solve(s, m, w, w.full, w.load)
        exceed(s, w, w.full, w.load)
        for j in range(s.na):
            w.kept_excess[j] = w.excess[j]
    solve(s, m, w, w.bare, w.la)
    exceed(s, w, w.bare, w.la)
    for j in range(s.na):
        if not pulled:
            w.load[j] = w.la[j]
        elif not (m.follows[w.idx[j]] >= 0 and has_friction(m, m.follows[w.idx[j]])):
            w.excess[j] = w.kept_excess[j]


@compiled
def exceed(s: Any, w: Work, r: Array, la: Array) -> None:
    """Leave in w.excess by how much faster than r rows move under the multipliers la."""
    for j in range(s.na):
        total = -r[j]
        for c in range(s.na):
            total += w.gram[j, c] * la[c]
        w.excess[j] = total


@compiled
def apart(s: Any, w: Work) -> float:
    """By how many times what is allowed the normal rows that are solved for move otherwise than they must: w.excess."""
    allow(s, w, w.y[: s.nq], w.y[s.nq :])
    most = 0.0
    for a in range(s.normals):
        j, size = w.unknown[a], 0.0
        for c in range(s.na):
            size += abs(w.gram[j, c] * w.load[c])
        most = max(most, abs(w.excess[j]) / (w.allowed[j] + ROUNDING * size) if w.excess[j] != 0.0 else 0.0)
    return float(most)


@compiled
def size_along(m: Model, w: Work, i: int, x: Array) -> float:
    """Size of the tangential part of contact i of x."""
    square = 0.0
    for c in range(first_row(m, w, i), first_row(m, w, i) + m.tangents[i]):
        square += x[c] * x[c]
    return float(np.sqrt(square))


@compiled
def face_against(m: Model, w: Work, i: int, x: Array) -> bool:
    """Take the direction against x for that in which contact i slides, none if x vanishes there."""
    size = size_along(m, w, i, x)
    for c in range(first_row(m, w, i), first_row(m, w, i) + m.tangents[i]):
        w.way[w.idx[c]] = -x[c] / size if size > 0.0 else 0.0
    return bool(size > 0.0)


@compiled
def off_stick(s: Any, m: Model, w: Work, i: int) -> float:
    """By how much faster than its law contact i moves, which sticks: it may contradict others that do."""
    return size_along(m, w, i, w.excess) if s.dependent_rows > 0 else 0.0


@compiled
def carried_on(s: Any, m: Model, w: Work, i: int) -> float:
    """By how much contact i is accelerated along its surface where nothing can hold it."""
    most = 0.0
    for c in range(first_row(m, w, i), first_row(m, w, i) + m.tangents[i]):
        most = max(most, abs(w.bare[c]) if is_idle(w, c) else 0.0)
    return float(most)


@compiled
def ahead(m: Model, w: Work, i: int) -> float:
    """Tangential acceleration of contact i along its direction."""
    total = 0.0
    for c in range(first_row(m, w, i), first_row(m, w, i) + m.tangents[i]):
        total += w.along[c] * w.excess[c]
    return float(total)


@compiled
def aside(m: Model, w: Work, i: int) -> float:
    """Tangential acceleration of contact i across its direction; 0 of one that has a single tangential row."""
    if m.tangents[i] < 2:
        return 0.0
    c = first_row(m, w, i)
    return float(w.along[c] * w.excess[c + 1] - w.along[c + 1] * w.excess[c])


@compiled
def keep(s: Any, w: Work) -> None:
    """Keep the modes and directions of a set, before others are tried."""
    for i in range(s.nc):
        w.sets[0, i], w.kept_way[i] = w.state[i], w.way[i]


@compiled
def put_back(s: Any, m: Model, w: Work) -> None:
    """Put contacts back into the set that was kept."""
    for j in range(s.na):
        i = w.idx[j]
        if is_decided(w, i):
            for c in range(first_row(m, w, i), first_row(m, w, i) + m.tangents[i]):
                w.way[w.idx[c]] = w.kept_way[w.idx[c]]
            put(m, w, i, w.sets[0, i])


@compiled
def jammed(s: Any, m: Model, w: Work) -> int:
    """The contact that slides and that bears most of what is jammed as the set stands; -1 if nothing is.

    One that no forces bring onto its law is at the very edge of that. Where contacts have just come to a jam time does
    not tell how near: a set that is nearly there is the same again.
    """
    least = CLEAR_OF_A_JAM if s.jam else JAMMED
    found, most, value, known = -1, -np.inf, 0.0, False
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and w.state[i] == SLIP and not is_dry(m, i):
            if not (known and w.reached[j]):
                value, known = determinant(s, m, w, j), True
            off = abs(w.excess[j]) > DIFFERENT * s.push_scale
            if (off or not value > least) and w.la[j] > most:
                found, most = int(i), w.la[j]
    return found
