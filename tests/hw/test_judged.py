"""The numbers of a fit beside linear least squares written out, on made-up residuals of two channels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from crossbody import hw
from crossbody.cases.arrays import Floats
from crossbody.hw.fitting.covariance import Layout
from crossbody.hw.fitting.judged import Search, judged, unjudged
from crossbody.hw.fitting.search import Found

FREE = ("m1", "a1", "I1")
SAMPLES = (40, 55, 30, 61)


@dataclass
class Linear:
    """Residuals A x - b."""

    A: Floats
    b: Floats
    layout: Layout
    k: int = 2
    starts: bool = True
    how: str = "exact"
    tolerance: float = 1.0

    @property
    def grids(self) -> list[NDArray[np.intp]]:
        return [np.arange(n) for n in self.layout.samples]

    @property
    def cut(self) -> list[SimpleNamespace]:
        return [SimpleNamespace(t=1e-2 * np.arange(n)) for n in self.layout.samples]

    def residual(self, x: Floats) -> Floats:
        return self.A @ x - self.b

    def jacobian(self, x: Floats) -> Floats:
        return self.A

    def flat(self, x: Floats) -> dict[int, str]:
        return {}

    def checked(self, *_: object) -> float:
        return 3e-9


def drawn(seed: int, alike: float = 0.0) -> tuple[Search, Linear, Linear]:
    """A search that has ended at the least squares of noise that is five times as large in the second channel.

    Its second parameter does the same as so many times the first, but for a hundredth, if `alike` is not 0.
    """
    rng, layout, true = np.random.default_rng(seed), Layout(samples=SAMPLES, k=2), np.array([0.3, 0.2, 0.01])
    n = 2 * sum(SAMPLES)
    sides = []
    for _ in range(2):
        A = rng.normal(size=(n, 3)) * (1.0, 2.0, 30.0) + rng.normal(size=3) * (0.5, 0.0, 9.0)
        A[:, 1] = alike * A[:, 0] + 1e-2 * A[:, 1] if alike else A[:, 1]
        sides.append(Linear(A, A @ true + np.where(layout.channels() == 0, 1e-3, 5e-3) * rng.normal(size=n), layout))
    fitted, held = sides
    x = np.linalg.lstsq(fitted.A, fitted.b, rcond=None)[0]
    model = hw.models.load("double_pendulum")
    found = Found(
        x=x,
        residual=fitted.residual(x),
        kept=(),
        active=np.zeros(3, dtype=bool),
        evaluations=7,
        success=True,
        message="",
    )
    search = Search(
        model=model, numbers=model.numbers({}), free=FREE, problem=fitted, x0=1.1 * true, found=found,
        limits=(0.1 * true, 10.0 * true), sizes=np.abs(x), sides=(fitted, held), fitted=(0, 2, 3, 5), held=(1, 4),
    )  # fmt: skip
    return search, fitted, held


@pytest.mark.parametrize("seed", range(8))
def test_a_fit_is_linear_least_squares(seed: int) -> None:
    search, fitted, _ = drawn(seed)
    fit, A, r = judged(search), fitted.A, search.found.residual
    if fit.covariance != "white residuals":
        pytest.skip("one draw in twenty looks correlated")
    P = np.linalg.pinv(A)
    left, channel = 1.0 - np.sum(A * P.T, axis=1), fitted.layout.channels()
    size = np.array([np.sum(r[channel == c] ** 2) / np.sum(left[channel == c]) for c in (0, 1)])
    cov = (P * size[channel]) @ P.T
    std = np.sqrt(np.diag(cov))
    for i, (name, estimate) in enumerate(zip(FREE, fit.estimates, strict=True)):
        assert (estimate.name, estimate.unit) == (name, search.model.parameters[name].unit)
        assert estimate.value == search.found.x[i] == fit.parameters[name]
        assert estimate.std == pytest.approx(std[i], rel=1e-6)
        half = stats.t.ppf(0.975, estimate.freedom) * std[i]
        assert (estimate.low, estimate.high) == pytest.approx((estimate.value - half, estimate.value + half))
        assert (estimate.kept_low, estimate.kept_high) == (estimate.low, estimate.high)
        assert (estimate.start, estimate.bounds) == (search.x0[i], (search.limits[0][i], search.limits[1][i]))
        assert estimate.identifiable
        values, costs = fit.profile[name]
        others = np.delete(A, i, axis=1)
        for value, cost in zip(values, costs, strict=True):
            rest = fitted.b - A[:, i] * value
            least = np.sum((others @ np.linalg.lstsq(others, rest, rcond=None)[0] - rest) ** 2)
            assert cost == pytest.approx(least / np.sum(r**2), rel=1e-9)
    np.testing.assert_allclose(fit.correlation, cov / np.outer(std, std), atol=1e-6)
    assert (fit.kept, fit.unseen, fit.fitted, fit.held, fit.evaluations) == ((), (), (0, 2, 3, 5), (1, 4), 7)
    assert "3.0e-09" in fit.sensitivities


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(("far", "told"), [(1.1, True), (0.9, False)])
def test_what_reaches_a_bound_is_not_identifiable(side: int, far: float, told: bool) -> None:
    search = drawn(0)[0]
    free = judged(search).estimates
    limits = tuple(np.array(limit) for limit in search.limits)
    for i, one in enumerate(free):
        limits[side][i] = one.value + far * ((one.low, one.high)[side] - one.value)
    fit = judged(replace(search, limits=limits))
    assert [one.identifiable for one in fit.estimates] == [told] * len(free)
    assert ("cannot be distinguished from its bound" in " ".join(fit.warnings)) != told


@pytest.mark.parametrize("alike", [2.0, -2.0, 0.0])
def test_parameters_that_do_the_same_or_the_opposite_are_told(alike: float) -> None:
    fit = judged(drawn(0, alike)[0])
    assert alike == 0.0 or fit.correlation[1, 0] * np.sign(alike) < -0.999
    assert [f"{FREE[1]} and {FREE[0]} can hardly be separated" in " ".join(fit.warnings)] == [alike != 0.0]


@pytest.mark.parametrize("seed", range(8))
def test_errors_are_told_of_fitted_and_of_held_windows_before_and_after(seed: int) -> None:
    search, *sides = drawn(seed)
    fit = judged(search)
    for told, x in ((fit.before, search.x0), (fit.after, search.found.x)):
        for k, side in enumerate(sides):
            r, last, at = side.residual(x), [], 0
            for m in SAMPLES:
                ends = r[at + m - 1], r[at + 2 * m - 1]  # of the first channel, and of the second
                last.append(max(map(abs, ends)))
                at += 2 * m
            assert told["rmse"][k] == pytest.approx(np.sqrt(np.mean(r**2)))
            assert told["end_median"][k] == pytest.approx(np.median(last))
            assert told["end_90"][k] == pytest.approx(np.percentile(last, 90.0))
    growth = 100.0 * (fit.after["rmse"][1] / fit.before["rmse"][1] - 1.0)
    assert fit.worse == pytest.approx(max(growth, 0.0))


def test_a_fit_that_was_stopped_says_its_best_and_nothing_else() -> None:
    search, *_ = drawn(0)
    fit = unjudged(search, 3.0)
    assert [e.value for e in fit.estimates] == search.found.x.tolist()
    assert all(np.isinf([e.std, e.high, -e.low, e.kept_high, -e.kept_low]).all() for e in fit.estimates)
    assert not any(e.identifiable for e in fit.estimates)
    assert {name: fit.parameters[name] for name in FREE} == dict(zip(FREE, search.found.x, strict=True))
    assert np.isnan([*fit.before.values(), *fit.after.values()]).all()
    assert not fit.success
    assert "3 s" in fit.warnings[0]
