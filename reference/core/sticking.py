"""Which contacts stick, which slide and which let go at one instant: the mode problem of friction.

A contact whose slip velocity is clear of zero slides along it. For those that stand, with la the multipliers and a by
how much faster than its law every row moves, a set of modes is consistent if

    STICK   |lam_t| <= mu lam_n
    SLIP    s . a_t >= 0,  s parallel to a_t
    off     a_n >= 0                    and lam_n >= 0 of both others

One change at a time, of what is violated most, finds most of them. Where that comes back to a set it goes on from what
60 sweeps of projected Gauss-Seidel give, and at last through the sets that differ from that in few contacts.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.algebra import factor_lu, solve_lu
from crossbody.reference.core.coulomb import JAMMED, determinant, factor_set, note_speed, respond, solve, without_pull
from crossbody.reference.core.friction import (
    bound,
    count_from_none,
    decided_to,
    has_friction,
    is_dry,
    slip,
    small_slip,
)
from crossbody.reference.core.guards import CONE
from crossbody.reference.core.layout import FREE, NO_CONSISTENT_MODES, PAINLEVE, SLIP, STICK, Model, Work
from crossbody.reference.kinds import Array

SWEEPS = 60
CLEAR = 1e-6  # part of its bound by which a force must stay below it to count as that of a contact that sticks
TURNS = 40  # of directions of slip towards those of acceleration
TURNED = 1e-12
MOST_TURN = 0.5  # rad, of one of them
AROUND, HALVINGS = 24, 50  # directions that are looked at where that leads nowhere, and halvings between two
MOST_SETS = 256
FEW = 64  # sets, which are all tried to see whether others are consistent as well
WORST, ALL = np.arange(2)  # of what is violated: how much is changed at once
CLEAR_OF_A_JAM = 1e-5  # determinant, of rows of size 1, of what goes on where others jam
BESIDE_A_JAM = 1e-8  # part of the largest acceleration by which rows may be off where two would jam together
IDLE = 1e-7  # part of the largest acceleration below which one that begins to slide goes nowhere
DIFFERENT = 1e-6  # part of the largest acceleration by which motions differ


@compiled
def _first(m: Model, w: Work, i: int) -> int:
    """Place of the first tangential row of contact i."""
    return int(w.listed[m.tangent[i]])


@compiled
def _look(s: Any, m: Model, w: Work) -> None:
    """Leave the right-hand sides of the rows in contact without what pulls sticking ones back in w.bare.

    Which contacts stand is left in w.stands, 0 for those that slide on: their direction is that of their slip. Where
    loads do not jump one that is small does so too: to begin anew would turn it, and with it what others carry.
    """
    s.push_scale = 0.0
    for j in range(s.na):
        i = w.idx[j]
        tangential = m.follows[i] >= 0 and has_friction(m, m.follows[i])
        w.bare[j] = w.r[j] + (w.law[i, 1] * w.hda[j] if tangential else 0.0)
        s.push_scale = max(s.push_scale, w.scale[j])
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i):
            size = slip(m, w, i, w.rate)
            w.slid[i] = w.slides[i] and size > 0.0
            fresh = w.begins[i] or w.since[i] == s.t or (s.jumps and size <= small_slip(s))
            w.stands[i] = fresh or not w.slides[i]
            if not w.stands[i] and size > small_slip(s):
                for c in range(_first(m, w, i), _first(m, w, i) + m.tangents[i]):
                    w.along[c] = (w.hda[c] - w.rest[w.idx[c]]) / size
                    w.way[w.idx[c]] = w.along[c]


@compiled
def _put_as_they_are(s: Any, m: Model, w: Work) -> None:
    """Let contacts that stand stick, unless they have reached their bounds, and the others slide."""
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i):
            _put(m, w, i, STICK if w.stands[i] and not w.begins[i] else SLIP)


@compiled
def _put(m: Model, w: Work, i: int, state: int) -> None:
    """Let contact i stick, slide along its direction of reference, or as it does already, or be off (FREE)."""
    w.state[i] = state
    first = _first(m, w, i)
    w.off[i], w.slides[i] = state == FREE, state == SLIP
    for c in range(first, first + m.tangents[i]):
        w.off[w.idx[c]], w.slides[w.idx[c]] = state == FREE, state == SLIP
        if w.stands[i]:
            w.along[c] = w.way[w.idx[c]]


@compiled
def _evaluate(s: Any, m: Model, w: Work) -> None:
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
        _exceed(s, w, w.full, w.load)
        w.kept_excess[: s.na] = w.excess[: s.na]
    solve(s, m, w, w.bare, w.la)
    _exceed(s, w, w.bare, w.la)
    for j in range(s.na):
        if not pulled:
            w.load[j] = w.la[j]
        elif not (m.follows[w.idx[j]] >= 0 and has_friction(m, m.follows[w.idx[j]])):
            w.excess[j] = w.kept_excess[j]


@compiled
def _exceed(s: Any, w: Work, r: Array, la: Array) -> None:
    """Leave in w.excess by how much faster than r rows move under the multipliers la."""
    for j in range(s.na):
        total = -r[j]
        for c in range(s.na):
            total += w.gram[j, c] * la[c]
        w.excess[j] = total


@compiled
def _size(m: Model, w: Work, i: int, x: Array) -> float:
    """Size of the tangential part of contact i of x."""
    square = 0.0
    for c in range(_first(m, w, i), _first(m, w, i) + m.tangents[i]):
        square += x[c] * x[c]
    return float(np.sqrt(square))


@compiled
def _ahead(m: Model, w: Work, i: int) -> float:
    """Tangential acceleration of contact i along its direction."""
    total = 0.0
    for c in range(_first(m, w, i), _first(m, w, i) + m.tangents[i]):
        total += w.along[c] * w.excess[c]
    return float(total)


@compiled
def _aside(m: Model, w: Work, i: int) -> float:
    """Tangential acceleration of contact i across its direction; 0 of one that has a single tangential row."""
    if m.tangents[i] < 2:
        return 0.0
    c = _first(m, w, i)
    return float(w.along[c] * w.excess[c + 1] - w.along[c + 1] * w.excess[c])


@compiled
def _turned_force(s: Any, m: Model, w: Work, j: int) -> None:
    """Fill w.trial with what a turn by one radian of the slip at the normal row in place j makes of all multipliers."""
    i = w.idx[j]
    c, force = _first(m, w, i), -m.friction[i] * w.la[j]
    x, y = -w.along[c + 1], w.along[c]
    for a in range(s.na):
        w.r[a] = -force * (w.gram[a, c] * x + w.gram[a, c + 1] * y)
    respond(s, m, w, w.r, w.trial)
    w.trial[c] += force * x
    w.trial[c + 1] += force * y


@compiled
def _fill_turns(s: Any, m: Model, w: Work) -> int:
    """How the accelerations across contacts that begin to slide change with their directions, in w.turns; how many."""
    count = 0
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and w.stands[i] and w.state[i] == SLIP and m.tangents[i] > 1 and w.la[j] > 0.0:
            w.turning[count] = j
            count += 1
    for b in range(count):
        _turned_force(s, m, w, w.turning[b])
        for a in range(count):
            i = w.idx[w.turning[a]]
            c, total = _first(m, w, i), 0.0
            for k in range(s.na):
                total += (w.along[c] * w.gram[c + 1, k] - w.along[c + 1] * w.gram[c, k]) * w.trial[k]
            w.turns[a, b] = total
        i = w.idx[w.turning[b]]
        w.turn_by[b] = -_aside(m, w, i)
        w.turns[b, b] -= max(_ahead(m, w, i), 0.0) + decided_to(s)  # definite where loads are shared
        if w.turns[b, b] > 0.0:
            s.unsteady = i
    return count


@compiled
def _turn(s: Any, m: Model, w: Work) -> float:
    """Turn the directions of contacts that begin to slide towards their accelerations, by Newton; by how much at most.

    Directions taken from accelerations alone run away where these are small beside what friction does.
    """
    s.unsteady = -1
    count = _fill_turns(s, m, w)
    if factor_lu(w.turns, count, w.turned) != 0:
        return 0.0
    solve_lu(w.turns, count, w.turned, w.turn_by)
    most = 0.0
    for a in range(count):
        most = max(most, abs(w.turn_by[a]))
    for a in range(count):
        c = _first(m, w, w.idx[w.turning[a]])
        by = w.turn_by[a] * min(1.0, MOST_TURN / most) if most > 0.0 else 0.0
        x, y = (
            w.along[c] * np.cos(by) - w.along[c + 1] * np.sin(by),
            w.along[c + 1] * np.cos(by) + w.along[c] * np.sin(by),
        )
        size = np.sqrt(x * x + y * y)
        w.along[c], w.along[c + 1] = x / size, y / size
        w.way[w.idx[c]], w.way[w.idx[c + 1]] = x / size, y / size
    return float(most)


@compiled
def _worst(s: Any, m: Model, w: Work) -> int:
    """The contact that violates its mode most, -1 if none does; w.wants has the modes that all would rather have."""
    found, most = -1, decided_to(s)
    for j in range(s.na):
        i = w.idx[j]
        if not has_friction(m, i):
            continue
        w.wants[i] = w.state[i]
        if w.state[i] == FREE:
            missing, becomes = -w.excess[j], STICK if w.stands[i] else SLIP
        else:
            missing, becomes = -w.load[j] * w.gram[j, j], FREE
            if is_dry(m, i):
                missing = -1.0
            other, then = -1.0, STICK
            if w.state[i] == STICK:
                other, then = (_size(m, w, i, w.la) - bound(m, i, max(w.la[j], 0.0))) * w.gram[j, j], SLIP
            elif w.stands[i]:
                other = max(-_ahead(m, w, i), abs(_aside(m, w, i)))
            if other > missing:
                missing, becomes = other, then
        if missing > decided_to(s):
            w.wants[i] = becomes
        if missing > most:
            found, most = i, missing
    return found


@compiled
def _change(m: Model, w: Work, i: int, becomes: int) -> None:
    """Put contact i in another mode; one that begins to slide does so against the force that held it."""
    if becomes == SLIP and w.stands[i]:
        size = _size(m, w, i, w.la)
        for c in range(_first(m, w, i), _first(m, w, i) + m.tangents[i]):
            w.way[w.idx[c]] = -w.la[c] / size
    _put(m, w, i, becomes)


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
def _face(s: Any, m: Model, w: Work, i: int, angle: float) -> float:
    """Let contact i begin to slide at an angle; its acceleration across that."""
    first = _first(m, w, i)
    w.way[w.idx[first]], w.way[w.idx[first + 1]] = np.cos(angle), np.sin(angle)
    w.along[first], w.along[first + 1] = np.cos(angle), np.sin(angle)
    _evaluate(s, m, w)
    return _aside(m, w, i)


@compiled
def _look_around(s: Any, m: Model, w: Work, i: int) -> None:
    """Search all directions for one in which contact i, once it slides, is accelerated, and towards which it turns.

    One from which it turns away is none in which it could begin. If there is none it keeps the one that it has.
    """
    first = _first(m, w, i)
    kept = np.arctan2(w.along[first + 1], w.along[first])
    start, aside = 0.0, _face(s, m, w, i, 0.0)
    for k in range(1, AROUND + 1):
        low, high = start, 2.0 * np.pi * k / AROUND
        start, before, aside = high, aside, _face(s, m, w, i, high)
        if before > 0.0 >= aside:
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                if _face(s, m, w, i, middle) > 0.0:
                    low = middle
                else:
                    high = middle
            if _ahead(m, w, i) > decided_to(s):
                return
    _face(s, m, w, i, kept)


@compiled
def _judge(s: Any, m: Model, w: Work) -> int:
    """Evaluate the set, with directions that agree with what they lead to; the contact that violates it most, or -1."""
    _evaluate(s, m, w)
    for _ in range(TURNS):
        if _turn(s, m, w) <= TURNED:
            break
        _evaluate(s, m, w)
    if s.unsteady >= 0:
        _look_around(s, m, w, s.unsteady)
    worst = _worst(s, m, w)
    if worst >= 0 and w.state[worst] == SLIP and w.wants[worst] == STICK and m.tangents[worst] > 1:
        _look_around(s, m, w, worst)
        worst = _worst(s, m, w)
    return worst


@compiled
def _iterate(s: Any, m: Model, w: Work, together: int) -> bool:
    """Change the WORST of what is violated, or ALL of it together, until nothing is; False if a set comes again.

    Corners of one box begin to slide together: one after another they would each choose another direction.
    """
    s.sets = 0
    while not _seen(s, m, w):
        i = _judge(s, m, w)
        if i < 0:
            return _jammed(s, m, w) < 0
        for j in range(s.na):
            k = w.idx[j]
            if has_friction(m, k) and (k == i or together == ALL) and w.wants[k] != w.state[k]:
                _change(m, w, k, w.wants[k])
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
def _aim(m: Model, w: Work, i: int) -> None:
    """Take the direction against its force for that in which contact i would slide, or that in which it is driven."""
    force, drive = _size(m, w, i, w.la), _size(m, w, i, w.bare)
    for c in range(_first(m, w, i), _first(m, w, i) + m.tangents[i]):
        if force > 0.0:
            w.way[w.idx[c]] = -w.la[c] / force
        elif drive > 0.0:
            w.way[w.idx[c]] = -w.bare[c] / drive


@compiled
def _sweep(s: Any, m: Model, w: Work) -> None:
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
                first, last, most = _first(m, w, i), _first(m, w, i) + m.tangents[i], bound(m, i, w.la[j])
                for c in range(first, last):
                    if w.stands[i]:
                        _relax(s, m, w, c)
                    else:
                        w.la[c] = -most * w.along[c]
                size = _size(m, w, i, w.la)
                for c in range(first, last):
                    w.la[c] *= min(1.0, most / size) if size > 0.0 else 1.0
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i):
            if w.stands[i]:
                _aim(m, w, i)
            if w.la[j] * w.gram[j, j] <= decided_to(s) and not is_dry(m, i):
                _put(m, w, i, FREE)
            elif w.stands[i] and _size(m, w, i, w.la) < (1.0 - CLEAR) * bound(m, i, w.la[j]):
                _put(m, w, i, STICK)
            else:
                _put(m, w, i, SLIP)


@compiled
def _swept(s: Any, m: Model, w: Work, together: int) -> bool:
    """Whether a consistent set is found from what sweeps give."""
    _sweep(s, m, w)
    return bool(_iterate(s, m, w, together))


@compiled
def _vary(s: Any, m: Model, w: Work, number: int) -> int:
    """Put contacts in the modes that a number says digit by digit, 0 for that of w.sets[0]; how many differ.

    Directions of slip are those of reference, and of the digit 3 their opposites.
    """
    changed = 0
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i):
            digit, number = number % 4, number // 4
            changed += digit > 0
            start = w.sets[0, i]
            state = start if digit == 0 else (STICK if digit == 1 else SLIP)
            if digit == 3 and w.stands[i]:
                for c in range(_first(m, w, i), _first(m, w, i) + m.tangents[i]):
                    w.way[w.idx[c]] = -w.way[w.idx[c]]
            elif digit == 3 or (digit == 1 and not w.stands[i]) or digit == start_digit(start):
                state = start if is_dry(m, i) else FREE
            _put(m, w, i, state)
    return changed


@compiled
def start_digit(state: int) -> int:
    """The digit that would name the mode in which a contact is already: it stands for being off."""
    return 1 if state == STICK else (2 if state == SLIP else 0)


@compiled
def _near_sets(s: Any, m: Model, w: Work) -> bool:
    """Try sets by the number of contacts in which they differ from the present one; whether one is consistent."""
    _sweep(s, m, w)
    _keep(s, w)
    contacts = 0
    for j in range(s.na):
        contacts += has_friction(m, w.idx[j])
    tried, all_sets = 0, 4 ** min(contacts, 12)
    for differing in range(1, contacts + 1):
        for number in range(all_sets):
            digits, rest = 0, number
            while rest > 0:
                digits += rest % 4 > 0
                rest //= 4
            if digits != differing:
                continue
            for i in range(s.nc):
                w.way[i] = w.kept_way[i]
            _vary(s, m, w, number)
            if _judge(s, m, w) < 0 and _jammed(s, m, w) < 0:
                return True
            tried += 1
            if tried >= MOST_SETS:
                return False
    return False


@compiled
def begin_slip(s: Any, m: Model, w: Work) -> None:
    """Let contacts that have reached their bounds begin to slide against the forces that held them, as evaluated."""
    without_pull(s, m, w)
    for i in range(s.nc):
        if w.hit[i] <= s.theta and w.kind[i] == CONE:
            w.begins[i] = 1
            size = _size(m, w, i, w.la)
            for c in range(_first(m, w, i), _first(m, w, i) + m.tangents[i]):
                w.way[w.idx[c]] = -w.la[c] / size if size > 0.0 else 0.0


@compiled
def _keep(s: Any, w: Work) -> None:
    """Keep the modes and directions of a set, before others are tried."""
    for i in range(s.nc):
        w.sets[0, i], w.kept_way[i] = w.state[i], w.way[i]


@compiled
def _put_back(s: Any, m: Model, w: Work) -> None:
    """Put contacts back into the set that was kept."""
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i):
            for c in range(_first(m, w, i), _first(m, w, i) + m.tangents[i]):
                w.way[w.idx[c]] = w.kept_way[w.idx[c]]
            _put(m, w, i, w.sets[0, i])


@compiled
def _choices(m: Model, w: Work, i: int) -> int:
    """How many modes a contact may have: what slides goes on as it does, or presses no more."""
    return 4 if w.stands[i] else 2


@compiled
def _number(s: Any, m: Model, w: Work, place: int) -> int:
    """The number of `_vary` for a place among all combinations of `_choices`."""
    number, unit = 0, 1
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i):
            digit, place = place % _choices(m, w, i), place // _choices(m, w, i)
            number += unit * (digit if w.stands[i] else 2 * digit)
            unit *= 4
    return number


@compiled
def _count_others(s: Any, m: Model, w: Work) -> None:
    """Note whether another set is consistent as well and leads to another motion, where there are few to try.

    Contacts that all slide may be such: friction makes what they do to each other no P-matrix, though it is symmetric.
    """
    sets = 1
    for j in range(s.na):
        if has_friction(m, w.idx[j]) and sets <= FEW:
            sets *= _choices(m, w, w.idx[j])
    if sets > FEW:
        return
    _keep(s, w)
    _evaluate(s, m, w)
    for j in range(s.na):
        w.chosen[j] = w.excess[j]
    for j in range(s.na):
        if has_friction(m, w.idx[j]) and w.stands[w.idx[j]] and w.state[w.idx[j]] != SLIP:
            _aim(m, w, w.idx[j])
    for i in range(s.nc):
        w.kept_other[i] = w.way[i]
    found = False
    for place in range(1, sets):
        for i in range(s.nc):
            w.way[i] = w.kept_other[i]
        _vary(s, m, w, _number(s, m, w, place))
        if _judge(s, m, w) < 0 and _jammed(s, m, w) < 0:
            for j in range(s.na):
                found = found or abs(w.excess[j] - w.chosen[j]) > DIFFERENT * s.push_scale
    if found and s.not_unique == 0:
        s.unique_until = s.t
    s.not_unique += found
    _put_back(s, m, w)


@compiled
def _hold_what_stands(s: Any, m: Model, w: Work) -> None:
    """Let contacts stick that would begin to slide, but go nowhere, if that is consistent too.

    Such a set tells of a load that is shared up to the bounds, as contacts which others hold may do in any direction.
    """
    tried = False
    _keep(s, w)
    for j in range(s.na):
        i = w.idx[j]
        idle = has_friction(m, i) and w.stands[i] and w.state[i] == SLIP and not (w.begins[i] or is_dry(m, i))
        if idle and _size(m, w, i, w.excess) <= IDLE * s.push_scale:
            _put(m, w, i, STICK)
            tried = True
    if not tried or (_judge(s, m, w) < 0 and _jammed(s, m, w) < 0):
        return
    _put_back(s, m, w)
    _judge(s, m, w)


@compiled
def _found(s: Any, m: Model, w: Work) -> bool:
    """Whether a consistent set is found, contacts as they are tried first."""
    _put_as_they_are(s, m, w)
    return bool(_iterate(s, m, w, ALL) or _swept(s, m, w, ALL) or _swept(s, m, w, WORST) or _near_sets(s, m, w))


@compiled
def _found_beside_a_jam(s: Any, m: Model, w: Work) -> bool:
    """Whether contacts that have come to where they jam together go on without one of them, which is about to open."""
    if s.jam:
        s.leeway = max(s.leeway, BESIDE_A_JAM * s.push_scale)
    return bool(s.jam and _found(s, m, w))


@compiled
def _most_pull(s: Any, m: Model, w: Work) -> float:
    """The most that pulls a contact back which stands: what it moves by is an error, and so is that.

    Rows of a body that rocks on several contacts which stick cannot all keep their velocities at zero.
    """
    most = 0.0
    for j in range(s.na):
        n = m.follows[w.idx[j]]
        if n >= 0 and has_friction(m, n) and w.stands[n]:
            most = max(most, abs(m.alpha[w.idx[j], 1] * w.hda[j]))
    return float(most)


@compiled
def decide(s: Any, m: Model, w: Work) -> int:
    """Leave in w.state the mode that the present instant, as evaluated, asks for, of every contact with friction.

    Returns:
        0, or NO_CONSISTENT_MODES or PAINLEVE; with one of these w.wants marks contacts.
    """
    note_speed(s, m, w, w.rate)
    s.leeway = 0.0
    _look(s, m, w)
    if not _found(s, m, w):
        s.leeway = max(_most_pull(s, m, w), decided_to(s))
        if not (_found(s, m, w) or _found_beside_a_jam(s, m, w)):
            return _mark(s, m, w)
    _hold_what_stands(s, m, w)
    _count_others(s, m, w)
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i):
            if w.stands[i]:
                count_from_none(m, w, i)
            if w.stands[i] and w.state[i] == SLIP:
                w.since[i] = s.t
                for c in range(_first(m, w, i), _first(m, w, i) + m.tangents[i]):
                    w.rest[w.idx[c]] = w.hda[c]
            w.tolerated[i] = decided_to(s) / w.gram[j, j]
    for i in range(s.nc):
        w.off[i], w.begins[i] = 0, 0
    return 0


@compiled
def _slide_on(s: Any, m: Model, w: Work) -> None:
    """Evaluate the set in which all that slid do, however slowly, each along its slip."""
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and w.slid[i]:
            size = slip(m, w, i, w.rate)
            for c in range(_first(m, w, i), _first(m, w, i) + m.tangents[i]):
                w.way[w.idx[c]] = (w.hda[c] - w.rest[w.idx[c]]) / size
            _put(m, w, i, SLIP)
    _evaluate(s, m, w)


@compiled
def _mark(s: Any, m: Model, w: Work) -> int:
    """Mark in w.wants the contact that has jammed, or all with friction; PAINLEVE or NO_CONSISTENT_MODES."""
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i):
            _put(m, w, i, STICK if w.stands[i] else SLIP)
    _evaluate(s, m, w)
    jammed = _jammed(s, m, w)
    if jammed < 0:
        _slide_on(s, m, w)
        jammed = _jammed(s, m, w)
    w.wants[:] = 0
    for j in range(s.na):
        i = w.idx[j]
        w.wants[i] = i == jammed or (jammed < 0 and has_friction(m, i))
    return int(PAINLEVE if jammed >= 0 else NO_CONSISTENT_MODES)


@compiled
def _jammed(s: Any, m: Model, w: Work) -> int:
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
