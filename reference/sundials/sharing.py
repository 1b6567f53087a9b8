"""Which rows in contact carry a load where some depend on each other, by least distances: the check on `core.holding`.

Gauss's principle: v' is the nearest to the acceleration of free bodies, in the metric of M, at which every gap in
contact opens at least as its law has it. Then the multipliers are the nearest to zero, none below it, that exert the
same forces. Both are least distances under inequalities (Lawson and Hanson, Solving Least Squares Problems, 1974,
ch. 23).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Outcome
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.equations import ROUNDING, ULP, Ended, Equations

Flags = NDArray[np.bool_]
RANK = 1e-5  # singular value of the rows, scaled to length one, over the largest, that counts as zero
NOTHING = 1e-9  # part of the largest multiplier below which a row carries nothing
PULL = 1e-12  # part of the largest multiplier below which one that is negative is rounding
CONSISTENT = 1e-9  # part of its terms by which a row may be off its law
PARTED = 4.0  # times that: what is decided at an instant is decided anew
STATE = 64.0 * ULP


@dataclass(frozen=True, slots=True)
class Sharing:
    """How the rows in contact hold each other.

    Attributes:
        basis: independent rows that hold all others.
        beside: rows that depend on the basis and bear a share of its load.
        lifted: rows that have to let go instead; the rest is not known then.
    """

    basis: list[int]
    beside: list[int]
    lifted: list[int]


def least_distance(G: Floats, h: Floats) -> tuple[Floats, Floats] | None:
    """Return the smallest x with G x >= h and the multipliers of its rows; None if there is no such x."""
    from scipy.optimize import nnls  # which takes longer to import than most runs

    size = float(np.abs(h).max(initial=0.0)) or 1.0
    E = np.vstack([G.T, h / size])
    target = np.zeros(len(E))
    target[-1] = 1.0
    found, off = nnls(E, target, maxiter=50 * (len(h) + 1))
    if off <= 1e-12:
        return None
    rest = E @ found - target
    return -rest[:-1] / rest[-1] * size, -found / rest[-1] * size


def _pivoted(A: Floats, mode: Literal["r", "economic"]) -> Any:
    """Return a QR decomposition with pivoting; its import takes .2 s, which rows that share no load do without."""
    from scipy.linalg import qr

    return qr(A, mode=mode, pivoting=True)


def rank(A: Floats) -> int:
    """Rank of rows of length one."""
    if not len(A):
        return 0
    values = np.linalg.svd(A, compute_uv=False)
    return int((values > RANK * values[0]).sum())


class _Rows:
    """The rows of one instant in the metric of M, each scaled to length one.

    Attributes:
        root (n, n): L, M = L L^T.
        A (m, n): H L^-T.
        least (m,): what A y must be at least, y = L^T v'.
        allowed (m,): by how much it may be off.
        free (n,): y of free bodies.
        length (m,): by which each row was divided.
    """

    def __init__(self, e: Equations, t: float, q: Floats, v: Floats, rows: list[int]) -> None:
        with e._selected(rows):
            M, f = (x.copy() for x in e.terms(t, q, v))
            H, h, Hdv = (x.copy() for x in e.rows(t, q, v))
        self.root = root = np.linalg.cholesky(M)
        a0, a1, a2 = e.law[rows].T
        rate, spring = H @ v, (a0 + a2 * h * h) * h
        self.A, self.free = np.linalg.solve(root, H.T).T, np.linalg.solve(root, f)
        self.length = np.linalg.norm(self.A, axis=1)
        if not (np.isfinite(self.A).all() and (self.length > 0.0).all()):
            raise Ended(Outcome.ILL_POSED, rows)
        self.A /= self.length[:, None]
        self.least = -(Hdv + a1 * rate + spring) / self.length
        terms = np.abs(Hdv) + a1 * np.abs(rate) + np.abs(spring) + np.abs(H) @ np.abs(np.linalg.solve(M, f))
        state = STATE * (a0 * np.abs(q).max() + a1 * np.abs(v).max())
        self.allowed = (CONSISTENT * terms + state) / self.length


def parted(e: Equations, t: float, q: Floats, v: Floats, rows: list[int], vd: Floats) -> bool:
    """Whether v' (n,) has rows off their laws by clearly more than they may be where some depend on others."""
    at = _Rows(e, t, q, v, rows)
    y = at.root.T @ vd
    rounding = ROUNDING * (np.linalg.norm(at.free) + np.linalg.norm(y - at.free))
    return bool((np.abs(at.A @ y - at.least) > PARTED * (at.allowed + rounding)).any())


