"""How far estimates can be relied on: halves of the data, other starts, the cost on either side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from crossbody.cases.arrays import Floats
from crossbody.hw.fitting.covariance import Layout, scatter
from crossbody.hw.fitting.derivative import Exact
from crossbody.hw.fitting.fit import Agreement
from crossbody.hw.fitting.information import WEIGHT, information
from crossbody.hw.fitting.search import TimeOver

DIFFERENT = 0.01  # probability, shared among all parameters, below which halves do not agree
UNLIKE = 5.0  # ratio of standard deviations from which on one half tells too little to be compared
FEWEST = 8  # samples of a channel in a half
UNLIKELY = 0.01  # probability, shared among all parameters, below which measured starts are refuted
SPAN, POINTS = 3.0, 9  # standard deviations on either side, and values in all (odd: one is the estimate)


def agreement(
    J: Floats, residual: Floats, layout: Layout, x: Floats, scale: Floats, names: Sequence[str], fixed: Sequence[int]
) -> tuple[Agreement, ...]:
    """Estimates of the halves, for every parameter that both tell.

    Args:
        J: derivatives of what is predicted by all unknowns (N, P); the first are the parameters.
        residual: what is measured less that (N,).
        layout: of the residuals.
        x: solution (P,).
        scale: sizes of the unknowns (P,).
        names: of the parameters.
        fixed: unknowns that did not move: kept, or at a bound.
    """
    free = np.setdiff1d(np.arange(len(x)), list(fixed))
    if not len(free):
        return ()
    sides = [_estimated(J[rows][:, free], residual[rows], part, scale[free]) for rows, part in _halves(layout)]
    if len(sides) < 2:
        return ()
    (a, s, f, first), (b, t, g, second) = sides
    alike = np.maximum(s, t) <= UNLIKE * np.minimum(s, t)
    both = [j for j in range(len(free)) if free[j] < len(names) and first[j] and second[j] and alike[j]]
    found = []
    for j in both:
        spread = float(np.hypot(s[j], t[j]))
        z = abs(float(a[j] - b[j])) / spread if spread > 0.0 else (0.0 if a[j] == b[j] else np.inf)
        # Welch and Satterthwaite: two deviations known with different certainty.
        count = spread**4 / (s[j] ** 4 / f[j] + t[j] ** 4 / g[j]) if spread > 0.0 else 1.0
        probability = float(2.0 * stats.t.sf(z, count))
        start = float(x[free[j]])
        found.append(Agreement(
            name=names[free[j]], values=(start + float(a[j]), start + float(b[j])),
            stds=(float(s[j]), float(t[j])), probability=probability,
            agrees=probability >= DIFFERENT / len(both),
        ))  # fmt: skip
    return tuple(found)


def _halves(layout: Layout) -> list[tuple[NDArray[np.int64], Layout]]:
    """Rows and layout of the first and the second half: of the windows, or of the samples of a single one."""
    window, count = layout.windows(), len(layout.samples)
    if count > 1:
        cut = count // 2
        parts = [(window < cut, layout.samples[:cut]), (window >= cut, layout.samples[cut:])]
    else:
        late, m = layout.times() > 0.5, layout.samples[0]
        parts = [(~late, (m - m // 2,)), (late, (m // 2,))]
    return [
        (np.flatnonzero(rows), Layout(samples=s, k=layout.k, overlap=layout.overlap))
        for rows, s in parts
        if min(s) >= FEWEST
    ]


def _estimated(
    J: Floats, residual: Floats, layout: Layout, scale: Floats
) -> tuple[Floats, Floats, Floats, NDArray[np.bool_]]:
    """Step, standard deviations, degrees of freedom, and whether the data tell each unknown, by a prediction's J."""
    told = information(J, scale)
    step = told.weights.T @ residual
    spread = scatter(told.basis, told.weights, residual - told.basis @ (told.basis.T @ residual), layout)
    known = np.all(np.abs(told.null) < WEIGHT, axis=0) if len(told.null) else np.ones(len(scale), dtype=bool)
    return step, spread.std, spread.freedom, known & (len(residual) > told.basis.shape[1])


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
    step, std, freedom, seen = _estimated(-J, r, joint.layout, sizes[loose])
    limit = np.atleast_1d(stats.t.isf(0.5 * UNLIKELY / len(loose), freedom))
    return {
        int(i): Move(by=float(b), std=float(s), refuted=bool(abs(b) > q * s))
        for i, b, s, q, known in zip(loose, step, std, limit, seen, strict=True)
        if known
    }


def _projected(joint: Exact, j: int, z: Floats, loose: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Derivatives (m, P) and residuals (m,) of one window without what its start can change."""
    block, count = joint.block(j, z), len(joint.free)
    start = block[:, count:]
    U = information(start, np.maximum(np.linalg.norm(start, axis=0), 1e-300) ** -1.0).basis
    J, r = block[:, loose], joint.residual_of(j, z)
    return J - U @ (U.T @ J), r - U @ (U.T @ r)


def profiles(
    problem: Any, x: Floats, J: Floats, sizes: Floats, stds: Mapping[int, float], limits: tuple[Floats, Floats]
) -> dict[int, tuple[Floats, Floats]]:
    """Sum of squares over that at the estimate, along the line on which the linear fit of the others lies.

    The residuals are those of the model, not of its linearisation: a profile that is no parabola
    says that intervals from derivatives are too narrow or too wide. It bounds the profile of a
    search at every value from above, and is equal to it to third order. Where the time limit ends
    it, what is complete is returned.

    Args:
        problem: residuals of the fitted windows.
        x: estimates of all unknowns (P,).
        J: their derivatives there (N, P).
        sizes: typical size of each.
        stds: unknown -> its standard deviation, of those that are profiled; the others of these
            columns go along.
        limits: bounds of all unknowns.

    Returns:
        Unknown -> values (n,) and costs (n,), 1 at the estimate.
    """
    residual = problem.residual(x)
    best = float(residual @ residual)
    found: dict[int, tuple[Floats, Floats]] = {}
    if best == 0.0:
        return found
    try:
        for i, std in stds.items():
            points = list(_along(problem, x, _direction(J, sizes, i), (i, std), limits))
            values, costs = np.array(points).T
            found[i] = values, costs / best
    except TimeOver:
        pass
    return found


def _direction(J: Floats, sizes: Floats, i: int) -> Floats:
    """How all unknowns move with unknown i, by least squares."""
    others = np.arange(J.shape[1]) != i
    way = np.ones(J.shape[1])
    scaled = J[:, others] * sizes[others]
    way[others] = sizes[others] * np.linalg.lstsq(scaled, -J[:, i], rcond=None)[0]
    return way


def _along(
    problem: Any, x: Floats, way: Floats, which: tuple[int, float], limits: tuple[Floats, Floats]
) -> Iterator[tuple[float, float]]:
    i, std = which
    for away in SPAN * std * np.linspace(-1.0, 1.0, POINTS):
        z = x + away * way
        if np.all((z >= limits[0]) & (z <= limits[1])):
            r = problem.residual(z)
            yield float(z[i]), float(r @ r)
