"""The search of an identification: bounded least squares over what the data see, within a time."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from crossbody.cases.arrays import Floats
from crossbody.hw.fitting.information import information, to_keep, unseen_by

NOISE = 1e-6
"""Of the sum of squares that one residual has in the mean: what the search still gains when it ends."""


class TimeOver(Exception):  # noqa: N818 - no error: it ends an identification
    """The time for all of it is over."""


class Deadline:
    """A time limit, s from now on, that is looked at before every run of a window."""

    def __init__(self, seconds: float = math.inf) -> None:
        self.seconds, self._end = seconds, time.monotonic() + seconds

    def check(self) -> None:
        """Go on, or stop."""
        if time.monotonic() > self._end:
            raise TimeOver


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """Where a search ended.

    Attributes:
        x: unknowns (P,).
        residual: there (N,).
        kept: unknowns that stayed at their start because the data see a combination of them alone.
        active: whether each unknown stands at a bound (P,).
        evaluations: of all residuals.
        success: whether the search converged.
        message: in words.
    """

    x: Floats
    residual: Floats
    kept: tuple[int, ...]
    active: NDArray[np.bool_]
    evaluations: int
    success: bool
    message: str


class _Spent(Exception):  # noqa: N818 - no error: it ends a search
    """The time is over."""


class _Timed:
    """Residuals and derivatives by some of the unknowns, until the time is over; remembers the best."""

    def __init__(self, problem: Any, x: Floats, end: float) -> None:
        self.problem, self.x, self.end = problem, x.copy(), end
        self.free = np.ones(len(x), dtype=bool)
        self.best: tuple[float, Floats, Floats] | None = None
        self.evaluations = 0
        self.last: tuple[Floats, Floats] | None = None

    def whole(self, part: Floats) -> Floats:
        """All unknowns from those that are free."""
        x = self.x.copy()
        x[self.free] = part
        return x

    def residual(self, part: Floats) -> Floats:
        """Residuals (N,)."""
        if self.best is not None and time.monotonic() > self.end:
            raise _Spent
        x = self.whole(part)
        r: Floats = self.problem.residual(x)
        self.evaluations += 1
        cost = float(r @ r)
        if self.best is None or cost < self.best[0]:
            self.best = (cost, x, r)
        return r

    def jacobian(self, part: Floats) -> Floats:
        """Derivatives by those that are free (N, F)."""
        if time.monotonic() > self.end:
            raise _Spent
        return self.derivatives(self.whole(part))[:, self.free]

    def best_so_far(self, kept: Sequence[int], message: str, limits: tuple[Floats, Floats]) -> Found:
        """Where a search was that did not end; its start, without residuals, if it had not begun."""
        _, x, r = self.best or (np.inf, self.x, np.zeros(0))
        active = ((x <= limits[0]) | (x >= limits[1])) & ~np.isin(np.arange(len(x)), kept)
        return Found(
            x=x, residual=r, kept=tuple(kept), active=active, evaluations=self.evaluations, success=False,
            message=message,
        )  # fmt: skip

    def derivatives(self, x: Floats) -> Floats:
        """Derivatives by all unknowns (N, P); those at the last place are not computed again."""
        if self.last is None or not np.array_equal(self.last[0], x):
            self.last = (x.copy(), self.problem.jacobian(x))
        return self.last[1]


def search(problem: Any, limits: tuple[Floats, Floats], scale: Any, count: int, budget: float) -> Found:
    """Make the residuals of a problem small.

    Where no residual sees a combination of parameters, one of them is kept at its start, so that
    the search has an end; if it turns out at the end that the data see it after all, it is let go.

    Args:
        problem: residuals and derivatives.
        limits: lowest and highest value of every unknown.
        scale: unknowns -> their typical sizes.
        count: parameters; the unknowns behind them are starts.
        budget: time, s.
    """
    low, high = limits
    x = np.clip(problem.first(), low, high)
    timed = _Timed(problem, x, time.monotonic() + budget)
    try:
        kept = _kept(timed.derivatives(x), scale(x), count)
        found = _descend(timed, limits, scale, kept)
        if kept and found.success:
            still = _kept(timed.derivatives(found.x), scale(found.x), count)
            if len(still) < len(kept):
                timed.x = found.x
                found = _descend(timed, limits, scale, still)
    except TimeOver:
        return timed.best_so_far((), f"The search was stopped after {timed.evaluations} runs of all windows.", limits)
    return found


def _kept(J: Floats, scale: Floats, count: int) -> tuple[int, ...]:
    influence: Floats = np.linalg.norm(J[:, :count], axis=0) * scale[:count]
    return to_keep(unseen_by(information(J, scale), count), influence)


def _descend(timed: _Timed, limits: tuple[Floats, Floats], scale: Any, kept: Sequence[int]) -> Found:
    timed.free = np.ones(len(timed.x), dtype=bool)
    timed.free[list(kept)] = False
    part = timed.free
    problem, x0 = timed.problem, timed.x
    active = np.zeros(len(x0), dtype=bool)
    if not np.any(part):
        return Found(
            x=x0, residual=problem.residual(x0), kept=tuple(kept), active=active,
            evaluations=timed.evaluations, success=True, message="There is nothing to search for.",
        )  # fmt: skip
    bounds = (limits[0][part], limits[1][part])
    try:
        ftol = max(problem.ftol, NOISE / len(timed.residual(x0[part])))
        ended = least_squares(
            timed.residual, x0[part], jac=timed.jacobian, bounds=bounds, x_scale=scale(x0)[part],
            method="trf", xtol=problem.ftol, ftol=ftol, gtol=1e-12, max_nfev=problem.most,
        )  # fmt: skip
    except _Spent:
        message = f"The time for the search was over after {timed.evaluations} runs of all windows."
        return timed.best_so_far(kept, message, limits)
    active[part] = ended.active_mask != 0
    return Found(
        x=timed.whole(ended.x), residual=ended.fun, kept=tuple(kept), active=active,
        evaluations=timed.evaluations, success=bool(ended.success), message=str(ended.message),
    )  # fmt: skip
