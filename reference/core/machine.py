"""The state machines (docs/explanation/model.md): what is switched at one instant, until nothing changes any more.

    level        FREE -> active        h <= 0 and (h' < 0 or h < 0)
                 active -> BALLISTIC   lam < 0, h <= 0         active -> FREE        lam < 0, h > 0
                 BALLISTIC -> FREE     h > 0                   BALLISTIC -> active   h <= 0, h' < 0, lam would be > 0
    edge         the same conditions, but only when they become true
    memoryless   lam = max(0, law) over all h <= 0: a linear complementarity problem

Thresholds are not absolute: h' counts as zero below 1e-9 of the largest rate seen, and lam as zero below what rounding
makes of it. Without them a release at lam = 0, h = 1e-17 switches for ever.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import (
    GENERAL,
    accelerate,
    activate,
    clear,
    is_active,
    pushed,
    scatter,
    weigh,
)
from crossbody.reference.core.algebra import ROUNDING, ULP, all_finite, copy, inverse_diagonal, solve_mass, solve_schur
from crossbody.reference.core.dop853 import START, derivative
from crossbody.reference.core.friction import STANDS, ask, decided_to, has_friction
from crossbody.reference.core.layout import (
    BALLISTIC,
    COLLISION,
    COLLISION_SEPARATION,
    CONTACT,
    EDGE,
    EXACT,
    FREE,
    ILL_POSED,
    LEVEL,
    NOT_FINITE,
    SLIP,
    STICK,
    Model,
    Work,
)
from crossbody.reference.core.loops import is_idle
from crossbody.reference.core.shares import CONSISTENT
from crossbody.reference.kinds import Bytes, Floats

SLOW = 1e-9  # part of the largest rate seen
DEEP = 1e-9  # m: a FREE gap below -DEEP, and below what it is known to, was started in penetration
TOUCHING = 64.0 * ULP  # of the largest coordinate, or of 1: a gap below it is closed as far as rounding tells
LIFTED = 1e-3  # of a row's time scale, for which one that was lifted off cannot be told from one that is held


@compiled
def slow(s: Any, w: Work, i: int) -> float:
    """The rate below which gap i is taken to stand still; of bodies at rest, beside what drives them."""
    return float(SLOW * max(s.speed, w.gained[i]))


@compiled
def known(s: Any, w: Work) -> float:
    """To what a gap is known, as far as the tolerance of the positions tells."""
    largest = 0.0
    for a in range(s.nq):
        largest = max(largest, w.atol[a] + s.rtol * abs(w.y[a]))
    return float(largest)


@compiled
def active_mode(s: Any, m: Model, w: Work, i: int) -> int:
    """COLLISION where the row has fast constants and follows them in real time, else CONTACT.

    With friction SLIP or STICK by the rates in w.rate; whether the latter holds is decided with all others that stand.
    """
    if s.frictional and has_friction(m, i):
        return STICK if ask(STANDS, s, m, w, i) > 0.0 else SLIP
    return COLLISION if m.beta[i, 0] > 0.0 and not s.frozen else CONTACT


@compiled
def released_mode(mode: int, h: float) -> int:
    """Where a row goes whose multiplier vanished."""
    if h > 0.0:
        return FREE
    return COLLISION_SEPARATION if mode == COLLISION else BALLISTIC


@compiled
def _from_state(s: Any, w: Work, i: int) -> float:
    """What rounding of the state makes of row i's law."""
    position, speed = 0.0, 0.0
    for a in range(s.nq):
        position = max(position, abs(w.y[a]))
    for a in range(s.nq, s.nq + s.n):
        speed = max(speed, abs(w.y[a]))
    return float(8.0 * ULP * (w.law[i, 0] * position + w.law[i, 1] * speed))


@compiled
def touching(s: Any, w: Work) -> float:
    """How large a gap rounding alone can make of a touch."""
    largest = 1.0
    for a in range(s.nq):
        largest = max(largest, abs(w.y[a]))
    return float(TOUCHING * largest)


