"""What the loop asks about friction, answered by one function that stands at one address."""

from __future__ import annotations

from typing import Any

from crossbody.reference.cache import compiled
from crossbody.reference.core import (
    cones,
    coulomb,
    jams,
    loops,
    slips,
    sticking,
    stops,
    turning,
    undetermined,
)
from crossbody.reference.core.friction import (
    BEGIN,
    BEGIN_SLIP,
    DECIDE,
    DETERMINANT,
    DIES_INTO_JAM,
    FACTOR,
    HOLDS_ON,
    JAMS,
    MARGIN,
    NEAR_JAM,
    RENEW,
    RESPOND,
    SETTLED,
    SOLVE,
    STANDS,
    TURN_PART,
    TURNING_RATE,
    TURNS_ASIDE,
    WATCH,
    slip,
    small_slip,
)
from crossbody.reference.core.layout import Model, Work


@compiled
def _respond(s: Any, m: Model, w: Work) -> None:
    """Fill w.la of all rows in contact by how it changes with w.r."""
    if s.loops:
        loops.reduce_right(s, m, w, w.r)
    coulomb.respond(s, m, w, w.r, w.la)
    if s.loops:
        loops.complete(s, m, w, w.r, w.la, True)


@compiled
def _turn_part(s: Any, m: Model, w: Work, i: int) -> float:
    """Return `turning.turn_part`, with what loops do to it in w.la."""
    turns = turning.turn_part(s, m, w, i)
    if s.loops:
        loops.complete(s, m, w, w.r, w.la, False)
    return 1.0 if turns else 0.0


def answer(what: int, s: Any, m: Model, w: Work, i: int) -> float:
    """Do, or tell, what is asked.

    FACTOR          A from G; i = 1 if directions of slip turn; 1 if it is not finite
    SOLVE           w.la from w.r
    RESPOND         likewise, but for what slides with a bound of its own: how multipliers change with w.r
    DETERMINANT     how far the contacts that contact i, which slides, bears on are from a jam
    MARGIN          how far contact i is from sliding
    WATCH           either of all contacts, into w.cones[i]
    TURNING_RATE    fastest rate at which a slip turns, i = 1 of those that have just begun
    TURN_PART       1 if the slip of contact i turns it, by w.bent, and in w.la what a radian makes of all multipliers
    STANDS          1 if contact i has no slip velocity
    HOLDS_ON        1 if contact i, which sticks, surely does so throughout the step
    BEGIN           of a run: forget what another one left
    RENEW           directions of slip after a step; 1 if contacts have stopped there, which are marked
    TURNS_ASIDE     1 if a contact whose slip falls to zero along its direction of reference has one across it there
    BEGIN_SLIP      of contacts that have reached their bounds, there
    DECIDE          modes of all contacts at this instant, in w.state; a code, and with it in w.wants whom it is about
    JAMS            how far the contact that slides nearest to a jam is from it; that of each into w.cones[i]
    DIES_INTO_JAM   1 if contact i, whose slip dies out, jams before it is at rest; what lets go on the way does so
    NEAR_JAM        1 if forces of what has fired are not known, so near to a jam
    SETTLED         follow what the law leaves open, where modes have settled
    """
    if what == FACTOR:
        return float(coulomb.factor(s, m, w, i != 0))
    if what == SOLVE:
        coulomb.solve(s, m, w, w.r, w.la)
        if s.dependent_rows > 0:
            s.contradiction = coulomb.contradiction(s, m, w, w.la)
        if s.loops:
            loops.complete(s, m, w, w.r, w.la, True)
    elif what == RESPOND:
        _respond(s, m, w)
    elif what == DETERMINANT:
        return float(jams.determinant(s, m, w, w.listed[i]))
    elif what == MARGIN:
        cones.without_pull(s, m, w)
        return float(cones.margin(s, m, w, i))
    elif what == WATCH:
        cones.watch_friction(s, m, w, w.cones[i])
    elif what == TURNING_RATE:
        return float(turning.turning_rate(s, m, w, i != 0))
    elif what == TURN_PART:
        return float(_turn_part(s, m, w, i))
    elif what == RENEW:
        linger = slips.renew(s, m, w, w.rates[0])
        undetermined.follow_shares(s, m, w, False)
        return 1.0 if linger else 0.0
    elif what == TURNS_ASIDE:
        return 1.0 if slips.turns_aside(s, m, w) else 0.0
    elif what == STANDS:
        return 1.0 if slip(m, w, i, w.rate) <= small_slip(s, w, i) else 0.0
    elif what == HOLDS_ON:
        return 1.0 if cones.holds_on(s, m, w, i) else 0.0
    elif what == BEGIN_SLIP:
        sticking.begin_slip(s, m, w)
    elif what == DECIDE:
        return float(sticking.decide(s, m, w))
    elif what == SETTLED:
        undetermined.follow_shares(s, m, w, True)
    elif what == DIES_INTO_JAM:
        return 1.0 if stops.dies_into_jam(s, m, w, i) else 0.0
    elif what == NEAR_JAM:
        return 1.0 if jams.near(s, m, w) else 0.0
    elif what == JAMS:
        return float(jams.watch(s, m, w, w.cones[i]))
    elif what == BEGIN:
        slips.begin(s, m, w)
    return 0.0
