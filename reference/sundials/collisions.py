"""Frozen collisions of rows with fast constants, in plain Python: the check on the compiled ones.

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
from crossbody.cases.closed_forms import damping_ratio, restitution, threshold_speed
from crossbody.reference.kinds import Floats
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
    return _jump(e, t, q, v, now, [*now.held, n], [n])


def simultaneous(e: Equations, t: float, q: Floats, v: Floats, now: Touching) -> Jump:
    """All touching rows that do not separate collide together, each with its own restitution."""
    return _jump(e, t, q, v, now, [*now.held, *now.approaching, *now.still], [*now.approaching, *now.still])


RULES = {"sequential": sequential, "simultaneous": simultaneous}


def _restitution(e: Equations, i: int) -> float:
    return restitution(damping_ratio(e.fast[i, 0], e.fast[i, 1]))


def _captured(e: Equations, t: float, q: Floats, v: Floats, now: Touching, i: int, held: set[int]) -> bool:
    """Whether row i is slower than v* = press / (w e^(3/2)); press = -h_i'' with the held rows alone."""
    leaders = np.where(np.asarray(e.system.follows) < 0, np.arange(e.system.nc), e.system.follows).tolist()
    e.activate([mode if leader in held else Mode.FREE for leader, mode in zip(leaders, now.modes, strict=True)])
    press = -e.row_acceleration(t, q, v, i)
    return bool(-now.rate[i] < threshold_speed(e.fast[i, 0], e.fast[i, 1], press))


def _changes(
    e: Equations, t: float, q: Floats, v: Floats, now: Touching, rows: list[int], struck: list[int], kept: set[int]
) -> tuple[Floats, set[int]]:
    """Changes of the rates of `rows` while `kept` of them push, and which of the struck ones are captured."""
    held = kept.difference(struck)
    bouncing = [i for i in struck if i in now.approaching and i in kept]
    captured = {i for i in bouncing if _captured(e, t, q, v, now, i, held)}
    change = np.zeros(len(rows))
    for j, i in enumerate(rows):
        if i in struck:
            change[j] = -(1.0 + (_restitution(e, i) if i in bouncing and i not in captured else 0.0)) * now.rate[i]
    return change, captured


def _jump(e: Equations, t: float, q: Floats, v: Floats, now: Touching, rows: list[int], struck: list[int]) -> Jump:
    """The jump when these rows are struck. The most pulling row leaves first, until all push.

    What presses on a struck row, and so whether it is captured, is asked for again whenever a held row has left. A row
    that follows another may pull, and leaves with it.

    Raises:
        Ended: ILL_POSED if these rows are dependent.
    """
    H, X = e.mobility(t, q, v, rows)
    G, kept, P = H @ X, list(range(len(rows))), np.zeros(len(rows))
    follows = np.asarray(e.system.follows)[rows]
    may_pull = ~np.asarray(e.system.unilateral, dtype=bool)[rows] | (follows >= 0)
    while True:
        change, captured = _changes(e, t, q, v, now, rows, struck, {rows[j] for j in kept})
        P[:] = 0.0
        P[kept] = np.linalg.solve(G[np.ix_(kept, kept)], change[kept])
        least = NONE * np.abs(P).max()
        pulling = [j for j in kept if not may_pull[j] and P[j] < -least]
        if not pulling:
            break
        worst = min(pulling, key=lambda j: float(P[j]))
        kept = [j for j in kept if j != worst and follows[j] != rows[worst]]
    after = v + X @ P
    work = np.zeros(e.system.nc)
    work[rows] = 0.5 * P * (H @ (v + after))
    pushing = {rows[j]: float(P[j]) for j in kept if P[j] > least}
    impulses = {i: x for i, x in pushing.items() if i in struck and i in now.approaching}
    left = {*rows} - {rows[j] for j in kept}
    return Jump(after, impulses, captured & {*impulses}, [i for i in now.held if i in left], work)
