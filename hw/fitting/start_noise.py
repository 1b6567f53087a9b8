"""Would the estimates be others if the windows started elsewhere? A test of starts that were taken as measured.

The noise of a measured start moves its whole window: it makes residuals that no noise of single
samples makes, biases the estimate, and no interval counts it. With the starts as unknowns that is
gone. One Gauss-Newton step tells to first order where the estimates would then be: every window's
residuals and derivatives are projected onto what its own start cannot change (its Schur
complement), so that the parameters are the only unknowns left. A difference between two estimates
of which one is right whether or not the measured starts are refutes these (Hausman 1978).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from crossbody.cases.arrays import Floats
from crossbody.hw.fitting.covariance import scatter
from crossbody.hw.fitting.derivative import Exact
from crossbody.hw.fitting.information import WEIGHT, information

UNLIKELY = 0.01  # probability, shared among all parameters, below which measured starts are refuted


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """How free starts would move one estimate.

    Attributes:
        by: change of the value, to first order.
        std: standard deviation of the estimate with free starts.
        refuted: whether noise alone makes such a change with less than the probability `UNLIKELY`.
    """

    by: float
    std: float
    refuted: bool


def moves(problem: Exact, x: Floats, sizes: Floats, fixed: Sequence[int]) -> dict[int, Move]:
    """What free starts would do to estimates that were found with measured ones.

    Args:
        problem: of the fitted windows, started as measured.
        x: estimates (P,).
        sizes: of the parameters (P,).
        fixed: parameters that did not move: kept, or at a bound.

    Returns:
        index of a parameter -> its move; parameters that the data do not tell with free starts are left out.
    """
    joint = Exact(problem.model, problem.numbers, problem.free, problem.cut, True, problem.stride)
    z = np.concatenate([x, joint.first()[len(x) :]])
    loose = np.setdiff1d(np.arange(len(x)), list(fixed))
    if not len(loose):
        return {}
    parts = [_projected(joint, j, z, loose) for j in range(len(joint.cut))]
    J, r = (np.concatenate([part[i] for part in parts]) for i in range(2))
    told = information(J, sizes[loose])
    step = told.weights.T @ r
    spread = scatter(told.basis, told.weights, r - told.basis @ (told.basis.T @ r), joint.layout)
    seen = np.all(np.abs(told.null) < WEIGHT, axis=0) if len(told.null) else np.ones(len(loose), dtype=bool)
    limit = np.atleast_1d(stats.t.isf(0.5 * UNLIKELY / len(loose), spread.freedom))
    return {
        int(i): Move(by=float(b), std=float(s), refuted=bool(abs(b) > q * s))
        for i, b, s, q, known in zip(loose, step, spread.std, limit, seen, strict=True)
        if known
    }


def _projected(joint: Exact, j: int, z: Floats, loose: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Derivatives (m, P) and residuals (m,) of one window without what its start can change."""
    block, count = joint.block(j, z), len(joint.free)
    start = block[:, count:]
    U = information(start, np.maximum(np.linalg.norm(start, axis=0), 1e-300) ** -1.0).basis
    J, r = block[:, loose], joint.residual_of(j, z)
    return J - U @ (U.T @ J), r - U @ (U.T @ r)
