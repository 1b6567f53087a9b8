"""How long steps of semi-implicit Euler may be about an equilibrium, and what limits them.

Of a linear model the step, which is MuJoCo's `Euler`, takes velocities first, damping of joints implicitly:

    v+ = v + h (1 + h M^-1 D)^-1 v'(q, v)      q+ = q + h q'(q, v+)

It is stable as long as no eigenvalue leaves the unit circle but those of modes that grow by themselves.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.scene import WIDTHS
from crossbody.reference.linear import LinearModel, modes
from crossbody.reports.analysis.loci import AT_REST
from crossbody.reports.analysis.places import Place

LEAVES = 1e-5  # by which an eigenvalue is outside: two at 1 are scattered by the root of rounding
STEPS = np.geomspace(1e-3, 1e4, 561)  # that are tried, times the time of the fastest mode
PAST = 1.05  # times the largest step, where one looks which mode it is


def largest_step(place: Place) -> tuple[float, str]:
    """Return the largest stable step at an equilibrium, s, and the state that leads the mode which limits it.

    Infinite, and no state, where none does; 0 where it is stable at no step.
    """
    model = place.linearised(reduce=place.held)
    moves = [k for k, state in enumerate(model.states) if state.endswith("'")]
    drag = _drag(place, model, moves)
    poles = model.poles()
    fastest = float(np.abs(poles).max(initial=0.0))
    growing = int(np.sum(poles.real > AT_REST * fastest))
    if fastest == 0.0:
        return np.inf, ""

    def outside(h: float) -> bool:
        found = np.abs(np.linalg.eigvals(transition(model.A, moves, drag, h)))
        return int(np.sum(found > 1.0 + LEAVES)) > growing

    high = next((h for h in STEPS / fastest if outside(h)), np.inf)
    if high == np.inf:
        return np.inf, ""
    low = 0.0 if high == STEPS[0] / fastest else high * STEPS[0] / STEPS[1]
    for _ in range(60 if low else 0):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if outside(middle) else (middle, high)
    found = modes(replace(model, A=transition(model.A, moves, drag, PAST * high)))
    first = int(np.argmax(np.abs(found.poles)))
    return low, found.states[int(np.argmax(found.participation[:, first]))]


def transition(A: Floats, moves: list[int], drag: Floats, h: float) -> Floats:
    """Return the matrix of one step of h s, of a model whose velocities are these states; drag is M^-1 D of them."""
    step = np.eye(len(A))
    rest = [k for k in range(len(A)) if k not in moves]
    step[moves] += h * np.linalg.solve(np.eye(len(moves)) + h * drag, A[moves])
    after = step.copy()
    after[rest] += h * A[rest] @ step
    return after


def _drag(place: Place, model: LinearModel, moves: list[int]) -> Floats:
    """Return M^-1 D of the velocities that a model keeps, D of the joints' dampers."""
    case, n = place.case, place.system.n
    if case.scene is None:
        return np.zeros((len(moves), len(moves)))
    D = np.diag(list(_dampers(place)))
    M = place.system.equations_along([place.t], place.trim.q[None], place.trim.v[None])[0][0]
    B = model.C[len(model.C) - n :][:, moves]
    return np.asarray(np.linalg.solve(B.T @ M @ B, B.T @ D @ B))


def _dampers(place: Place) -> Iterator[float]:
    """Yield the damping of every velocity of a scene."""
    for joint in place.case.scene.joints if place.case.scene is not None else ():
        yield from [joint.damping[0]] * WIDTHS[joint.type][1]