def share(
    e: Equations, t: float, q: Floats, v: Floats, rows: Sequence[int], bilateral: Sequence[int], spent: Collection[int]
) -> Sharing | None:
    """Return how rows in contact hold each other; None if none depends on others.

    Args:
        e: the equations.
        t: instant, s.
        q: positions (nq,).
        v: velocities (n,).
        rows: one-sided rows in contact.
        bilateral: rows that are always on.
        spent: of the first, those whose multipliers have just vanished: others carry for them if they can.

    Raises:
        Ended: ILL_POSED if the rows contradict each other.
    """
    every = sorted([*rows, *bilateral])
    at = _Rows(e, t, q, v, every)
    span = rank(at.A)
    if span == len(every):
        return None
    one_sided = np.array([i not in bilateral for i in every], dtype=bool)
    y = _nearest(at, one_sided, every)
    excess = at.A @ y - at.least
    rounding = ROUNDING * (np.linalg.norm(at.free) + np.linalg.norm(y - at.free))
    lifted = [every[k] for k in np.flatnonzero(one_sided & (excess > at.allowed + rounding))]
    if lifted:
        return Sharing([], [], lifted)
    carrying = _carrying(at, y, one_sided, every, spent, span)
    if carrying is None:
        return Sharing([], [], [i for i in every if i in spent])
    pulling = _pulling(at, y, one_sided, carrying)
    if pulling:  # the least multipliers would pull, others that exert the same forces need not
        carrying = _pushing(at, y, one_sided, np.array([i in spent for i in every])) or carrying
        pulling = [k for k in carrying if every[k] in spent] or _pulling(at, y, one_sided, carrying)
    if pulling:  # a row that nothing presses, and that the others need to be held
        return Sharing([], [], [every[k] for k in pulling])
    order = _pivoted(at.A[carrying].T, "r")[-1][:span]
    basis = sorted(carrying[k] for k in order)
    return Sharing([every[k] for k in basis], [every[k] for k in carrying if k not in basis], [])


def _nearest(at: _Rows, one_sided: Flags, every: list[int]) -> Floats:
    """Return y = L^T v' by Gauss's principle."""
    fixed = at.A[~one_sided]
    start: Floats = at.free + np.linalg.pinv(fixed) @ (at.least[~one_sided] - fixed @ at.free)
    keep = np.eye(len(start)) - np.linalg.pinv(fixed) @ fixed
    G, h = at.A[one_sided] @ keep, at.least[one_sided] - at.A[one_sided] @ start
    if not (h > 0.0).any():
        return start
    found = least_distance(G, h)
    if found is None:
        raise Ended(Outcome.ILL_POSED, every)
    tight = found[1] > NOTHING * found[1].max()
    step: Floats = np.linalg.lstsq(G[tight], h[tight], rcond=RANK)[0]  # to rounding, where nnls is to a tolerance
    return start + step


def _carrying(
    at: _Rows, y: Floats, one_sided: Flags, every: list[int], spent: Collection[int], span: int
) -> list[int] | None:
    """Return places of the rows that carry; None if a spent one that none can replace has to let go."""
    force = y - at.free
    count = len(every)
    basis = _pivoted(at.A.T, "economic")[0][:, :span]
    B = basis.T @ (at.A * at.length[:, None]).T
    want = basis.T @ force
    size = float(np.abs(want).max()) or 1.0
    bounds = np.eye(count)[one_sided]
    want /= size
    found = least_distance(np.vstack([bounds, B, -B]), np.concatenate([np.zeros(len(bounds)), want, -want]))
    lam = np.linalg.lstsq(B, want, rcond=RANK)[0] if found is None else found[0]
    heavy = (lam > NOTHING * np.abs(lam).max()) | ~one_sided
    heavy &= ~np.array([i in spent for i in every])
    carrying = _completed(at, heavy, np.array([i in spent for i in every]))
    return None if any(every[k] in spent for k in carrying) else carrying


def _completed(at: _Rows, heavy: Flags, spent: Flags) -> list[int]:
    """Return places of these rows and of others that hold what they leave free, spent ones last."""
    carrying = np.flatnonzero(heavy).tolist()
    for k in np.argsort(spent, kind="stable").tolist():
        if k not in carrying and rank(at.A[[*carrying, k]]) > rank(at.A[carrying]):
            carrying.append(k)
    return sorted(carrying)


def _pulling(at: _Rows, y: Floats, one_sided: Flags, carrying: list[int]) -> list[int]:
    """Return places of the rows whose multipliers, the least of those that carry, pull."""
    raw = at.A[carrying] * at.length[carrying, None]
    lam = np.linalg.lstsq(raw.T, y - at.free, rcond=RANK)[0]
    return [k for k, x in zip(carrying, lam, strict=True) if one_sided[k] and x < -PULL * np.abs(lam).max()]


def _pushing(at: _Rows, y: Floats, one_sided: Flags, spent: Flags) -> list[int]:
    """Return places of few rows that exert the forces without any of them pulling; none if there are none."""
    from scipy.optimize import nnls

    force, raw = y - at.free, at.A * at.length[:, None]
    lam, off = nnls(np.vstack([raw, -raw[~one_sided]]).T, force)
    if off > NOTHING * float(np.abs(force).max()):
        return []
    return _completed(at, (lam[: len(raw)] > NOTHING * lam.max()) | ~one_sided, spent)
