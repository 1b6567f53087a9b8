"""Splines without scipy are those of scipy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from crossbody.cases.arrays import distinct, quantiles
from crossbody.cases.splines import FEW, spline

SIZES = (3, 4, 5, 6, FEW, FEW + 1, FEW + 2, FEW + 3, FEW + 4, 2 * FEW + 3, 400, 401)


@given(st.integers(0, 2**32 - 1), st.sampled_from(SIZES), st.floats(0.0, 2.0))
def test_a_spline_is_that_of_scipy(seed: int, size: int, spread: float) -> None:
    """At uneven instants too, between which it overshoots."""
    draw = np.random.default_rng(seed)
    t = np.cumsum(10.0 ** draw.uniform(-spread, 0.0, size)) - 5.0
    values = draw.normal(size=(size, 3))
    times = np.concatenate([t, draw.uniform(t[0], t[-1], 50)])
    wanted = CubicSpline(t, values)(times)
    assert np.abs(spline(t, values, times) - wanted).max() <= 1e-9 * np.abs(wanted).max()


@pytest.mark.parametrize("size", SIZES[1:])
def test_a_cubic_is_its_own_spline(size: int) -> None:
    t = np.sort(np.random.default_rng(size).uniform(-1.0, 1.0, size))
    times = np.linspace(t[0], t[-1], 200)
    cubic = np.array([[1.0, -2.0, 0.5, 3.0]])
    wanted = np.stack([np.polyval(c, times) for c in cubic], axis=1)
    given_ = np.stack([np.polyval(c, t) for c in cubic], axis=1)
    assert np.abs(spline(t, given_, times) - wanted).max() < 1e-8


def test_samples_are_met() -> None:
    t, values = np.array([0.0, 0.1, 0.5, 2.0]), np.array([[1.0], [-1.0], [4.0], [0.5]])
    assert np.allclose(spline(t, values, t), values, rtol=0.0, atol=1e-14)


@given(st.lists(st.floats(-10.0, 10.0).map(lambda x: round(x, 1)), min_size=1, max_size=30), st.floats(0.0, 1.0))
def test_distinct_values_and_quantiles_are_those_of_numpy(values: list[float], part: float) -> None:
    assert np.array_equal(distinct(values, values[:1]), np.unique(values))
    assert np.allclose(quantiles(values, part, 0.5), np.quantile(values, [part, 0.5]), rtol=0.0, atol=1e-13)


def test_not_a_number_is_one_value() -> None:
    assert np.array_equal(distinct([np.nan, 1.0, np.nan]), np.unique([np.nan, 1.0, np.nan]), equal_nan=True)
