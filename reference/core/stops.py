"""What a slip that dies out meets before it stops: how slow it is makes no difference to where it turns."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.cones import within_bound
from crossbody.reference.core.coulomb import factor_as_held, respond
from crossbody.reference.core.friction import CLEAR, decided_to, has_begun, has_friction, is_dry, slip, small_slip
from crossbody.reference.core.guards import RELEASE, at_node
from crossbody.reference.core.jams import determinant
from crossbody.reference.core.layout import NODES, Model, Work
from crossbody.reference.core.mode_set import aside, exceed
from crossbody.reference.core.slips import angle

PARTS, HALVINGS = 48, 40  # of a full turn that are looked at, and between two of these


@compiled
def _last_clear(s: Any, m: Model, w: Work, i: int) -> float:
    """Angle of the slip of contact i where it last was clear of zero: at a node before s.theta, or at a step's end."""
    t = m.tangent[i]
    found = w.course[i] if w.course[i] < np.inf else np.arctan2(w.way[t + 1], w.way[t])
    for node in range(NODES):
        if at_node(node) <= s.theta and slip(m, w, i, w.rates[node]) > CLEAR * small_slip(s, w, i):
            found = angle(m, w, i, w.rates[node])
    return float(found)


@compiled
def _distance(s: Any, m: Model, w: Work, i: int, at: float) -> float:
    """Let contact i slide at an angle; how far it is from a jam then."""
    c = w.listed[m.tangent[i]]
    w.along[c], w.along[c + 1] = np.cos(at), np.sin(at)
    factor_as_held(s, m, w)
    return float(determinant(s, m, w, w.listed[i]))


@compiled
def _pulling(s: Any, m: Model, w: Work) -> int:
    """The contact that pulls most under w.la, -1 if none does."""
    found, most = -1, decided_to(s)
    for j in range(s.na):
        i = w.idx[j]
        pull = -w.la[j] * w.gram[j, j]
        if m.unilateral[i] and m.follows[i] < 0 and pull > most:
            found, most = int(i), pull
    return found


@compiled
def _breaks_away(s: Any, m: Model, w: Work) -> bool:
    """Whether a contact that sticks would bear more than its bound under w.la."""
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and not w.slides[i] and within_bound(m, w, i) * w.gram[j, j] < -decided_to(s):
            return True
    return False


@compiled
def _across(s: Any, m: Model, w: Work, i: int, at: float) -> float:
    """How fast the slip of contact i is accelerated across the angle `at` along which it slides.

    It is not a number where the contact jams, or another one would pull or break away: what follows is another set's.
    """
    if _distance(s, m, w, i, at) <= 0.0:
        return np.nan
    respond(s, m, w, w.pushed, w.la)
    if _pulling(s, m, w) >= 0 or _breaks_away(s, m, w):
        return np.nan
    exceed(s, w, w.pushed, w.la)
    return float(aside(m, w, i))


@compiled
def _may_jam(s: Any, m: Model, w: Work, i: int) -> bool:
    """Whether contact i would jam in any direction: the determinant is of first degree in cosine and sine."""
    ahead, beside, behind = (
        _distance(s, m, w, i, 0.0), _distance(s, m, w, i, 0.5 * np.pi), _distance(s, m, w, i, np.pi),
    )  # fmt: skip
    mean = 0.5 * (ahead + behind)
    return bool(mean <= np.hypot(ahead - mean, beside - mean))


@compiled
def _jams_where_barred(s: Any, m: Model, w: Work, i: int, at: float) -> bool:
    """Whether contact i jams at an angle behind which it has no acceleration of its set; one that lets go does so."""
    if _distance(s, m, w, i, at) <= 0.0:
        return True
    respond(s, m, w, w.pushed, w.la)
    k = _pulling(s, m, w)
    if k >= 0 and not _breaks_away(s, m, w):
        w.hit[k], w.kind[k] = s.theta, RELEASE
    return False


@compiled
def _turns_into_jam(s: Any, m: Model, w: Work, i: int) -> bool:
    """Whether the slip of contact i turns into a direction in which it jams before it comes to one that it keeps.

    Near zero it obeys z' = a(z / |z|), all else as it stands: its direction follows the part of a across it, at a rate
    that goes as 1/|z|, and the way that it takes is the same however small it is.
    """
    low = _last_clear(s, m, w, i)
    across = _across(s, m, w, i, low)
    if np.isnan(across):
        return False  # the step has not come this way
    turn = np.copysign(2.0 * np.pi / PARTS, across)
    for _ in range(PARTS):
        high = low + turn
        now = _across(s, m, w, i, high)
        barred = np.isnan(now)
        for _ in range(HALVINGS if barred else 0):
            middle = 0.5 * (low + high)
            now = _across(s, m, w, i, middle)
            if np.isnan(now):
                high = middle
            elif now * across <= 0.0:
                return False
            else:
                low = middle
        if barred:
            return bool(_jams_where_barred(s, m, w, i, high))
        if now * across <= 0.0:
            return False
        low = high
    return False


@compiled
def presses_alone(s: Any, m: Model, w: Work) -> bool:
    """Whether no contact presses but one, of the rows in contact as evaluated."""
    pressing = 0
    for j in range(s.na):
        pressing += m.unilateral[w.idx[j]] and m.follows[w.idx[j]] < 0
    return bool(pressing == 1)


@compiled
def dies_into_jam(s: Any, m: Model, w: Work, i: int) -> bool:
    """Whether contact i, whose slip dies out at the present instant as evaluated, jams before it is at rest.

    Another contact that lets go on the way does so here.
    """
    if is_dry(m, i) or m.tangents[i] == 1 or has_begun(w, i) or not w.slides[i]:
        return False
    for j in range(s.na):
        k = w.idx[j]
        slides = has_friction(m, k) and w.slides[k] and not is_dry(m, k)
        if k != i and slides and slip(m, w, k, w.rate) <= small_slip(s, w, k):
            return False  # several turn together
    c = w.listed[m.tangent[i]]
    x, y = w.along[c], w.along[c + 1]
    jams = (_may_jam(s, m, w, i) or not presses_alone(s, m, w)) and _turns_into_jam(s, m, w, i)
    w.along[c], w.along[c + 1] = x, y
    factor_as_held(s, m, w)
    return bool(jams)
