"""Residuals of a replay and their derivatives by central differences, for models whose contacts open and close.

A motion with contacts is no smooth function of its parameters: the step must be large beside the
jumps that a shifted touch makes, and the derivative at half the step tells how far it can be trusted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from crossbody.cases import InvalidValue, UnknownName, Value
from crossbody.cases.arrays import Floats
from crossbody.hw.fitting.covariance import Layout
from crossbody.hw.fitting.derivative import apart
from crossbody.hw.fitting.search import Deadline
from crossbody.hw.models.contract import Model
from crossbody.hw.windows.window import Window, overlap, run_window

STEP = 0.1  # step of a derivative, as a part of the parameter


class Differences:
    """Residuals of many windows, measured less predicted, run by an engine; see `Exact`.

    `starts` must be False; an empty engine is the model's first.
    """

    most = 30
    tolerance = 0.2  # an interval is as wide as its derivative is wrong
    ftol = 1e-4
    deadline = Deadline()

    def __init__(
        self, model: Model, numbers: Mapping[str, Value], free: Sequence[str],
        cut: Sequence[Window], starts: bool, stride: int, engine: str,
    ) -> None:  # fmt: skip
        for name in free:
            if name not in model.parameters:
                raise UnknownName(f"free parameter of {model.name}", name, model.parameters)
        if starts:
            raise InvalidValue(f"{model.name}: starts can be unknowns only where derivatives are exact.")
        self.model, self.numbers, self.free, self.cut = model, dict(numbers), tuple(free), tuple(cut)
        name, _, profile = (engine or model.engine).partition(":")
        self.engine, self.profile = name, profile or model.profiles.get(name, "matched")
        self.how = f"central differences of {100 * STEP:g} % through {name}"
        self.starts, self.k = False, model.differ(cut[0].y, cut[0].y).shape[1]
        self.grids = [np.arange(0, len(w.t), stride) for w in cut]

    def first(self) -> Floats:
        """The parameters at the beginning."""
        return np.array([float(self.numbers[name]) for name in self.free])

    def residual(self, x: Floats) -> Floats:
        """All windows' residuals (N,); a run that failed leaves the measured coordinates themselves."""
        numbers = self.numbers | {name: float(x[i]) for i, name in enumerate(self.free)}
        return np.concatenate([self._window(numbers, w, g) for w, g in zip(self.cut, self.grids, strict=True)])

    def jacobian(self, x: Floats) -> Floats:
        """Their derivatives (N, P)."""
        return np.column_stack([self._column(x, i, STEP) for i in range(len(x))])

    def checked(self, x: Floats, J: Floats, sizes: Floats, low: Floats) -> float:
        """Largest relative difference of the columns of J and those at half the step."""
        return max(apart(self.residual, x, J, i, 0.5 * STEP * abs(x[i]), low[i]) for i in range(len(sizes)))

    def flat(self, x: Floats) -> dict[int, str]:
        """Parameters that half or double their value hardly worsens: index -> that in words.

        A value is worse if the sums of squares of the windows are larger by more than their scatter
        explains (one-sided t test at 97.5 %), or all together by more than one parameter of as many
        observations as there are windows does (an F test: what a single window tells, others need
        not). Local derivatives of such a motion say less: they feel single touches that shift.
        """
        best = self._sums(x)
        found = {}
        for i, name in enumerate(self.free):
            low, high = self.model.parameters[name].low, self.model.parameters[name].high
            for factor in (0.5, 2.0):
                other = x.copy()
                other[i] = min(max(factor * x[i], low), high)
                rise = self._sums(other) - best
                scatter = _scatter(rise, best, len(self.layout.windows()))
                if np.mean(rise) <= scatter and np.sum(rise) <= _chance(best):
                    change = 100.0 * (np.sqrt(np.sum(best + rise) / np.sum(best)) - 1.0)
                    found[i] = (
                        f"at {other[i]:.4g} {self.model.parameters[name].unit} the rmse changes by {change:+.1f} %"
                    )
        return found

    def _sums(self, x: Floats) -> Floats:
        r, owners = self.residual(x), self.layout.windows()
        return np.bincount(owners, weights=r * r).astype(np.float64)

    @property
    def layout(self) -> Layout:
        """How residuals follow each other."""
        return Layout(samples=tuple(len(grid) for grid in self.grids), k=self.k, overlap=overlap(self.cut))

    def _column(self, x: Floats, i: int, part: float) -> Floats:
        e = np.zeros(len(x))
        e[i] = part * abs(x[i])
        if not e[i] > 0.0:
            raise InvalidValue(f"{self.free[i]} starts at 0: central differences need a start above it.")
        slope: Floats = (self.residual(x + e) - self.residual(x - e)) / (2.0 * e[i])
        return slope

    def _window(self, numbers: Mapping[str, Value], window: Window, grid: NDArray[np.int64]) -> Floats:
        self.deadline.check()
        run, _ = run_window(self.model, numbers, window, self.engine, self.profile, {})
        yhat, _ = self.model.see(self.model, run, np.ascontiguousarray(window.age[grid, 0]))
        found = self.model.differ(window.y[grid], yhat)
        plain = self.model.differ(window.y[grid], np.zeros_like(yhat))
        return np.where(np.isfinite(found), found, plain).T.ravel()


def _chance(best: Floats) -> float:
    """Rise of the whole sum of squares that one parameter makes by chance; any for a single window."""
    free = len(best) - 1
    return float(np.sum(best) * stats.f.ppf(0.95, 1, free) / free) if free else np.inf


def _scatter(rise: Floats, best: Floats, count: int) -> float:
    """What a mean rise of the windows' sums of squares must exceed; of one window, of its white residuals."""
    if len(rise) < 2:
        return 4.0 * float(best[0]) / count
    return float(stats.t.ppf(0.975, len(rise) - 1) * stats.sem(rise))