@compiled
def _left_over(s: Any, m: Model, w: Work, i: int) -> float:
    """What the law of a row that came to rest makes of a gap that counts as closed and a rate that counts as none.

    Frozen collisions leave such a row with any of both, so that its multiplier says less than this about what presses.
    """
    if s.frozen == 0 or not m.beta[i, 0] > 0.0:
        return 0.0
    return float(w.law[i, 0] * s.touch + w.law[i, 1] * slow(s, w, i))


@compiled
def noise(s: Any, m: Model, w: Work) -> None:
    """What rounding of the state and of the sums, and what collisions left, can make of each multiplier.

    Row j is off its law by e_j, so that lam_i is off by at most the sum of |G^-1|_ij e_j. By Cauchy and Schwarz that is
    no more than sqrt (G^-1)_ii times the sum of sqrt (G^-1)_jj e_j, which bounds the change of v' in the norm of M.
    """
    touch, spread = touching(s, w), 0.0
    weigh(s, m, w, w.la)
    for j in range(s.na):
        if s.frictional:  # w.G has no factor, and what slides makes no symmetric matrix: by each row alone
            w.trial[j] = 1.0 / w.gram[j, j] if w.gram[j, j] > 0.0 else 0.0
        else:
            w.trial[j] = inverse_diagonal(w.G, s.na, w.reach, j, w.r)
        spread = max(spread, w.trial[j])
    largest, s.unsure = 0.0, 0.0
    for j in range(s.na):
        i = w.idx[j]
        # A touch stands open by the rounding of where bodies came from: near the origin that is more than theirs now.
        opened = w.law[i, 0] * w.ha[j] if 0.0 < w.ha[j] <= touch else 0.0
        if w.trial[j] == 0.0:  # one that depends on the others: its share is made of theirs
            w.trial[j] = spread
        s.unsure += np.sqrt(w.trial[j]) * (ROUNDING * (w.scale[j] + pushed(m, w, j)) + _from_state(s, w, i) + opened)
        w.r[j] = _left_over(s, m, w, i)
        largest = max(largest, w.r[j])
    for j in range(s.na):
        w.noise[w.idx[j]] = np.sqrt(w.trial[j]) * s.unsure
    if largest > 0.0:
        _spread_left_over(s, w)


@compiled
def _spread_left_over(s: Any, w: Work) -> None:
    """Add to every row's noise the most that G^-1 r can be in it, whatever the signs: r in w.r; Cauchy and Schwarz."""
    solve_schur(w.G, s.na, w.reach, w.r, w.Hdv)
    size2 = 0.0
    for j in range(s.na):
        size2 += w.r[j] * w.Hdv[j]
    for j in range(s.na):
        w.noise[w.idx[j]] += np.sqrt(size2 * inverse_diagonal(w.G, s.na, w.reach, j, w.scale))


@compiled
def evaluate(K: Any, s: Any, m: Model, w: Work, mode: Bytes) -> int:
    """Everything a machine asks for at the present instant: gaps, rates, multipliers, their noise."""
    nq = s.nq
    activate(s, m, w, mode)
    s.have_jacobian = 0
    if s.nc > 0:
        s.guards += 1
        K.gaps(s.t, w.y[:nq], w.y[nq:], m.p, w.gap, w.rate)
    if derivative(K, s, m, w, s.t, w.y, START) != 0:
        return ILL_POSED
    scatter(s, w, w.lam)
    if not (all_finite(w.vd) and all_finite(w.gap) and all_finite(w.rate) and all_finite(w.lam)):
        return NOT_FINITE
    speed, rate, unilateral, follows = s.speed, w.rate, m.unilateral, m.follows
    for i in range(s.nc):
        if unilateral[i] and follows[i] < 0:
            speed = max(speed, abs(rate[i]))
    s.speed = speed
    return 0


