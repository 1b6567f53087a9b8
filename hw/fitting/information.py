"""What the data see of the parameters: the spectrum of the scaled information matrix, and what it leaves open.

With J scaled by the size of every unknown, J^T J is the information about relative changes. Its eigenvectors of no size
are combinations of parameters that no residual sees; those of a small size
are told worse than the parameters are large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from crossbody.cases.arrays import Floats

NULL = 1e-8
"""Singular value of the derivatives, columns of norm 1, over the largest, below which one has no effect."""
BELONGS = 0.3
"""Part of the largest weight of a direction from which on keeping a parameter is a good way to remove it."""
ROUNDING = 1e-9  # entry of a direction, of 1, that elimination makes of none
WEIGHT = 0.05  # part of the largest weight of a direction from which on a parameter belongs to it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Information:
    """What residuals tell.

    Attributes:
        basis: orthonormal basis of what the unknowns can change (N, R).
        weights: of every residual in every unknown (N, P): the change of x is weights^T residual.
        null: directions that change nothing, in relative changes of the unknowns (D, P), each of norm 1.
    """

    basis: Floats
    weights: Floats
    null: Floats


def information(J: Floats, scale: Floats) -> Information:
    """Spectrum of derivatives J (N, P) by unknowns of the sizes `scale` (P,)."""
    count, size = J.shape
    if not size:
        return Information(basis=np.zeros((count, 0)), weights=np.zeros((count, 0)), null=np.zeros((0, 0)))
    A = np.concatenate([J * scale, np.zeros((max(size - count, 0), size))])  # as many rows as columns
    norm = np.linalg.norm(A, axis=0)
    blind = ~(norm > 0.0)
    unit = np.where(blind, 1.0, norm)
    U, s, Vt = np.linalg.svd(A / unit, full_matrices=False)
    known = s > NULL * max(float(s[0]), 1e-300)
    U = U[:count, known]
    weights = (U / s[known]) @ Vt[known] * (scale / unit)
    null = Vt[~known] / unit
    null[:, blind] = Vt[~known][:, blind]
    null /= np.maximum(np.linalg.norm(null, axis=1, keepdims=True), 1e-300)
    return Information(basis=U, weights=weights, null=null)


def unseen_by(information: Information, count: int) -> Floats:
    """Null directions of the first `count` unknowns (D, count), made sparse by elimination."""
    rows = information.null[:, :count]
    rows = rows[np.linalg.norm(rows, axis=1) > WEIGHT]
    if not len(rows):
        return np.zeros((0, count))
    _, R, order = linalg.qr(rows, pivoting=True, mode="economic")
    rank = int(np.sum(np.abs(np.diag(R)) > WEIGHT * abs(R[0, 0])))
    reduced = np.zeros((rank, count))
    reduced[:, order] = np.linalg.solve(R[:rank, :rank], R[:rank])
    reduced[np.abs(reduced) < ROUNDING] = 0.0
    return reduced


def to_keep(null: Floats, influence: Floats) -> tuple[int, ...]:
    """Parameters that, kept, leave no null direction: one a direction, of those that belong to it the one seen best.

    Args:
        null: directions (D, P) from `unseen_by`.
        influence: size of what a relative change of each does (P,).
    """
    if not len(null):
        return ()
    belongs = np.where(np.abs(null) > BELONGS * np.max(np.abs(null), axis=1, keepdims=True), null, 0.0)
    _, _, order = linalg.qr(belongs * (influence + 1e-300), pivoting=True, mode="economic")
    return tuple(sorted(int(i) for i in order[: len(null)]))


def weak(covariance: Floats, sizes: Floats, quantile: float) -> Floats:
    """Directions (D, P) of relative changes that the data tell worse than the parameters are large."""
    if not len(covariance):
        return np.zeros((0, 0))
    values, vectors = np.linalg.eigh(covariance / np.outer(sizes, sizes))
    return vectors[:, quantile * np.sqrt(np.maximum(values, 0.0)) > 1.0].T


def in_words(direction: Floats, names: Sequence[str]) -> str:
    """A direction of relative changes as the combination of parameters that it is."""
    largest = float(np.max(np.abs(direction)))
    part = [(n, float(w) / largest) for n, w in zip(names, direction, strict=True) if abs(w) > WEIGHT * largest]
    if len(part) == 1:
        return part[0][0]
    first = np.sign(part[0][1])
    weights = np.array([first * w for _, w in part])
    if np.ptp(weights) < 0.02:
        return f"{', '.join(n for n, _ in part)} all multiplied by the same factor"
    return "relative changes of " + " and ".join(f"{n} by {w:+.2g}" for (n, _), w in zip(part, weights, strict=True))
