"""How the cost rises on either side of an estimate while all other unknowns go along."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.hw.fitting.deadline import TimeOver

Floats = NDArray[np.float64]
SPAN, POINTS = 3.0, 9  # standard deviations on either side, and values in all (odd: one is the estimate)


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