@compiled
def multiplier_if_active(
    K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int, t: float, q: Floats, v: Floats
) -> float:
    """Lam of row i if it were active now, from the same equations that the row would use; noise[i] beside it.

    That of the active rows stays: beside a row that nearly depends on them it would hide where they let go.
    """
    copy(w.noise, w.own_noise)
    before, unsure = mode[i], s.unsure
    mode[i] = active_mode(s, m, w, i)
    activate(s, m, w, mode)
    lam, dependent = -np.inf, -1
    w.tied[i] = 0
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, q, v, GENERAL) == 0:
        noise(s, m, w)
        dependent = s.dependent
        for j in range(s.na):
            if w.idx[j] == i:
                lam = w.la[j]
    mode[i] = before
    activate(s, m, w, mode)
    if s.sharing and dependent != 0:
        lam = _lacks(K, s, m, w, i, dependent, lam, t, q, v)
    if s.method == EXACT and s.na > 0:  # the arc stands on the factor of its own rows
        accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, q, v, GENERAL)
    w.own_noise[i], s.unsure = w.noise[i], unsure
    copy(w.own_noise, w.noise)
    return float(lam)


@compiled
def _off_law(m: Model, w: Work, j: int, i: int, on: float, v: Any, vd: Any) -> tuple[float, float]:
    """H'' and on (1 or 0) times a1 h' + a0 h + a2 h^3 of row i, evaluated in place j, and the size of the terms."""
    push, size, rate = w.Hdv[j], abs(w.Hdv[j]), 0.0
    for c in range(m.span[i, 0], m.span[i, 1]):
        push += w.H[j, c] * vd[c]
        size += abs(w.H[j, c] * vd[c])  # bodies in free fall cancel
        rate += w.H[j, c] * v[c]
    h, a0, a1, a2 = w.ha[j], w.law[i, 0], w.law[i, 1], w.law[i, 2]
    spring = (a0 + a2 * h * h) * h
    return push + on * (a1 * rate + spring), size + on * (a1 * abs(rate) + abs(spring))


@compiled
def _alone(K: Any, m: Model, w: Work, j: int, i: int, t: float, q: Any, v: Any) -> None:
    """Evaluate row i in place j, behind the active ones."""
    w.idx[j] = i
    clear(m, w, j)
    K.rows(t, q, v, m.p, w.w, w.idx[j:], 1, w.H[j:], w.ha[j:], w.Hdv[j:])


@compiled
def _stirred(s: Any, m: Model, w: Work, j: int) -> float:
    """What rounding of the active rows' multipliers makes of the law of the row in place j, behind them."""
    if s.na == 0:
        return 0.0
    first, last = m.span[w.idx[j], 0], m.span[w.idx[j], 1]
    for c in range(first, last):
        w.X[j, c] = w.H[j, c]
    if s.n == 1:  # `accelerate` leaves no factor of M
        w.X[j, 0] *= w.X[0, 0] / w.H[0, 0]
    else:
        solve_mass(w.L, w.X[j], m.above, s.k, first, last)
    G = 0.0
    for c in range(first, last):
        G += w.H[j, c] * w.X[j, c]
    return float(ROUNDING * pushed(m, w, j) + np.sqrt(G) * s.unsure)


@compiled
def _lacks(K: Any, s: Any, m: Model, w: Work, i: int, dependent: int, lam: float, t: float, q: Any, v: Any) -> float:
    """What row i lacks beside the active rows: its multiplier, or if it depends on them by how much it is off its law.

    One that they hold at its law counts as in contact; but not just after it was lifted off, or rounding would choose
    where a load is about to leave a row. If it were active, so many rows would be `dependent` (-1 if they contradicted
    each other), and `lam` would be its multiplier.
    """
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, q, v, GENERAL) != 0:
        return -np.inf
    if dependent == s.dependent:
        return lam
    noise(s, m, w)
    j = s.na
    _alone(K, m, w, j, i, t, q, v)
    off, size = _off_law(m, w, j, i, 1.0, v, w.vd)
    w.noise[i], w.tied[i] = 0.0, 1
    band = max(CONSISTENT, s.rtol) * size + _stirred(s, m, w, j) + 8.0 * _from_state(s, w, i)
    open_for = (t - w.let_go[i]) * max(np.sqrt(w.law[i, 0]), w.law[i, 1])
    return float(-off + band if open_for > LIFTED else -off - band)


