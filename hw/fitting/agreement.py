"""Do disjoint stretches of the data tell the same? Each half's own estimate, to first order about the common one.

A Gauss-Newton step on one half of the residuals, x + J_h^+ r_h, is that half's estimate where the
model is near enough to linear over the step. Two halves of independent noise differ by more than
their standard deviations explain only if the model is not the same in both: what it lacks then
moves its parameters, and no interval covers that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from crossbody.cases.arrays import Floats
from crossbody.hw.fitting.covariance import Layout, scatter
from crossbody.hw.fitting.fit import Agreement
from crossbody.hw.fitting.information import WEIGHT, information

DIFFERENT = 0.01  # probability, shared among all parameters, below which halves do not agree
UNLIKE = 5.0  # ratio of standard deviations from which on one half tells too little to be compared
FEWEST = 8  # samples of a channel in a half


def agreement(
    J: Floats, residual: Floats, layout: Layout, x: Floats, scale: Floats, names: Sequence[str], fixed: Sequence[int]
) -> tuple[Agreement, ...]:
    """Estimates of the halves, for every parameter that both tell.

    Args:
        J: derivatives by all unknowns (N, P); the first are the parameters.
        residual: (N,).
        layout: of the residuals.
        x: solution (P,).
        scale: sizes of the unknowns (P,).
        names: of the parameters.
        fixed: unknowns that did not move: kept, or at a bound.
    """
    free = np.setdiff1d(np.arange(len(x)), list(fixed))
    if not len(free):
        return ()
    sides = [_half(J[rows][:, free], residual[rows], part, scale[free]) for rows, part in _halves(layout)]
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


def _half(
    J: Floats, residual: Floats, layout: Layout, scale: Floats
) -> tuple[Floats, Floats, Floats, NDArray[np.bool_]]:
    """Step, standard deviations, degrees of freedom, and whether the half tells each unknown."""
    told = information(J, scale)
    step = told.weights.T @ residual
    spread = scatter(told.basis, told.weights, residual - told.basis @ (told.basis.T @ residual), layout)
    known = np.all(np.abs(told.null) < WEIGHT, axis=0) if len(told.null) else np.ones(len(scale), dtype=bool)
    return step, spread.std, spread.freedom, known & (len(residual) > told.basis.shape[1])
