"""Coulomb friction as the loop meets it: what it asks for at a step, and the call that has the rest done.

The algebra of rows that stick and slide and the search for their modes (`coulomb`, `sticking`) are half as much code
again as the loop. They are compiled on their own, once a scene has friction; the state has the address at which they
stand. No other scene compiles them, and none calls them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.apart import number_at
from crossbody.reference.core.layout import SLIP, Model, Work
from crossbody.reference.kinds import Array, Bytes

SMALL_SLIP = 1e-9  # of the largest speed: a slip velocity below has no direction of its own,
SMALL_SLIP_STEPS = 10.0  # or below so many times the relative tolerance
CLEAR = 10.0  # times as much as has no direction, or it began with: then a slip is known as well as any other
DRIFT = 10.0  # times as much as has no direction, from which on a contact that sticks is known not to
TOLERATED = 1e-10  # part of the largest acceleration by which a set of modes may be off

(
    BEGIN, FACTOR, SOLVE, RESPOND, DETERMINANT, MARGIN, WATCH, TURNING_RATE, TURN_PART, RENEW, TURNS_ASIDE, STANDS,
    HOLDS_ON, BEGIN_SLIP, DECIDE, SETTLED, JAMS, DIES_INTO_JAM, NEAR_JAM,
) = np.arange(19)  # fmt: skip
NOTHING, BEGUN = np.arange(2)  # beside what is asked of all rows together, and of slips that have just begun


@compiled
def ask(what: int, s: Any, m: Model, w: Work, i: int) -> float:
    """Have something done, or told, by the code of friction: `friction_answers` says what."""
    return float(number_at(s.friction_code, (what, s, m, w, i)))


@compiled
def has_friction(m: Model, i: int) -> bool:
    """Whether row i is the normal row of a contact with friction, or has dry friction of its own."""
    return bool(m.tangents[i] > 0)


@compiled
def is_decided(w: Work, i: int) -> bool:
    """Whether the search for modes decides on row i: it has friction, or presses without beside rows that have."""
    return bool(w.decides[i])


@compiled
def is_dry(m: Model, i: int) -> bool:
    """Whether row i has dry friction of its own: its own tangential row, always in contact, of a constant bound."""
    return bool(m.tangent[i] == i)


@compiled
def bound(m: Model, i: int, normal: float) -> float:
    """The most that friction of row i can be, where its normal row presses with `normal`."""
    return float(m.friction[i] if is_dry(m, i) else m.friction[i] * normal)


@compiled
def small_slip(s: Any, w: Work, i: int) -> float:
    """The slip velocity of contact i below which the direction of the last step's start holds.

    Where all is at rest speeds are those of errors alone: what drives its bodies at present says then what is slow.
    """
    return float(max(_known_to(s) * s.slip_speed, SMALL_SLIP * w.gained[i]) + s.atol)


@compiled
def least_slip(s: Any) -> float:
    """The slip velocity below which one that falls has stopped, as far as known: small beside slow slides as well."""
    return float(_known_to(s) * s.slip_speed + s.atol)


@compiled
def _known_to(s: Any) -> float:
    """To what part of the largest speed a slip velocity is known."""
    return float(max(SMALL_SLIP, SMALL_SLIP_STEPS * s.rtol))


@compiled
def most_drift(s: Any, w: Work, i: int) -> float:
    """The slip velocity above which contact i, which should stick, slides: with others it cannot keep where it is."""
    return DRIFT * small_slip(s, w, i)


@compiled
def decided_to(s: Any) -> float:
    """By how much accelerations of rows may be off where modes are decided."""
    return float(TOLERATED * s.push_scale + s.leeway)


@compiled
def slip(m: Model, w: Work, i: int, rate: Array) -> float:
    """Size of the slip velocity of contact i from that with which it began, by the rates of all rows."""
    square = 0.0
    for t in range(m.tangent[i], m.tangent[i] + m.tangents[i]):
        square += (rate[t] - m.drift[t] - w.rest[t]) ** 2
    return float(np.sqrt(square))


@compiled
def slip_along(m: Model, w: Work, i: int, rate: Array) -> float:
    """Slip velocity of contact i along its direction of reference, against that with which it began."""
    total = 0.0
    for t in range(m.tangent[i], m.tangent[i] + m.tangents[i]):
        total += (rate[t] - m.drift[t] - w.rest[t]) * w.way[t]
    return float(total)


@compiled
def has_begun(w: Work, i: int) -> bool:
    """Whether the slip of contact i has just begun: it is no faster than what is not known of where it did."""
    return bool(w.since[i] > -np.inf)


@compiled
def count_from_none(m: Model, w: Work, i: int) -> None:
    """Forget with what velocity the slip of contact i began."""
    w.since[i] = -np.inf
    for t in range(m.tangent[i], m.tangent[i] + m.tangents[i]):
        w.rest[t] = 0.0


@compiled
def enter(s: Any, m: Model, w: Work, mode: Bytes) -> None:
    """Write which rows slide: a normal row whose tangential ones are not solved for, and these; they have no law.

    The next slip of a contact that does not slide counts from what its velocity is then.
    """
    s.islands = -1
    for i in range(s.nc):
        w.slides[i] = 0
    for i in range(s.nc):
        if has_friction(m, i) and mode[i] == SLIP:
            w.slides[i] = 1
            for t in range(m.tangent[i], m.tangent[i] + m.tangents[i]):
                w.slides[t] = 1
                w.law[t, 0], w.law[t, 1], w.law[t, 2] = 0.0, 0.0, 0.0
        else:
            w.within[i], w.course[i] = np.inf, np.inf
            count_from_none(m, w, i)


@compiled
def watch_slips(s: Any, m: Model, w: Work, stage: int) -> None:
    """Keep the slips of contacts that slide, along their directions of reference, at a stage of a step."""
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and w.slides[i]:
            total = 0.0
            for t in range(m.tangent[i], m.tangent[i] + m.tangents[i]):
                total += (w.hda[w.listed[t]] - w.rest[t]) * w.way[t]
            w.slip_at[stage, i] = total


@compiled
def is_tangent(m: Model, i: int) -> bool:
    """Whether row i is a tangential row of a contact with friction, or has dry friction of its own."""
    return bool(m.follows[i] >= 0 and m.tangents[m.follows[i]] > 0)


@compiled
def is_shared(s: Any, m: Model, w: Work, i: int) -> bool:
    """Whether row i has no law of its own to follow: it slides, or it sticks with others that it depends on."""
    return bool(is_tangent(m, i) and (w.slides[i] or s.dependent_rows > 0))