@compiled
def off_law(K: Any, s: Any, m: Model, w: Work, i: int, t: float, q: Any, v: Any) -> float:
    """By how much row i, not active, moves faster than its law, the others following theirs; NaN if ill posed."""
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, t, q, v, GENERAL) != 0:
        return np.nan
    _alone(K, m, w, s.na, i, t, q, v)
    return _off_law(m, w, s.na, i, 1.0, v, w.vd)[0]


@compiled
def change_of_acceleration(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> float:
    """Square of what row i's joining or leaving the active rows changes v' by, in the norm of M: lam^2 / (G^-1)_ii."""
    before = mode[i]
    if not is_active(before):
        mode[i] = active_mode(s, m, w, i)
    activate(s, m, w, mode)
    size = 0.0
    found = accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[: s.nq], w.y[s.nq :], GENERAL) == 0
    if found and s.dependent == 0:  # a row that depends on the others changes nothing
        for j in range(s.na):
            if w.idx[j] == i:
                if s.frictional:
                    size = w.la[j] ** 2 * w.gram[j, j]
                else:
                    size = w.la[j] ** 2 / inverse_diagonal(w.G, s.na, w.reach, j, w.scale)
    mode[i] = before
    activate(s, m, w, mode)
    return float(size)


@compiled
def _own_press(K: Any, s: Any, m: Model, w: Work, i: int, at_rest: bool) -> bool:
    """Whether lam of row i would be positive: the rest of its law is negative with the others as they are.

    Lam of a row that joins is that rest over a positive number, so its sign needs no solution. A row at rest
    has no law yet: what is left of its gap and its rate is what collisions left, and presses nothing.
    """
    nq, j = s.nq, s.na
    _alone(K, m, w, j, i, s.t, w.y[:nq], w.y[nq:])
    off, size = _off_law(m, w, j, i, 0.0 if at_rest else 1.0, w.y[nq:], w.k[START, nq:])
    rounding = ROUNDING * size + _stirred(s, m, w, j) + _from_state(s, w, i)
    if s.frictional:  # or what was left off would join again, for ever
        rounding = max(rounding, decided_to(s))
    return bool(-off > rounding + _left_over(s, m, w, i))


@compiled
def _would_press(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int, at_rest: bool) -> bool:
    """Whether row i would push if it were active now; the acceleration of the present modes stands in k[0]."""
    if at_rest or (not s.has_solve and active_mode(s, m, w, i) != COLLISION):
        return _own_press(K, s, m, w, i, at_rest)
    lam = multiplier_if_active(K, s, m, w, mode, i, s.t, w.y[: s.nq], w.y[s.nq :])
    return bool(lam > w.noise[i])


@compiled
def _is_held(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> bool:
    """Whether row i, below the surface, depends on the active rows and follows its law with them."""
    if s.frictional:
        return _is_held_beside_friction(K, s, m, w, mode, i)
    if not w.shares[i] or s.na == 0:
        return False
    lam = multiplier_if_active(K, s, m, w, mode, i, s.t, w.y[: s.nq], w.y[s.nq :])
    return bool(w.tied[i] and lam > 0.0)


@compiled
def _is_held_beside_friction(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> bool:
    """Whether row i, which has no friction, depends on the active rows and follows its law with them.

    Those it depends on may let go later on, as it opens: whether it then takes over rounding must not have chosen.
    """
    lifted = (s.t - w.let_go[i]) * max(np.sqrt(w.law[i, 0]), w.law[i, 1]) <= LIFTED
    if has_friction(m, i) or s.na == 0 or lifted:
        return False
    _alone(K, m, w, s.na, i, s.t, w.y[: s.nq], w.y[s.nq :])
    if abs(_off_law(m, w, s.na, i, 1.0, w.y[s.nq :], w.k[START, s.nq :])[0]) > decided_to(s):
        return False
    before, kept = s.dependent_rows, mode[i]
    mode[i] = CONTACT
    activate(s, m, w, mode)
    code = accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[: s.nq], w.y[s.nq :], GENERAL)
    depends = code == 0 and s.dependent_rows > before
    mode[i] = kept
    activate(s, m, w, mode)
    accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[: s.nq], w.y[s.nq :], GENERAL)
    return bool(depends)


