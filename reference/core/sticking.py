"""Which contacts stick, which slide and which let go at one instant: the mode problem of friction."""

from __future__ import annotations

from typing import Any

from crossbody.reference.cache import compiled
from crossbody.reference.core.cones import within_bound, without_pull
from crossbody.reference.core.contradictions import strays_into_jam
from crossbody.reference.core.friction import (
    bound,
    count_from_none,
    decided_to,
    has_friction,
    is_decided,
    is_dry,
    small_slip,
)
from crossbody.reference.core.guards import CONE
from crossbody.reference.core.layout import FREE, NO_CONSISTENT_MODES, PAINLEVE, SLIP, STICK, Model, Work
from crossbody.reference.core.loads import INSIDE
from crossbody.reference.core.loops import is_idle
from crossbody.reference.core.mode_path import approached
from crossbody.reference.core.mode_search import (
    ALL,
    FEW_SETS,
    MANY_SETS,
    STRICT,
    STRICT_IF_DRY,
    WORST,
    iterate,
    judge,
    near_sets,
    swept,
)
from crossbody.reference.core.mode_set import (
    DIFFERENT,
    evaluate_set,
    face_against,
    first_row,
    jammed,
    keep,
    look,
    off_stick,
    put,
    put_as_they_are,
    put_as_they_stand,
    put_back,
    size_along,
)
from crossbody.reference.core.others import count_others, note_first
from crossbody.reference.core.slips import face, note_speed

BESIDE_A_JAM = DIFFERENT  # part of the largest acceleration by which rows may be off where two would jam together
AT_BOUND = 2.0 * (1.0 - INSIDE)  # part of its bound below it at which a contact has reached it, where loads are shared
ITSELF, BESIDE = 1, 2  # has reached its bound; with one that has
SLIGHT = 1e-6  # part of the largest acceleration by which sticks may contradict each other
IDLE = 1e-7  # part of the largest acceleration below which one that begins to slide goes nowhere


@compiled
def begin_slip(s: Any, m: Model, w: Work) -> None:
    """Let contacts that have reached their bounds begin to slide against the forces that held them, as evaluated.

    Those that share their loads have reached theirs as well, to what loads are shared: none of them slides alone.
    """
    without_pull(s, m, w)
    for i in range(s.nc):
        if w.hit[i] <= s.theta and w.kind[i] == CONE and not (s.growth >= 1.0 and within_bound(m, w, i) > 0.0):
            w.begins[i] = ITSELF
    for j in range(s.na if s.dependent_rows > 0 else 0):
        i = w.idx[j]
        near = has_friction(m, i) and not w.slides[i] and within_bound(m, w, i) <= AT_BOUND * bound(m, i, w.la[j])
        if near and not w.begins[i]:
            w.begins[i] = BESIDE
    for i in range(s.nc):
        if w.begins[i]:
            face_against(m, w, i, w.la)


@compiled
def _hold_what_stands(s: Any, m: Model, w: Work) -> None:
    """Let contacts stick that would begin to slide, but go nowhere, if that is consistent too.

    Such a set tells of a load that is shared up to the bounds, as contacts which others hold may do in any direction.
    """
    tried = False
    keep(s, w)
    for j in range(s.na):
        i = w.idx[j]
        idle = has_friction(m, i) and w.stands[i] and w.state[i] == SLIP and not (w.begins[i] or is_dry(m, i))
        if idle and size_along(m, w, i, w.excess) <= IDLE * s.push_scale:
            put(m, w, i, STICK)
            tried = True
    if not tried or (judge(s, m, w) < 0 and jammed(s, m, w) < 0):
        return
    put_back(s, m, w)
    judge(s, m, w)


