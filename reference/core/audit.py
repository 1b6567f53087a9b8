"""What a step must show before it is believed: its rows follow their law, and its energy account closes.

Both are recomputed from the state and from the constants of the system, not from what the step itself used, so that a
law that was lost on the way, or algebra that a system brings and that contradicts its rows, ends the run.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import GENERAL, accelerate, law_of, pushed, weigh
from crossbody.reference.core.algebra import ROUNDING, ULP, copy
from crossbody.reference.core.dop853 import OPEN
from crossbody.reference.core.friction import is_shared
from crossbody.reference.core.journal import blame
from crossbody.reference.core.layout import INCONSISTENT, NOT_FINITE, Buffers, Model, Work
from crossbody.reference.core.loops import bears_nothing
from crossbody.reference.core.unknowns import row_size
from crossbody.reference.kinds import Bytes

CLOSE = 1e-9  # part of the terms behind a row's multiplier: rounding stays far below, and asks no further
WRONG = 1e-6  # part of all terms of a row's law: more is no rounding, however ill-conditioned the rows are
SELDOM = 64  # steps between two looks at a system that brings its own algebra: they cost two right-hand sides


@compiled
def _residual(s: Any, m: Model, w: Work, mode: Bytes, j: int, stage: int) -> tuple[float, float]:
    """H v' + H'v + a1 h' + a0 h + a2 h^3 of the active row in place j, and what rounding of the state makes of it."""
    nq, i = s.nq, w.idx[j]
    a0, a1, a2 = law_of(m, mode, i)
    total, position, speed, largest = w.Hdv[j], 0.0, 0.0, 0.0
    for a in range(s.nq if s.has_velocity else 0):  # no column of a row belongs to one of them
        largest = max(largest, abs(w.y1[a]))
    for c in range(m.span[i, 0], m.span[i, 1]):
        total += w.H[j, c] * w.k[stage, nq + c]
        position = max(position, abs(w.H[j, c] * (largest if s.has_velocity else w.y1[c])))
        speed = max(speed, abs(w.H[j, c] * w.y1[nq + c]))
    h = w.ha[j]
    total += a1 * w.hda[j] + (a0 + a2 * h * h) * h
    return abs(total), ULP * (a0 * position + a1 * speed)


@compiled
def _heaviest(s: Any, m: Model, w: Work) -> float:
    """The largest multiplier, by the sizes of rows: elimination rounds all of them by a part of it, however small."""
    most = 0.0
    for j in range(s.na):
        most = max(most, abs(w.la[j]) * row_size(m, w, j))
    return most


@compiled
def follows_law(K: Any, s: Any, m: Model, w: Work, b: Buffers, stage: int) -> bool:
    """Whether the accelerations at the step's end, k[stage], are those of every active row's law.

    The rows stand in the workspace from the evaluation of that end. A row that does not follow is marked in the last
    line of the history, for the message.
    """
    if s.na == 0:
        return True
    if s.has_solve:
        if s.steps % SELDOM != 0:
            return True
        q, v = w.y1[: s.nq], w.y1[s.nq :]
        if accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t + s.hs, q, v, GENERAL) != 0:
            return True  # redundant for the general algebra: nothing to compare with
    open_by = 0.0
    for j in range(s.na if s.contradiction > 0.0 else 0):  # what rows that depend on each other leave of their laws
        open_by += s.contradiction * w.allowed[j]
    for j in range(s.na):
        if s.frictional and (is_shared(s, m, w, w.idx[j]) or bears_nothing(m, w, j)):
            continue  # or loops hold it, as its elimination has checked
        missing, rounding = _residual(s, m, w, b.mode, j, stage)
        if missing <= CLOSE * w.scale[j] + rounding + open_by:
            continue
        weigh(s, m, w, w.la)
        if s.frictional and missing <= ROUNDING * _heaviest(s, m, w) * row_size(m, w, j):
            continue
        if not missing <= WRONG * (w.scale[j] + pushed(m, w, j)) + 64.0 * rounding:
            blame(b, w.idx[j])
            return False
    return True


@compiled
def begin_account(K: Any, s: Any, m: Model, w: Work) -> None:
    """Note the energy of the start, and how much of it the absolute tolerance cannot tell."""
    nq = s.nq
    K.energy(w.y[:nq], w.y[nq:], m.p, w.e)
    s.energy_start = w.e[0] + w.e[1]
    copy(w.y[:nq], w.ys[:nq])
    w.ys[nq:] = 1.0
    K.energy(w.ys[:nq], w.ys[nq:], m.p, w.e)
    s.energy_unit = w.e[0]
    s.energy_size = 0.0


@compiled
def account(K: Any, s: Any, m: Model, w: Work) -> int:
    """Check E(t) - E(0) = input - dissipated + work of all rows, within what the steps taken may have added.

    0, NOT_FINITE or INCONSISTENT.

    A step may move every coordinate by its tolerance. That changes the kinetic energy by at most 2 sqrt(T T'), T' that
    of the tolerances as velocities, and the potential energy by about rtol of its size, but no less than what the loads
    that rows carry do over the tolerance of positions: a weight that hangs at height 0 has no energy at all. Nor may it
    be open by more than half of what is left beside that of the start: where that was far more for an instant it says
    nothing any more.
    """
    nq, nc = s.nq, s.nc
    K.energy(w.y[:nq], w.y[nq:], m.p, w.e)
    kinetic, potential = w.e[0], w.e[1]
    work, moved, load = 0.0, 0.0, 0.0
    for i in range(nc):
        work += w.z[i]
        moved += abs(w.z[i])
        load += abs(w.lam0[i])
    through, parts = abs(w.z[nc]) + abs(w.z[nc + 1]), OPEN * np.sqrt(nq + s.n)
    s.energy_size = max(s.energy_size, kinetic + abs(potential) + through + moved)
    small = 2.0 * s.atol * np.sqrt(kinetic * s.energy_unit) + s.atol**2 * s.energy_unit + s.atol * load
    s.energy_added += parts * (s.rtol * s.energy_size + small)
    left = 0.5 * (kinetic + abs(potential)) + abs(s.energy_start) + parts * (s.rtol * (through + abs(work)) + small)
    s.energy_allowed = min(s.energy_added, left)
    s.energy_open = kinetic + potential - s.energy_start - (w.z[nc] - w.z[nc + 1] + work)
    if not np.isfinite(s.energy_open):
        return NOT_FINITE
    return 0 if abs(s.energy_open) <= s.energy_allowed else INCONSISTENT