@compiled
def _stays(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> bool:
    """Whether loops hold contact i, which stands at its surface: with what it presses no law says, as just below it."""
    if not (s.frictional and s.loops and has_friction(m, i) and abs(w.rate[i]) <= slow(s, w, i)):
        return False
    held = False
    mode[i] = active_mode(s, m, w, i)
    activate(s, m, w, mode)
    if accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[: s.nq], w.y[s.nq :], GENERAL) == 0:
        for j in range(s.na):
            held = held or (w.idx[j] == i and is_idle(w, j))
    mode[i] = FREE
    activate(s, m, w, mode)
    return held


@compiled
def _rests(s: Any, w: Work, i: int) -> bool:
    """Whether row i is at its surface as far as rounding tells, where loads jump, and was not let go at this instant.

    Which of the corners of a box that rests are a little open, or below, rounding decides. Where forces come on they
    press together: from a gap of rounding one would gain a speed far above it.
    """
    lies = s.frictional and s.jumps and abs(w.gap[i]) <= s.touch and abs(w.rate[i]) <= slow(s, w, i)
    return bool(lies and w.let_go[i] != s.t)


@compiled
def _next_level(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> int:
    """Where the level machine puts row i at this instant."""
    h, rate = w.gap[i], w.rate[i]
    if is_active(mode[i]):
        return released_mode(mode[i], h) if w.lam[i] < -w.noise[i] else int(mode[i])
    collides = s.frozen != 0 and m.beta[i, 0] > 0.0
    if _rests(s, w, i):
        presses = _would_press(K, s, m, w, mode, i, False) or (mode[i] == FREE and _stays(K, s, m, w, mode, i))
        return active_mode(s, m, w, i) if presses else int(mode[i])
    if h > (s.touch if collides and mode[i] == FREE else 0.0):
        return FREE
    if collides and rate < -slow(s, w, i):
        return int(mode[i])
    if mode[i] != FREE:
        closing = rate < -slow(s, w, i)
        if closing and (_would_press(K, s, m, w, mode, i, False) or _is_held(K, s, m, w, mode, i)):
            return active_mode(s, m, w, i)
        return int(mode[i])
    if rate < -slow(s, w, i):
        return active_mode(s, m, w, i)
    if h < -max(DEEP, known(s, w)):
        return active_mode(s, m, w, i) if _would_press(K, s, m, w, mode, i, False) else BALLISTIC
    if rate <= slow(s, w, i) and (_would_press(K, s, m, w, mode, i, collides) or _stays(K, s, m, w, mode, i)):
        return active_mode(s, m, w, i)
    return FREE


@compiled
def _next_memoryless(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> int:
    """Where the complementarity problem's next pivot puts row i; below the surface it is CONTACT or BALLISTIC."""
    if mode[i] == FREE and not (w.gap[i] <= s.touch and (w.rate[i] <= slow(s, w, i) or w.gap[i] < -DEEP)):
        return FREE
    if is_active(mode[i]):
        return BALLISTIC if w.lam[i] < -w.noise[i] else CONTACT
    if w.gap[i] > s.touch:
        return FREE
    return CONTACT if _would_press(K, s, m, w, mode, i, False) else BALLISTIC


@compiled
def next_mode(K: Any, s: Any, m: Model, w: Work, mode: Bytes, i: int) -> int:
    """Where the machine in force puts row i at this instant."""
    if s.fsm == LEVEL:
        return _next_level(K, s, m, w, mode, i)
    if s.fsm == EDGE:  # a row activated at this instant with lam < 0 has its edge; nothing else becomes true here
        fresh = mode[i] == CONTACT and (w.kind[i] == 1 or w.kind[i] == 2)
        w.kind[i] = 0
        return BALLISTIC if fresh and w.lam[i] < -w.noise[i] else int(mode[i])
    return _next_memoryless(K, s, m, w, mode, i)
