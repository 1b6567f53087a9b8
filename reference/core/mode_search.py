"""The search for a set of modes that agrees with its forces.

A contact whose slip velocity is clear of zero slides along it. For those that stand, with la the multipliers and a by
how much faster than its law every row moves, a set of modes is consistent if

    STICK   |lam_t| <= mu lam_n
    SLIP    s . a_t >= 0,  s parallel to a_t
    off     a_n >= 0                    and lam_n >= 0 of both others

One change at a time, of what is violated most, finds most of them. Where that comes back to a set it goes on from what
60 sweeps of projected Gauss-Seidel give, then on a way that all can bear (`mode_path`), and at last through the sets
that differ from that in few contacts.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.beginnings import look_around, turn
from crossbody.reference.core.friction import bound, decided_to, has_friction, is_decided, is_dry
from crossbody.reference.core.layout import FREE, SLIP, STICK, Model, Work
from crossbody.reference.core.loops import is_idle
from crossbody.reference.core.mode_set import (
    ahead,
    apart,
    aside,
    carried_on,
    evaluate_set,
    face_against,
    first_row,
    jammed,
    keep,
    off_stick,
    put,
    size_along,
)

SWEEPS = 60
TURNS = 40  # of directions of slip towards those of acceleration
TURNED = 1e-12
FEW_SETS, MANY_SETS = 256, 4096  # that are tried where others may be found, and before a motion is given up
EVERY = -1  # island
BELOW = 1e-6  # part of its bound by which a force stays below it to count as that of a contact that sticks
WORST, ALL = np.arange(2)  # of what is violated: how much is changed at once
STRICT_IF_DRY, STRICT = 1, 2  # which sticks must be met where they depend on each other: of dry friction alone, or all


@compiled
def _worst(s: Any, m: Model, w: Work) -> int:
    """The contact that violates its mode most, -1 if none does; w.wants has the modes that all would rather have."""
    found, most = -1, decided_to(s)
    contradict = s.dependent_rows > 0 and apart(s, w) > 1.0
    for j in range(s.na):
        i = w.idx[j]
        if not is_decided(w, i):
            continue
        w.wants[i] = w.state[i]
        if w.state[i] == FREE:
            missing, becomes = -w.excess[j], STICK if w.stands[i] else SLIP
            if s.loops and is_idle(w, j):  # it stays where loops hold it
                missing = np.inf
        else:
            missing, becomes = -w.load[j] * w.gram[j, j], FREE
            if contradict:  # with rows that it depends on, and its gap opens faster than its law
                missing = max(missing, w.excess[j])
            if i + 1 == s.barred:
                missing = np.inf
            if is_dry(m, i):
                missing = -1.0
            other, then = -1.0, STICK
            if w.state[i] == STICK:
                other, then = (size_along(m, w, i, w.la) - bound(m, i, max(w.la[j], 0.0))) * w.gram[j, j], SLIP
                strict = s.strict == STRICT or (s.strict == STRICT_IF_DRY and is_dry(m, i))
                other = max(other, carried_on(s, m, w, i), off_stick(s, m, w, i) if strict else 0.0)
            elif w.stands[i]:
                other = max(-ahead(m, w, i), abs(aside(m, w, i)))
            if other > missing:
                missing, becomes = other, then
        if missing > decided_to(s):
            w.wants[i] = becomes
        if missing > most:
            found, most = i, missing
    return found


@compiled
def aim(m: Model, w: Work, i: int) -> None:
    """Take the direction against its force for that in which contact i would slide, or that in which it is driven."""
    if not face_against(m, w, i, w.la):
        face_against(m, w, i, w.bare)


@compiled
def change(m: Model, w: Work, i: int, becomes: int) -> None:
    """Put contact i in another mode; one that begins to slide does so against the force that held it."""
    if becomes == SLIP and w.stands[i]:
        aim(m, w, i)
    put(m, w, i, becomes)


@compiled
def _seen(s: Any, m: Model, w: Work) -> bool:
    """Whether the set stood before since s.sets was set to 0; note it."""
    for r in range(s.sets):
        same = True
        for i in range(s.nc):
            same = same and w.sets[r, i] == w.state[i]
        if same:
            return True
    if s.sets == len(w.sets):
        return True
    for i in range(s.nc):
        w.sets[s.sets, i] = w.state[i]
    s.sets += 1
    return False


@compiled
def judge(s: Any, m: Model, w: Work) -> int:
    """Evaluate the set, with directions that agree with what they lead to; the contact that violates it most, or -1."""
    evaluate_set(s, m, w)
    for _ in range(TURNS):
        if turn(s, m, w) <= TURNED:
            break
        evaluate_set(s, m, w)
    if s.unsteady >= 0:
        look_around(s, m, w, s.unsteady)
    worst = _worst(s, m, w)
    if worst >= 0 and w.state[worst] == SLIP and w.wants[worst] == STICK and m.tangents[worst] > 1:
        look_around(s, m, w, worst)
        worst = _worst(s, m, w)
    return worst


@compiled
def goes_on(s: Any, m: Model, w: Work) -> bool:
    """Whether a set that agrees with its forces does not jam; notes the contact that does.

    Where no other set is consistent those forces are what the law asks for, and they press further in: Painleve.
    """
    contact = jammed(s, m, w)
    if s.pressed_in < 0:
        s.pressed_in = contact
    return contact < 0


@compiled
def iterate(s: Any, m: Model, w: Work, together: int) -> bool:
    """Change the WORST of what is violated, or ALL of it together, until nothing is; False if a set comes again.

    Corners of one box begin to slide together: one after another they would each choose another direction.
    """
    s.sets = 0
    while not _seen(s, m, w):
        i = judge(s, m, w)
        if i < 0:
            return goes_on(s, m, w)
        for j in range(s.na):
            k = w.idx[j]
            if is_decided(w, k) and (k == i or together == ALL) and w.wants[k] != w.state[k]:
                change(m, w, k, w.wants[k])
    return False


@compiled
def _relax(s: Any, m: Model, w: Work, j: int) -> None:
    """One projected step of the row in place j."""
    if not w.gram[j, j] > 0.0:
        return
    total = w.bare[j]
    for c in range(s.na):
        total -= w.gram[j, c] * w.la[c]
    w.la[j] += total / w.gram[j, j]


@compiled
def sweep(s: Any, m: Model, w: Work) -> None:
    """Projected Gauss-Seidel from no forces; put every contact in the mode that its force then has."""
    for j in range(s.na):
        w.la[j] = 0.0
    for _ in range(SWEEPS):
        for j in range(s.na):
            i = w.idx[j]
            if m.follows[i] >= 0 and has_friction(m, m.follows[i]) and not is_dry(m, i):
                continue
            if not is_dry(m, i):
                _relax(s, m, w, j)
                if m.unilateral[i]:
                    w.la[j] = max(w.la[j], 0.0)
            if has_friction(m, i):
                first, last, most = first_row(m, w, i), first_row(m, w, i) + m.tangents[i], bound(m, i, w.la[j])
                for c in range(first, last):
                    if w.stands[i]:
                        _relax(s, m, w, c)
                    else:
                        w.la[c] = -most * w.along[c]
                size = size_along(m, w, i, w.la)
                for c in range(first, last):
                    w.la[c] *= min(1.0, most / size) if size > 0.0 else 1.0
    for j in range(s.na):
        i = w.idx[j]
        if is_decided(w, i):
            if w.stands[i]:
                aim(m, w, i)
            if w.la[j] * w.gram[j, j] <= decided_to(s) and not is_dry(m, i) and not (s.loops and is_idle(w, j)):
                put(m, w, i, FREE)
            elif w.stands[i] and size_along(m, w, i, w.la) <= (1.0 - BELOW) * bound(m, i, w.la[j]):
                put(m, w, i, STICK)
            else:
                put(m, w, i, SLIP)


@compiled
def swept(s: Any, m: Model, w: Work, together: int) -> bool:
    """Whether a consistent set is found from what sweeps give."""
    sweep(s, m, w)
    return bool(iterate(s, m, w, together))


@compiled
def choices(m: Model, w: Work, i: int) -> int:
    """How many modes a contact may have: what slides, or has no friction, goes on as it does, or presses no more."""
    if w.stands[i] and has_friction(m, i):
        return 4
    return 1 if is_dry(m, i) else 2


@compiled
def vary(s: Any, m: Model, w: Work, island: int) -> None:
    """Put contacts of an island by w.island, or all for EVERY, in the modes that w.digit says, 0 for that of w.sets[0].

    Directions of slip are those of reference, and of the digit 3 their opposites.
    """
    for j in range(s.na):
        i = w.idx[j]
        if is_decided(w, i) and island in (EVERY, w.island[j]):
            digit, start = w.digit[i], w.sets[0, i]
            state = start if digit == 0 else (STICK if digit == 1 else SLIP)
            if digit > 0 and not has_friction(m, i):
                state = FREE if start == STICK else STICK
            elif digit > 0 and not w.stands[i]:
                state = FREE if start == SLIP else SLIP
            elif digit == 3:
                for c in range(first_row(m, w, i), first_row(m, w, i) + m.tangents[i]):
                    w.way[w.idx[c]] = -w.way[w.idx[c]]
            elif digit > 0 and digit == _start_digit(start):
                state = start if is_dry(m, i) else FREE
            put(m, w, i, state)


@compiled
def _start_digit(state: int) -> int:
    """The digit that would name the mode in which a contact is already: it stands for being off."""
    return 1 if state == STICK else (2 if state == SLIP else 0)


@compiled
def _begin_digits(s: Any, m: Model, w: Work, differing: int) -> bool:
    """Let w.digit differ from 0 in the first so many contacts that have a choice, as 1; whether there are so many."""
    for j in range(s.na):
        i = w.idx[j]
        if is_decided(w, i):
            w.digit[i] = differing > 0 and choices(m, w, i) > 1
            differing -= w.digit[i]
    return differing == 0


@compiled
def _next_digits(s: Any, m: Model, w: Work) -> bool:
    """Go on to the next w.digit that differs from 0 in as many contacts; False if there is none."""
    passed, before = 0, False
    for j in range(s.na):
        i = w.idx[j]
        if not is_decided(w, i) or choices(m, w, i) == 1:
            continue
        if w.digit[i] > 0 and w.digit[i] + 1 < choices(m, w, i):
            w.digit[i] += 1
            return True
        w.digit[i] = min(w.digit[i], 1)
    for j in range(s.na):
        i = w.idx[j]
        if not is_decided(w, i) or choices(m, w, i) == 1:
            continue
        if before and w.digit[i] == 0:
            for a in range(j):
                if is_decided(w, w.idx[a]) and choices(m, w, w.idx[a]) > 1:
                    w.digit[w.idx[a]] = passed > 1
                    passed -= w.digit[w.idx[a]]
            w.digit[i] = 1
            return True
        before = w.digit[i] > 0
        passed += before
    return False


@compiled
def near_sets(s: Any, m: Model, w: Work, most: int) -> bool:
    """Try `most` sets by the number of contacts in which they differ from what sweeps give; whether one is consistent.

    If none of all is, contacts jam in one of them: without a jam in any there would be a motion. One that jams in a set
    that was tried is noted where there are too many to try them all, too.
    """
    sweep(s, m, w)
    keep(s, w)
    differing, tried, jam = 0, 0, -1
    while tried < most and _begin_digits(s, m, w, differing):
        more = True
        while more and tried < most:
            for i in range(s.nc):
                w.way[i] = w.kept_way[i]
            vary(s, m, w, EVERY)
            if judge(s, m, w) < 0 and goes_on(s, m, w):
                return True
            if jam < 0:
                jam = jammed(s, m, w)
            tried += 1
            more = _next_digits(s, m, w)
        differing += 1
    if s.pressed_in < 0:
        s.pressed_in = jam
    return False
