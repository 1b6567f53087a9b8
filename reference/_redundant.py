"""Rows that follow from others: which they are at a start, and whether they still follow at the end of a motion.

A planar loop that is closed by points in space has rows that depend on each other. Which of them
are left out is decided once, at an assembled start, and stays so: off the rows the rank is full
of noise. What was left out is watched.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from crossbody.cases import Mode, Outcome, SceneError, Trajectory
from crossbody.reference._state import State, started
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats, Index

INDEPENDENT = 1e-4  # pivot over the first from which on a row does not follow from the others
ROUNDED = 1e-8  # below which it does, as far as rounding tells
NOTHING = 1e-12  # m by m or rad: what no velocity moves a loop by more than is rounding
BRANCHES = 1e-6  # of what rows bend by, by which one that others hold all along may bend otherwise: by rounding
LOOSE = 100.0  # times the part of it that does not follow: by so much more
OPEN, ROUNDING = 100.0, 1e-6  # times the gap of the rows that hold, and at least, m: more is not held any longer


@dataclass(frozen=True, slots=True, kw_only=True)
class Rank:
    """How far rows hold by themselves at an assembled state.

    Attributes:
        order: the rows as they are taken, each that which adds most to those before it.
        pivots: what each adds, over what the first does.
    """

    order: Sequence[int]
    pivots: Sequence[float]

    def count(self, least: float) -> int:
        """Return how many rows add at least so much."""
        return sum(pivot >= least for pivot in self.pivots)

    def held(self, asked: int) -> int:
        """Return how many rows hold: as many as are asked for, or below 0 those that surely do.

        Raises:
            SceneError: if more or fewer are asked for than rounding leaves open.
        """
        sure, most = self.count(INDEPENDENT), self.count(ROUNDED)
        if asked < 0:
            return sure
        if not sure <= asked <= most:
            valid = f"{sure}" if sure == most else f"from {sure} to {most}"
            raise SceneError(f"rank is {asked}; valid: {valid}, of {len(self.order)} rows of loops.")
        return asked

    def finding(self, count: int, names: Sequence[str]) -> str:
        """Return a sentence on the rows that neither hold surely nor follow, of which `count` in all hold; or none."""
        sure, most = self.count(INDEPENDENT), self.count(ROUNDED)
        if sure == most:
            return ""
        near = ", ".join(f"{names[self.order[i]]!r} ({self.pivots[i]:.1e})" for i in range(sure, most))
        done = f"{count} of {len(self.order)} rows hold"
        return (
            f"near_dependent: a pivot between {ROUNDED:g} and {INDEPENDENT:g} of the first has "
            f"{near}. Left out, such rows follow from the others and the mechanism moves; "
            f"kept, each takes a degree of freedom, and it may lock. Here {done}; rank "
            f"(--rank) decides: from {sure}, none of them, to {most}, all of them."
        )


def ranked(system: System, q: Floats, groups: Sequence[Sequence[int]]) -> Rank:
    """Return how far rows hold by themselves at an assembled state, by pivots of H M^-1/2.

    Args:
        system: the mechanism.
        q: positions (nq,).
        groups: rows that are scaled by one length, the largest of them: one a loop. Each by its
            own would lift a row that is nothing but rounding to the size of the others.

    Raises:
        SceneError: for a mass matrix that is not positive definite.
    """
    rows = [i for group in groups for i in group]
    p, _ = started(system, np.array(q), np.zeros(system.n))
    state = State(system, 0.0, system.checked_state("q", q), np.zeros(system.n), p)
    M = state.mass_matrix()
    least, ways = np.linalg.eigh(M)
    if not least[0] > 0.0:
        raise SceneError(
            "The mass matrix is not positive definite at the start: its least eigenvalue is "
            f"{least[0]:.3g}, and what moves there without a mass is above all velocity "
            f"{int(np.abs(ways[:, 0]).argmax())}, counted from 0."
        )
    root = np.linalg.cholesky(M)
    H = state.H[rows]
    scaled = np.linalg.solve(root, H.T).T
    at = 0
    for group in groups:
        part = scaled[at : at + len(group)]
        if np.abs(H[at : at + len(group)]).max(initial=0.0) > NOTHING:
            part /= np.linalg.norm(part, axis=1).max()
        else:  # the loop says what a joint does already
            part[:] = 0.0
        at += len(group)
    from scipy.linalg import qr  # .2 s of imports that no other scene needs

    triangle, order = qr(scaled.T, mode="r", pivoting=True)[-2:]
    count = min(triangle.shape)
    pivots = np.zeros(len(rows))
    pivots[:count] = np.abs(np.diag(triangle)[:count]) / (abs(triangle[0, 0]) or 1.0)
    return Rank(order=[rows[i] for i in order], pivots=pivots.tolist())


def branching(
    system: System, q: Floats, held: Sequence[int], out: Sequence[int], loose: Sequence[float]
) -> list[int]:  # fmt: skip
    """Return rows that follow from others at an assembled state and hold by themselves beside it: motions branch there.

    A row that is left out bends as those that hold it do, H' v along every v with H v = 0, where they hold it all along
    a motion. Between links that are aligned, at a dead centre, it does not.

    Args:
        system: the mechanism.
        q: positions (nq,).
        held: rows that hold there, independent of each other.
        out: rows that follow from them.
        loose: the part of each of these that does not.
    """
    q, (p, _) = np.array(q), started(system, np.array(q), np.zeros(system.n))
    H = State(system, 0.0, q, np.zeros(system.n), p).H
    free = np.linalg.svd(H[held])[2][len(held) :] if held else np.eye(system.n)
    pairs = [(one, other) for k, one in enumerate(free) for other in free[: k + 1]]
    bends = [State(system, 0.0, q, a + b, p).Hdv - State(system, 0.0, q, a - b, p).Hdv for a, b in pairs]
    if not out or not bends:
        return []
    follows, turns = np.linalg.lstsq(H[held].T, H[out].T)[0], np.array(bends)
    off = np.abs(turns[:, out] - turns[:, held] @ follows).max(axis=0)
    allowed = (BRANCHES + LOOSE * np.asarray(loose)) * np.abs(turns).max()
    return [i for i, apart in zip(out, off > allowed, strict=True) if apart]


def dead_centre(
    system: System, q: Floats, held: Sequence[int], out: Mapping[int, float], names: Sequence[str]
) -> str:  # fmt: skip
    """Return a sentence on the rows, by `names` of all, at which motions branch (`branching`); or none."""
    if not (found := branching(system, q, held, list(out), list(out.values()))):
        return ""
    beside = ", ".join(repr(names[i]) for i in found)
    return (
        f"dead_centre: at the start the rows of loops have lost rank, as where links are aligned: {len(held)} of "
        f"{len(held) + len(out)} hold, and beside it {beside} too. Which way the mechanism goes from there its "
        "equations leave open; another start (--start) is none."
    )


def watched(system: System, run: Trajectory) -> Trajectory:
    """Return the run, or one that is inconsistent where a row that was left out is not held by the others.

    The multipliers of what was left out are NaN: with those of the rows that they follow from
    they are one of many. Its mode is that of rows that are always on: the others hold it.
    """
    left_out: Index = np.asarray(system.redundant)
    if not len(left_out) or not len(run.t):
        return replace(run, message=_told(system, run)) if system.findings else run
    p, h, rates = np.array(system.p), np.zeros(system.nc), np.zeros((len(run.t), system.nc))
    for q, v, rate in zip(np.array(run.q), np.array(run.v), rates, strict=True):
        system.gaps(0.0, q, v, p, h, rate)
    for values, what in ((run.gap, "h"), (rates, "h'")):
        most = np.abs(values[:, system.held]).max(initial=0.0)
        off = np.abs(values[:, left_out])
        size = 1.0 if what == "h" else max(1.0, float(np.abs(run.v).max()))
        bound = np.maximum(OPEN * most, (ROUNDING + OPEN * np.asarray(system.loose)) * size)
        if np.any(off > bound):
            k, j = np.argwhere(off > bound)[0]
            row = int(left_out[j])
            held, loose = np.flatnonzero(system.held).tolist(), np.asarray(system.loose).tolist()
            branches = branching(system, run.q[0], held, left_out.tolist(), loose)
            ended = Outcome.ILL_POSED if branches else Outcome.INCONSISTENT
            message = (
                f"Row {row} followed from the others at the start and was left out; at t = {run.t[k]:.12g} s "
                f"it has {what} = {values[k, row]:.3g}. {ended.advice}"
            )
            return replace(run, outcome=ended, message=" ".join((*system.findings, message)))
    lam, mode = np.array(run.lam), np.array(run.mode)
    lam[:, left_out], mode[:, left_out] = np.nan, Mode.BILATERAL
    count = len(left_out) + run.counts.get("redundant", 0)
    return replace(run, lam=lam, mode=mode, counts={**run.counts, "redundant": count}, message=_told(system, run))


def _told(system: System, run: Trajectory) -> str:
    """Return the message of a run, with what was found about its system."""
    return " ".join(filter(None, (run.message, *system.findings)))