@compiled
def _press_where_held(s: Any, m: Model, w: Work) -> None:
    """Let rows without friction press that have been found off, but are held at their law by others they depend on.

    All bodies move the same; which of those rows are in contact rounding would choose, and it matters where they open.
    """
    for j in range(s.na):
        i = w.idx[j]
        held = is_decided(w, i) and not has_friction(m, i) and w.state[i] == FREE
        if held and abs(w.excess[j]) <= decided_to(s):
            before = s.dependent_rows
            keep(s, w)
            put(m, w, i, STICK)
            if not (judge(s, m, w) < 0 and s.dependent_rows > before and jammed(s, m, w) < 0):
                put_back(s, m, w)
                judge(s, m, w)


@compiled
def _begin_at_last(s: Any, m: Model, w: Work) -> None:
    """Let contacts slide that have reached their bounds here before and stuck again, if that is nearly consistent.

    At its bound one that sticks and one that slides differ by rounding, which must not have them take turns for ever.
    One whose load and bound vanish together lets go.
    """
    tried, before = False, s.leeway
    keep(s, w)
    for j in range(s.na):
        i = w.idx[j]
        if w.begins[i] == ITSELF and w.state[i] == STICK:
            light = not is_dry(m, i) and w.la[j] * w.gram[j, j] <= IDLE * s.push_scale
            put(m, w, i, FREE if light else SLIP)
            tried = True
    if tried:
        s.leeway = max(s.leeway, IDLE * s.push_scale)
        fits = judge(s, m, w) < 0
        s.leeway = before
        if not fits:
            put_back(s, m, w)
            judge(s, m, w)


@compiled
def _reached(s: Any, m: Model, w: Work) -> bool:
    """Whether a consistent set is reached from contacts as they are, from what sweeps give, or on a way."""
    put_as_they_are(s, m, w)
    return bool(iterate(s, m, w, ALL) or swept(s, m, w, ALL) or swept(s, m, w, WORST) or approached(s, m, w))


@compiled
def _found(s: Any, m: Model, w: Work) -> bool:
    """Whether a consistent set is reached, or found among those that differ in few contacts."""
    return bool(_reached(s, m, w) or near_sets(s, m, w, FEW_SETS))


@compiled
def _meet_all(s: Any, m: Model, w: Work) -> int:
    """Let sticks that contradict each other yield to a set that all rows meet, if there is one.

    Two feet of a body that turns cannot both stand. Where they contradict each other slightly, as those of a flat one
    that rocks, or where no set is met, which is noted, they are met in the least squares. What moves a contact then in
    a direction in which it jams is no motion: that contact is returned, else -1.
    """
    most = 0.0
    for j in range(s.na if s.dependent_rows > 0 and s.leeway == 0.0 else 0):
        i = w.idx[j]
        if has_friction(m, i) and w.state[i] == STICK:
            most = max(most, off_stick(s, m, w, i))
    if most <= (0.0 if s.drifts else SLIGHT * s.push_scale):
        return -1
    s.strict = STRICT
    if _found(s, m, w):
        return -1
    s.strict = STRICT_IF_DRY
    if not _found(s, m, w):
        s.strict = 0
        _found(s, m, w)
    strays = strays_into_jam(s, m, w, SLIGHT * s.push_scale)
    if strays < 0:
        note_first(s, True)
        s.unmet += 1
    return int(strays)


@compiled
def _found_if_fewer_begin(s: Any, m: Model, w: Work) -> bool:
    """Whether a consistent set is found if none begins to slide for being at its bound beside another one."""
    fewer = False
    for i in range(s.nc):
        if w.begins[i] == BESIDE:
            w.begins[i], fewer = 0, True
    if fewer:
        look(s, m, w)
    return bool(fewer and _found(s, m, w))


@compiled
def _found_beside_a_jam(s: Any, m: Model, w: Work) -> bool:
    """Whether contacts that have come to where they jam together go on without one of them, which is about to open."""
    if s.jam:
        s.leeway = max(s.leeway, BESIDE_A_JAM * s.push_scale)
    return bool(s.jam and _found(s, m, w))


