"""Intervals as often right as they say, and what no data see: laws over designs and noises at random."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import signal, stats

from crossbody.hw.fitting.covariance import Layout, _lagged, scatter, whiteness
from crossbody.hw.fitting.doubts import agreement
from crossbody.hw.fitting.information import in_words, information, to_keep, unseen_by
from crossbody.hw.replaying.inverse import noise_of
from crossbody.hw.windows.rates import derivatives, felt

PARAMETERS = 3
SHAPES = ("polynomials", "waves", "growing waves")


def design(shape: str, layout: Layout, random: np.random.Generator) -> np.ndarray:
    """Derivatives (N, 3) of one of the kinds that replays have."""
    columns = []
    for p in range(PARAMETERS):
        parts = []
        for m in layout.samples:
            t = np.linspace(0.0, 1.0, m)
            for c in range(layout.k):
                wave = np.sin(2.0 * np.pi * random.uniform(0.5, 8.0) * t + random.uniform(0.0, 6.0))
                scale = {"polynomials": t**p * (1.0 + 0.3 * c), "waves": wave, "growing waves": t ** (p % 2 + 1) * wave}
                parts.append(scale[shape])
        columns.append(np.concatenate(parts))
    return np.column_stack(columns)


def noise(layout: Layout, correlation: float, draws: int, random: np.random.Generator) -> np.ndarray:
    """Stationary first-order noise of unit variance (N, draws), independent between channels and windows."""
    parts = []
    for m in np.repeat(layout.samples, layout.k):
        e = random.standard_normal((m, draws)) * np.sqrt(1.0 - correlation**2)
        e[0] /= np.sqrt(1.0 - correlation**2)
        parts.append(signal.lfilter([1.0], [1.0, -correlation], e, axis=0))
    return np.concatenate(parts)


def covered(shape: str, layout: Layout, correlation: float, draws: int, seed: int) -> tuple[float, float]:
    """Part of the true values inside 95 % intervals, and inside those of white residuals."""
    random = np.random.default_rng(seed)
    J = design(shape, layout, random)
    told = information(J, np.ones(PARAMETERS))
    hits, white = [], []
    for e in noise(layout, correlation, draws, random).T:
        estimate = told.weights.T @ e
        left = e - told.basis @ (told.basis.T @ e)
        hits.append(np.abs(estimate) <= scatter(told.basis, told.weights, left, layout).half)
        std = np.sqrt(left @ left / (len(e) - PARAMETERS)) * np.linalg.norm(told.weights, axis=0)
        white.append(np.abs(estimate) <= 1.96 * std)
    return float(np.mean(hits)), float(np.mean(white))


LAYOUTS = (
    Layout(samples=(60,), k=1), Layout(samples=(600,), k=1), Layout(samples=(150,) * 3, k=2),
    Layout(samples=(50,) * 12, k=1),
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS, ids=["60", "600", "3x150x2", "12x50"])
@pytest.mark.parametrize("shape", SHAPES)
def test_intervals_of_white_noise_hold_as_often_as_they_say(shape: str, layout: Layout) -> None:
    """4 designs of 600 draws of 3 parameters: 95 % has a deviation of .4 % where the parameters were one."""
    found = np.mean([covered(shape, layout, 0.0, 600, seed)[0] for seed in range(4)])
    assert 0.93 <= found <= 0.97


@pytest.mark.slow
@pytest.mark.parametrize("correlation", [0.5, 0.8, 0.95])
@pytest.mark.parametrize("layout", LAYOUTS[1:], ids=["600", "3x150x2", "12x50"])
def test_intervals_of_correlated_noise_hold_too(layout: Layout, correlation: float) -> None:
    """4 designs of each kind, 150 draws of 3 parameters each; a kind by itself may be a percent wider."""
    found = {shape: [covered(shape, layout, correlation, 150, seed) for seed in range(4)] for shape in SHAPES}
    holds = {shape: float(np.mean([one for one, _ in some])) for shape, some in found.items()}
    print(layout, correlation, holds)
    assert 0.90 <= np.mean(list(holds.values())) <= 0.98
    assert min(holds.values()) >= 0.90
    assert max(holds.values()) <= 0.99
    if correlation == 0.95:  # what intervals of white noise would have said
        assert np.mean([white for _, white in found["polynomials"]]) < 0.6


def test_some_intervals_hold_in_every_run() -> None:
    """A small part of the two laws."""
    for layout, correlation, low in ((LAYOUTS[0], 0.0, 0.91), (LAYOUTS[3], 0.0, 0.91), (LAYOUTS[3], 0.95, 0.88)):
        assert covered("growing waves", layout, correlation, 120, 5)[0] >= low


def test_short_windows_are_tested_for_white_noise() -> None:
    """20 windows of 50 samples, none of which tells much by itself."""
    layout, random = Layout(samples=(50,) * 20, k=1), np.random.default_rng(0)
    Q = information(design("waves", layout, random), np.ones(PARAMETERS)).basis
    said = {r: [whiteness(Q, e, layout) for e in noise(layout, r, 60, random).T] for r in (0.0, 0.3, 0.957)}
    assert np.mean(np.array(said[0.0]) < 0.05) < 0.15
    assert max(said[0.3]) < 0.05
    assert max(said[0.957]) < 1e-12


def test_a_noisy_channel_widens_only_what_it_tells() -> None:
    layout, random = Layout(samples=(400,), k=2), np.random.default_rng(1)
    J = np.zeros((800, 2))
    J[:400, 0] = J[400:, 1] = 1.0
    e = random.standard_normal(800) * np.repeat([1.0, 30.0], 400)
    told = information(J, np.ones(2))
    found = scatter(told.basis, told.weights, e - told.basis @ (told.basis.T @ e), layout)
    np.testing.assert_allclose(found.std, [1.0 / 20.0, 30.0 / 20.0], rtol=0.15)


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 7), st.integers(0, 3), st.integers(0, 2**32 - 1))
@example(7, 3, 12230)  # one parameter is 9e-4 of a direction
def test_every_null_direction_is_found_and_one_parameter_each_is_kept(size: int, lost: int, seed: int) -> None:
    """J = B (I - N^T N) D: what it does not see is known."""
    random = np.random.default_rng(seed)
    lost = min(lost, size - 1)
    N = np.linalg.qr(random.standard_normal((size, max(lost, 1))))[0][:, :lost].T
    scale = 10.0 ** random.uniform(-6.0, 6.0, size)
    J = random.standard_normal((40, size)) @ (np.eye(size) - N.T @ N) / scale
    told = information(J, scale)
    null = unseen_by(told, size)
    kept = to_keep(null, np.linalg.norm(J * scale, axis=0))
    assert len(null) == len(kept) == lost
    assert np.abs((J * scale) @ null.T).max(initial=0.0) < 1e-6 * np.abs(J * scale).max()
    rest = np.setdiff1d(np.arange(size), kept)
    assert not len(unseen_by(information(J[:, rest], scale[rest]), len(rest)))


def test_a_combination_is_named() -> None:
    names = ("m1", "m2", "I1", "k1")
    assert in_words(np.array([0.5, 0.5, 0.5, 0.5]), names) == "m1, m2, I1, k1 all multiplied by the same factor"
    assert in_words(np.array([0.0, 0.0, -1.0, 0.0]), names) == "I1"
    assert in_words(np.array([0.0, 1.0, 0.0, -0.5]), names) == "relative changes of m2 by +1 and k1 by -0.5"


@pytest.mark.parametrize("layout", [Layout(samples=(300,), k=2), Layout(samples=(60,) * 10, k=1)], ids=["one", "ten"])
def test_halves_disagree_where_the_parameter_moved_and_seldom_else(layout: Layout) -> None:
    random, told = np.random.default_rng(2), []
    J = design("waves", layout, random)
    half = layout.times() > 0.5 if len(layout.samples) == 1 else layout.windows() >= len(layout.samples) // 2
    for moved in (0.0, 1.0):
        for e in 0.2 * noise(layout, 0.6, 40, random).T:
            y = e + moved * half * J[:, 1]
            x = np.linalg.lstsq(J, y, rcond=None)[0]
            halves = agreement(J, y - J @ x, layout, x, np.ones(3), ("a", "b", "c"), ())
            assert len(halves) == 3
            told.append((moved, halves[1].agrees))
            if moved and len(layout.samples) > 1:
                assert halves[1].values[1] - halves[1].values[0] == pytest.approx(1.0, abs=0.5)
    assert np.mean([agrees for moved, agrees in told if not moved]) > 0.9
    assert np.mean([agrees for moved, agrees in told if moved]) < 0.1


@pytest.mark.parametrize("lag", [1, 2, 3])
@pytest.mark.parametrize("samples", [(12,) * 40, (40,) * 12, (12, 200, 30)])
def test_correlations_of_white_noise_have_the_variance_that_they_are_told_in(
    samples: tuple[int, ...], lag: int
) -> None:  # fmt: skip
    """At every lag, in short windows, which have few pairs, as in long ones."""
    random = np.random.default_rng(7 + lag)
    layout = Layout(samples=samples, k=1)
    basis = np.linalg.qr(design("polynomials", layout, random))[0]
    draws = noise(layout, 0.0, 1000, random)
    scores = np.array([_lagged(e, basis, layout, lag) for e in (draws - basis @ (basis.T @ draws)).T])
    assert scores.mean() == pytest.approx(0.0, abs=0.15)
    assert scores.var() == pytest.approx(1.0, rel=0.16)


@pytest.mark.parametrize(("half", "degree"), [(3, 2), (5, 3), (12, 4), (20, 5)])
def test_noise_about_polynomials_is_what_was_put_in(half: int, degree: int) -> None:
    """However much of it the polynomials take."""
    random = np.random.default_rng(half)
    t = np.linspace(0.0, 2.0, 20_000)
    y = np.column_stack([np.sin(t) + 1e-2 * random.standard_normal(len(t)), 3.0 * random.standard_normal(len(t))])
    assert noise_of(t, y, half, degree) == pytest.approx([1e-2, 3.0], rel=0.02)


@pytest.mark.parametrize("late", [0.0, 0.4, 1.0, 2.3, -1.2])
@pytest.mark.parametrize(("half", "degree"), [(4, 2), (6, 4)])
def test_a_smoothed_acceleration_feels_an_input_as_its_samples_are_late(half: int, degree: int, late: float) -> None:
    """That of y, which is x a delay ago with x'' = u: a mean of the same steps, to what windows are rounded to."""
    random, n = np.random.default_rng(half), 60
    t = np.cumsum(random.uniform(0.8, 1.2, n))
    u, delay = random.standard_normal((n, 2)), late
    steps = np.diff(t)[:, None]
    v = np.vstack([np.zeros((1, 2)), np.cumsum(u[:-1] * steps, axis=0)])
    x = np.vstack([np.zeros((1, 2)), np.cumsum((v[:-1] + 0.5 * u[:-1] * steps) * steps, axis=0)])
    then = t - delay
    k = np.clip(np.searchsorted(t, then, side="right") - 1, 0, n - 1)
    s = (then - t[k])[:, None]
    y = x[k] + (v[k] + 0.5 * u[k] * s) * s
    rows = np.arange(half + 4, n - half - 4)
    acceleration = derivatives(t, y, half, degree, rows)[2]
    assert felt(t, u, delay, half, degree, rows) == pytest.approx(acceleration, abs=1e-6)


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 5])
def test_halves_with_unlike_noise_are_told_apart_as_by_welch(seed: int) -> None:
    """Of a mean alone that is his test, here by SciPy."""
    random = np.random.default_rng(seed)
    early, late = random.normal(0.0, 1.0, 10), random.normal(1.0, 1.5, 60)
    residual = np.concatenate([early, late])
    layout = Layout(samples=(len(early), len(late)), k=1)
    (found,) = agreement(np.ones((len(residual), 1)), residual, layout, np.zeros(1), np.ones(1), ("mean",), ())
    halves = [Layout(samples=(len(part),), k=1) for part in (early, late)]
    ones = [np.full((len(part), 1), len(part) ** -0.5) for part in (early, late)]
    white = [whiteness(Q, part - part.mean(), half) for Q, part, half in zip(ones, (early, late), halves, strict=True)]
    assert min(white) >= 0.05, "another seed: this one asks for correlated noise"
    assert found.probability == pytest.approx(stats.ttest_ind(early, late, equal_var=False).pvalue, rel=1e-9)
