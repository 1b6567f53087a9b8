"""Frozen collisions of rows with fast constants (spec 1.2), in plain Python: the check on the compiled ones.

The fast system, M and H frozen and a0, a1 those of COLLISION, is linear. From h = 0 until lam = 0 its solution is

    v+ = v + M^-1 H_A^T P      (H_A M^-1 H_A^T) P = change of the gaps' rates

    sequential      A = held rows and the most approaching one, n;  change = (1 + e) |h_n'| of n, none of the others
    simultaneous    A = held rows and all that touch and do not part;  h_i' becomes -e_i h_i', or 0 if it stood still

e = exp(-2 zeta Th), or 0 for a row below the speed from which its contact lets go again (capture). A row whose impulse
would pull leaves A, the most pulling one first. The work of P_i is P_i (h_i' before + h_i' after)/2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from crossbody.cases import Mode
from crossbody.cases._closed_forms import damping_ratio, restitution, threshold_speed
from crossbody.reference._kinds import Floats
from crossbody.reference.sundials.equations import Equations

NONE = 1e-12  # part of the largest impulse below which there is none
TIE = 1e-12  # part of the scene's largest speed within which two rows approach alike


@dataclass(slots=True)
class Touching:
    """The rows at one instant.

    Attributes:
        held: rows that press, and bilateral ones.
        approaching: touching rows whose gap closes.
        still: touching rows whose gap stands still.
        rate (nc,): h' of every row, m/s.
        modes: of every row.
        fastest: the scene's largest speed, m/s.
    """

    held: list[int]
    approaching: list[int]
    still: list[int]
    rate: Floats
    modes: Sequence[Mode]
    fastest: float


@dataclass(slots=True)
class Jump:
    """What a collision does.

    Attributes:
        v (n,): velocities behind it.
        impulses: of the rows that collide, those that approached, N s.
        captured: those that stay in contact.
        dropped: held rows that would have pulled, in the order in which they left.
        work (nc,): done by every row's impulse, J.
    """

    v: Floats
    impulses: dict[int, float]
    captured: set[int]
    dropped: list[int]
    work: Floats


def sequential(e: Equations, t: float, q: Floats, v: Floats, now: Touching) -> Jump:
    """One row collides, the most approaching one; ties go to the lowest index."""
    fastest = min(now.rate[i] for i in now.approaching)
    n = next(i for i in now.approaching if now.rate[i] <= fastest + TIE * now.fastest)
    rows = [*now.held, n]
    unit = np.array([float(i == n) for i in rows])
    kept, _ = _pushing(e, t, q, v, rows, unit)  # signs do not depend on e
    captured = {n} if _captured(e, t, q, v, now, n, {*kept}) else set()
    bounce = 0.0 if captured else _restitution(e, n)
    return _jump(e, t, q, v, now, rows, -(1.0 + bounce) * now.rate[n] * unit, captured)


def simultaneous(e: Equations, t: float, q: Floats, v: Floats, now: Touching) -> Jump:
    """All touching rows that do not separate collide together, each with its own restitution."""
    captured = {i for i in now.approaching if _captured(e, t, q, v, now, i, {*now.held})}
    rows = [*now.held, *now.approaching, *now.still]
    change = np.zeros(len(rows))
    for j, i in enumerate(rows[len(now.held) :], start=len(now.held)):
        bounces = i in now.approaching and i not in captured
        change[j] = -(1.0 + (_restitution(e, i) if bounces else 0.0)) * now.rate[i]
    return _jump(e, t, q, v, now, rows, change, captured)


RULES = {"sequential": sequential, "simultaneous": simultaneous}


def _restitution(e: Equations, i: int) -> float:
    return restitution(damping_ratio(e.fast[i, 0], e.fast[i, 1]))


def _captured(e: Equations, t: float, q: Floats, v: Floats, now: Touching, i: int, held: set[int]) -> bool:
    """Whether row i is slower than v* = press / (w e^(3/2)); press = -h_i'' with the held rows alone."""
    leaders = np.where(np.asarray(e.system.follows) < 0, np.arange(e.system.nc), e.system.follows).tolist()
    e.activate([mode if leader in held else Mode.FREE for leader, mode in zip(leaders, now.modes, strict=True)])
    press = -e.row_acceleration(t, q, v, i)
    return bool(-now.rate[i] < threshold_speed(e.fast[i, 0], e.fast[i, 1], press))


def _pushing(e: Equations, t: float, q: Floats, v: Floats, rows: list[int], change: Floats) -> tuple[list[int], Floats]:
    """The rows that push when their rates change so, and the impulses (len(rows),), 0 for every other.

    A row that follows another may pull, and leaves with it.

    Raises:
        Ended: ILL_POSED if these rows are dependent.
    """
    H, X = e.mobility(t, q, v, rows)
    G, kept, P = H @ X, list(range(len(rows))), np.zeros(len(rows))
    follows = np.asarray(e.system.follows)[rows]
    may_pull = ~np.asarray(e.system.unilateral, dtype=bool)[rows] | (follows >= 0)
    while True:
        P[:] = 0.0
        P[kept] = np.linalg.solve(G[np.ix_(kept, kept)], change[kept])
        pulling = [j for j in kept if not may_pull[j] and P[j] < -NONE * np.abs(P).max()]
        if not pulling:
            return [rows[j] for j in kept], P
        worst = min(pulling, key=lambda j: float(P[j]))
        kept = [j for j in kept if j != worst and follows[j] != rows[worst]]


def _jump(
    e: Equations, t: float, q: Floats, v: Floats, now: Touching, rows: list[int], change: Floats, captured: set[int]
) -> Jump:
    kept, P = _pushing(e, t, q, v, rows, change)
    H, X = e.mobility(t, q, v, rows)
    after = v + X @ P
    work = np.zeros(e.system.nc)
    work[rows] = 0.5 * P * (H @ (v + after))
    least = NONE * np.abs(P).max()
    collide = {i: float(x) for i, x in zip(rows, P, strict=True) if i in now.approaching and i in kept and x > least}
    return Jump(after, collide, captured & {*collide}, [i for i in now.held if i not in kept], work)