@compiled
def _most_pull(s: Any, m: Model, w: Work) -> float:
    """The most that pulls a contact back which stands, or rests: what it moves by is an error, and so is that.

    Rows of a body that rocks on several contacts which stick cannot all keep their velocities at zero.
    """
    most = 0.0
    for j in range(s.na):
        i, n = w.idx[j], m.follows[w.idx[j]]
        rests = n < 0 and is_decided(w, i) and abs(w.hda[j]) <= small_slip(s, w, i)
        if rests or (n >= 0 and has_friction(m, n) and w.stands[n]):
            most = max(most, abs(m.alpha[i, 1] * w.hda[j]))
    return float(most)


@compiled
def _leaves_open(s: Any, m: Model, w: Work) -> bool:
    """Whether loops hold a contact that may slide: how hard it presses, and its friction, no law says."""
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and not is_dry(m, i) and is_idle(w, j):
            for c in range(first_row(m, w, i), first_row(m, w, i) + m.tangents[i]):
                if not is_idle(w, c):
                    return True
    return False


@compiled
def decide(s: Any, m: Model, w: Work) -> int:
    """Leave in w.state the mode that the present instant, as evaluated, asks for, of every contact with friction.

    Returns:
        0, or NO_CONSISTENT_MODES or PAINLEVE; with one of these w.wants marks contacts.
    """
    note_speed(s, m, w, w.rate)
    s.leeway, s.held_unknowns, s.pressed_in = 0.0, -1, -1
    look(s, m, w)
    if not (_found(s, m, w) or _found_if_fewer_begin(s, m, w)):
        s.leeway = max(_most_pull(s, m, w), decided_to(s))
        if not (_found(s, m, w) or _found_beside_a_jam(s, m, w) or near_sets(s, m, w, MANY_SETS)):
            return _mark(s, m, w)
    strays = _meet_all(s, m, w)
    if strays >= 0:
        w.wants[:] = 0
        w.wants[strays] = 1
        return PAINLEVE
    if s.one_by_one:
        _begin_at_last(s, m, w)
    _hold_what_stands(s, m, w)
    _press_where_held(s, m, w)
    count_others(s, m, w)
    s.strict = 0
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i):
            if w.stands[i]:
                count_from_none(m, w, i)
            if w.stands[i] and w.state[i] == SLIP:
                w.since[i] = s.t
                for c in range(first_row(m, w, i), first_row(m, w, i) + m.tangents[i]):
                    w.rest[w.idx[c]] = w.hda[c]
            w.tolerated[i] = 0.0 if is_idle(w, j) else decided_to(s) / w.gram[j, j]
    for i in range(s.nc):
        w.off[i], w.begins[i] = 0, 0
    if s.loops and not s.indeterminate and _leaves_open(s, m, w):
        s.indeterminate, s.loops_press, s.determined_until = 1, 1, s.t
    return 0


@compiled
def _slide_on(s: Any, m: Model, w: Work) -> None:
    """Evaluate the set in which all that slid do, however slowly, each along its slip."""
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and w.slid[i]:
            face(m, w, i, w.rate)
            put(m, w, i, SLIP)
    evaluate_set(s, m, w)


@compiled
def _mark(s: Any, m: Model, w: Work) -> int:
    """Mark in w.wants the contact that has jammed, or all with friction; PAINLEVE or NO_CONSISTENT_MODES."""
    put_as_they_stand(s, m, w)
    evaluate_set(s, m, w)
    worst = jammed(s, m, w)
    if worst < 0:
        _slide_on(s, m, w)
        worst = jammed(s, m, w)
    if worst < 0:
        worst = s.pressed_in
    w.wants[:] = 0
    for j in range(s.na):
        i = w.idx[j]
        w.wants[i] = i == worst or (worst < 0 and has_friction(m, i))
    return int(PAINLEVE if worst >= 0 else NO_CONSISTENT_MODES)
