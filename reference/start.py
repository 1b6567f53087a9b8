"""Whether a start stands on the rows that are always on, and the nearest one that does.

    h(q) = 0,   H(q) v = 0        for every row that is always on

A row of `follows` is on only with the row that it follows, and one whose law has a1 alone holds a
rate: it asks nothing of h. Off its rows a system moves as the law has it, h'' + a1 h' + a0 h + a2 h^3
= 0, under multipliers that no mechanism has: a motion of its own, and seldom the one that was meant.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Mode, SceneError
from crossbody.reference._state import State, started
from crossbody.reference._system import System
from crossbody.reference.kinds import Bytes, Floats, Index
from crossbody.reference.options import Options

EXPLAINED = 1e3  # times the tolerance of q and v, by which a start may be off
LARGEST = 1e-3  # part of q and v by which it may be off at the loosest tolerance
ROUNDING = 1e3 * float(np.finfo(float).eps)  # part of the terms of a gap and of its rate
ROUNDS = 50  # of Newton's method
NOT_FOUND = "No start on the rows that are always on was found from there."
DEPENDENT = 1e-12  # singular value of the rows, over the largest, that counts as zero


class OffRowsError(SceneError):
    """A start off a row that is always on.

    Attributes:
        row: which.
        off: what its gap and its rate are.
        near: positions (nq,) and velocities (n,) of the nearest start on all such rows; None if
            none was found.
    """

    def __init__(self, run: str, row: int, off: str, near: tuple[Floats, Floats] | None) -> None:
        self.row, self.off, self.near = row, off, near
        offered = NOT_FOUND
        if near is not None:
            q0, v0 = (part.tolist() for part in near)
            offered = f"The nearest on all such rows is q0 = {q0}, v0 = {v0} (System.project)."
        super().__init__(
            f"The start{run} is off row {row}, which is always on: {off}. {offered} "
            "consistent=False allows a start that violates its rows on purpose."
        )


def check_start(
    system: System, q: Floats, v: Floats, options: Options, *, parameters: Floats | None = None, run: str = ""
) -> None:
    """Check that a start stands on the rows that are always on, unless it may stand off them.

    Args:
        system: the mechanism.
        q: positions (nq,).
        v: velocities (n,).
        options: its tolerances say what counts as off; `consistent=False` admits any start.
        parameters: those of this run; the system's own if not given.
        run: which of many runs it is, for a message.

    Raises:
        OffRowsError: naming the row, its gap and rate, and the nearest start on all such rows.
    """
    if not options.consistent or not np.any(_may_hold(system)):
        return
    p, modes = started(system, q, v, parameters)
    state, held = State(system, 0.0, q, v, p), _held(system, modes)
    part = min(EXPLAINED * options.rtol, LARGEST)
    off = _off(state, held, part, min(EXPLAINED * options.tolerance, LARGEST))
    if np.any(off):
        i = int(held[np.argmax(off)])
        rate = f"h = {state.h[i]:.6g} and h' = {state.H[i] @ v:.6g}, more than rtol = {options.rtol:g} explains"
        raise OffRowsError(run, i, rate, _projected(state, held))


def check_starts(system: System, starts: Floats, parameters: Floats, options: Options) -> None:
    """Check the starts (N, nq + n) of many runs, each with its line of parameters, as `check_start` does."""
    may_hold, nq = _may_hold(system), system.nq
    if not options.consistent or not np.any(may_hold):
        return
    h, rate = np.zeros(system.nc), np.zeros(system.nc)
    for r, (start, p) in enumerate(zip(starts, parameters, strict=True)):
        system.gaps(0.0, start[:nq], start[nq:], p, h, rate)
        if max(np.abs(h[may_hold]).max(), np.abs(rate[may_hold]).max()) > ROUNDING:  # most starts hold: look no further
            check_start(system, start[:nq], start[nq:], options, parameters=p, run=f" of run {r}")


def project(system: System, q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Put a state onto the rows that are always on, as `System.project` says."""
    p, modes = started(system, q, v)
    found = _projected(State(system, 0.0, q, v, p), _held(system, modes))
    if found is None:
        raise SceneError(f"No state on the rows that are always on is found from q = {q.tolist()}, v = {v.tolist()}.")
    return found


def _may_hold(system: System) -> NDArray[np.bool_]:
    """Which rows are always on, unless `switch` says otherwise."""
    may_hold: NDArray[np.bool_] = (np.asarray(system.unilateral) == 0) & (np.asarray(system.follows) < 0)
    return may_hold


def _held(system: System, modes: Bytes) -> Index:
    on = modes == Mode.BILATERAL
    on[np.asarray(system.redundant)] = True  # held by the others, if they are held at the start
    return np.flatnonzero(_may_hold(system) & on)


def _placed(system: System, held: Index) -> NDArray[np.bool_]:
    """Which of these rows hold a position, not a rate alone."""
    a0, a1, a2 = system.alpha[held].T
    placed: NDArray[np.bool_] = (a0 > 0.0) | (a2 > 0.0) | (a1 == 0.0)
    return placed


def _off(state: State, held: Index, part: float, absolute: float) -> NDArray[np.bool_]:
    """Which rows are off by more than this part of every coordinate's size, and this beside it, explain.

    An error of q turns the rows: along v they turn by H' v. One that says what a joint does
    already is made of terms that cancel: of H nothing is left that would tell their rounding.
    """
    H, q, v = np.abs(state.H[held]), state.sizes(), np.abs(state.v)
    terms = ROUNDING * (1.0 + q.max())
    here = np.abs(state.h[held]) > H @ (part * q + absolute + ROUNDING * (1.0 + q)) + terms
    turned = np.abs(state.Hdv[held]) * (part * q.max() + absolute) / max(float(v.max()), np.finfo(float).tiny)
    moving = np.abs(state.H[held] @ state.v) > H @ (part * v + absolute + ROUNDING * v) + turned + terms * v.max()
    off: NDArray[np.bool_] = (here & _placed(state.system, held)) | moving
    return off


def _projected(state: State, held: Index) -> tuple[Floats, Floats] | None:
    """The nearest state on the rows in the metric of M; None if none is found."""
    system, v, p = state.system, state.v, state.p
    placed = held[_placed(system, held)]
    try:
        for _ in range(ROUNDS):
            step = _least(state, placed, state.h[placed])
            size = state.sizes()
            state = State(system, 0.0, state.q - system.displacement(state.q, step, p), v, p)
            if np.all(np.abs(step) <= ROUNDING * (1.0 + size)):
                break
        state = State(system, 0.0, state.q, v - _least(state, held, state.H[held] @ v), p)
    except np.linalg.LinAlgError:  # no metric: M is singular on the way, or something is not finite
        return None
    good = state.finite() and not np.any(_off(state, held, ROUNDING, ROUNDING))
    return (system.normalised("project", state.q), state.v) if good else None


def _least(state: State, rows: Index, error: Floats) -> Floats:
    """Return x with H x = error of least x^T M x, M^-1 H^T (H M^-1 H^T)^-1 error; rows may depend on each other."""
    root = np.linalg.cholesky(state.mass_matrix())
    scaled = np.linalg.solve(root, state.H[rows].T).T
    return np.linalg.solve(root.T, np.linalg.lstsq(scaled, error, rcond=DEPENDENT)[0])
