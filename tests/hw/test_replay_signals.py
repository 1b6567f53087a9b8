"""Laws of replay metrics over signals at random: delays, rotations, rates beside impacts, noise, ranks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rig_data import channels, log_of
from scipy.spatial.transform import Rotation

from crossbody import hw
from crossbody.cases import SceneError
from crossbody.hw.replaying import measures
from crossbody.hw.replaying.inverse import conditions
from crossbody.hw.windows.lift import closed_by
from crossbody.hw.windows.rates import rates_by_fit
from crossbody.hw.windows.turns import advanced, deviation, difference, increments, way
from crossbody.hw.windows.whiteness import autocorrelation, crosscorrelation, noise_level, stride_of
from crossbody.hw.windows.window import windows

STEP = 1e-3
SEEDS = st.integers(0, 2**32 - 1)


def signal(kind: str, random: np.random.Generator, seconds: float):
    """A motion (a function of time) of one kind, and the period in which it repeats itself; inf for never."""
    size, phase = random.uniform(0.2, 1.0, 3), random.uniform(0.0, 6.28, 12)
    period = random.uniform(0.05, 0.3) * seconds
    if kind in ("periodic", "decaying"):
        fade = random.uniform(0.5, 5.0) * seconds if kind == "decaying" else np.inf
        return (
            lambda t: (
                np.exp(-t / fade)
                * sum(size[j] * np.sin(2.0 * np.pi * (j + 1) * t / period + phase[j]) for j in range(3))
            ),
            period,
        )
    if kind == "chirp":
        first, last = random.uniform(2.0, 6.0) / seconds, random.uniform(10.0, 40.0) / seconds
        return lambda t: np.sin(2.0 * np.pi * (first * t + 0.5 * (last - first) / seconds * t * t) + phase[0]), np.inf
    rates = random.uniform(1.0, 40.0, 12) / seconds
    return lambda t: sum(
        np.sin(2.0 * np.pi * r * t + p) / np.sqrt(r * seconds) for r, p in zip(rates, phase, strict=True)
    ), np.inf


@settings(max_examples=60, deadline=None)
@given(SEEDS, st.sampled_from(["periodic", "decaying", "chirp", "aperiodic"]), st.integers(1, 4))
@example(7748, "decaying", 1)  # its third harmonic is strong: a third of a period off it is still .94 alike
@example(14374, "decaying", 1)  # 22.5 samples a period: between two samples of a maximum it looks less alike
def test_a_delay_is_right_or_not_given(seed: int, kind: str, windows: int) -> None:
    """Whole periods are never added: of those the one nearest to 0 is the delay."""
    random = np.random.default_rng(seed)
    n = int(random.integers(400, 3000))
    seconds = STEP * n
    motion, period = signal(kind, random, seconds)
    late = random.uniform(-0.2, 0.2) * min(period, 0.5 * seconds)
    noise = random.choice([0.0, 1e-5, 1e-4, 1e-3])
    y, yhat = [], []
    for w in range(windows):
        t = STEP * np.arange(n) + 0.37 * w * seconds
        y.append(np.diff(motion(t - late) + noise * random.standard_normal(n)))
        yhat.append(np.diff(motion(t)))
    found = measures.shift(y, yhat, STEP)
    assert np.isnan(found) or found == pytest.approx(late, abs=3e-4)


@settings(max_examples=60, deadline=None)
@given(SEEDS, st.floats(9.5, 40.0), st.sampled_from([0.5, 2.0, 10.0]))
def test_few_samples_a_period_hide_no_delay(seed: int, samples: float, fades: float) -> None:
    """Where samples meet a maximum by chance says nothing: the lag nearest to 0 is the delay, or none is given."""
    random = np.random.default_rng(seed)
    n = int(random.integers(10, 40) * samples)
    motion = three(random.uniform(0.2, 1.0, 3), random.uniform(0.0, 6.28, 3), STEP * samples, fades * STEP * n)
    t, late = STEP * np.arange(n), random.uniform(-0.2, 0.2) * STEP * samples
    found = measures.delay(motion(t - late) + 1e-5 * random.standard_normal(n), motion(t), STEP)
    assert np.isnan(found) or found == pytest.approx(late, abs=3e-4)


def three(size, phase, period, fade):
    return lambda t: (
        np.exp(-t / fade) * sum(size[j] * np.sin(2.0 * np.pi * (j + 1) * t / period + phase[j]) for j in range(3))
    )


@settings(max_examples=60, deadline=None)
@given(SEEDS, st.booleans(), st.sampled_from([0.05, 0.2]))
def test_a_delay_beside_the_errors_of_a_model_is_right_or_not_given(seed: int, fades: bool, error: float) -> None:
    """Amplitudes, phases and damping are off: the delay is unclear by the phases' part of a period, not by periods."""
    random = np.random.default_rng(seed)
    n = int(random.integers(400, 3000))
    t = STEP * np.arange(n)
    size, phase = random.uniform(0.2, 1.0, 3), random.uniform(0.0, 6.28, 3)
    period, fade = random.uniform(0.05, 0.3) * STEP * n, random.uniform(0.5, 5.0) * STEP * n if fades else np.inf
    rig = three(
        size * (1.0 + error * random.uniform(-1.0, 1.0, 3)),
        phase + 0.5 * error * random.uniform(-1.0, 1.0, 3),
        period,
        fade * np.exp(error * random.uniform(-1.0, 1.0)),
    )
    late = random.uniform(-0.2, 0.2) * period
    found = measures.delay(rig(t - late) + 1e-4 * random.standard_normal(n), three(size, phase, period, fade)(t), STEP)
    assert np.isnan(found) or abs(found - late) <= 0.5 * error * period / (2.0 * np.pi) + 3e-4


@pytest.mark.parametrize("seed", range(6))
def test_a_swing_with_a_little_too_much_friction_is_not_late_by_periods(seed: int) -> None:
    """The measured swing shrinks less: whole periods later the model has the size that the rig had before."""
    random, t = np.random.default_rng(seed), STEP * np.arange(20000)
    rate = 2.0 * np.pi * random.uniform(0.6, 1.5)
    measured, said = (np.exp(-t / fade) * np.sin(rate * t) for fade in (40.0, 32.0))
    found = measures.delay(measured + 1e-4 * random.standard_normal(len(t)), said, STEP)
    assert abs(found) < 2e-3


def test_a_delay_of_half_a_period_is_not_given() -> None:
    t = STEP * np.arange(10000)
    for late in (0.47, 0.5, 0.53):
        assert np.isnan(measures.delay(np.sin(2.0 * np.pi * (t - late)), np.sin(2.0 * np.pi * t), STEP))


@settings(max_examples=100, deadline=None)
@given(SEEDS, st.floats(0.0, np.pi - 1e-3))
def test_turns_differ_by_the_angle_between_them(seed: int, angle: float) -> None:
    random = np.random.default_rng(seed)
    axis = random.standard_normal((20, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turned = Rotation.random(20, random_state=seed % 2**32)
    other = Rotation.from_rotvec(angle * axis) * turned
    y = np.column_stack([random.standard_normal((20, 2)), other.as_rotvec(), random.standard_normal(20)])
    yhat = np.column_stack([random.standard_normal((20, 2)), turned.as_rotvec(), random.standard_normal(20)])
    found = difference(y, yhat, (2,))
    np.testing.assert_allclose(found[:, 2:5], angle * axis, atol=1e-7)
    np.testing.assert_array_equal(found[:, [0, 1, 5]], (y - yhat)[:, [0, 1, 5]])
    # Of one small angle to the other side of pi the components differ by up to 2 pi.
    assert np.linalg.norm(found[:, 2:5], axis=1).max() <= np.pi + 1e-9


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_a_tumbling_body_has_smooth_increments_and_a_bounded_spread(seed: int) -> None:
    random, t = np.random.default_rng(seed), 1.0 / 148.0 * np.arange(150)
    rate = random.uniform(-10.0, 10.0, 3)
    y = (Rotation.from_rotvec(np.outer(t, rate)) * Rotation.random(random_state=seed % 2**32)).as_rotvec()
    np.testing.assert_allclose(increments(y, (0,)), np.tile(rate / 148.0, (149, 1)), atol=1e-9)
    own = rates_by_fit(t, way(y, (0,)))  # about the body's own axes
    world = Rotation.from_rotvec(y).apply(own)
    np.testing.assert_allclose(world, np.tile(rate, (150, 1)), atol=1e-6)
    later = np.array([advanced(a, b, np.full(3, 1.0 / 148.0), (0,)) for a, b in zip(y[:-1], own[:-1], strict=True)])
    assert np.abs(difference(y[1:], later, (0,))).max() < 1e-7
    assert np.linalg.norm(deviation(y, (0,)), axis=1).max() <= np.pi + 1e-9
    y[3] = np.nan
    assert np.isfinite(difference(y, np.zeros_like(y), (0,))[[2, 4]]).all()


def bouncing(random: np.random.Generator, noise: float):
    """Times, measured heights, true rates and the time to the nearest impact of a ball that bounces, at 500 Hz."""
    v, falls = [random.uniform(2.0, 4.0)], random.uniform(0.6, 0.95)
    at = [0.0]
    while v[-1] > 0.6:
        at.append(at[-1] + 2.0 * v[-1] / 9.81)
        v.append(falls * v[-1])
    hits, speeds = np.array(at), np.array(v)
    t = np.arange(0.0, hits[-1], 1.0 / 500.0)
    k = np.searchsorted(hits, t, side="right") - 1
    s = t - hits[k]
    y = speeds[k] * s - 0.5 * 9.81 * s * s + noise * random.standard_normal(len(t))
    return t, y, speeds[k] - 9.81 * s, np.minimum(s, hits[k + 1] - t)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("noise", "off"), [(0.0, 1e-9), (1e-5, 3e-3), (1e-4, 3e-2)])
def test_a_rate_is_never_taken_across_an_impact(seed: int, noise: float, off: float) -> None:
    """Every sample that is not within three of an impact; across one the rate is off by up to 2.3 m/s."""
    t, y, rate, near = bouncing(np.random.default_rng(seed), noise)
    error = np.abs(rates_by_fit(t, y[:, None])[:, 0] - rate)[near > 3.0 / 500.0]
    assert error.max() < off


def test_a_window_that_starts_beside_a_bounce_starts_with_its_rate() -> None:
    """The apex of a small bounce: samples on both sides reach across impacts."""
    t, y, rate, _ = bouncing(np.random.default_rng(7), 1e-4)
    apex = int(np.flatnonzero(np.abs(rate) < 0.02)[-1])
    log = log_of(t[apex:], channels("coordinates", "m", {"height": y[apex:]}))
    model = hw.models.load("ball")
    assert abs(windows(log, model)[0].segment.yd[0] - rate[apex]) < 0.03


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("late", range(-3, 4))
def test_a_window_never_starts_with_the_rate_of_an_impact(seed: int, late: int) -> None:
    """A start in an impact was off by up to half of what the impact changes."""
    t, y, rate, _ = bouncing(np.random.default_rng(seed), 1e-4)
    hits = np.flatnonzero(np.diff(rate) > 0.1)
    log = log_of(t, channels("coordinates", "m", {"height": y}))
    begin = int(hits[1]) + late
    cut = windows(log.window(float(t[begin]), float(t[-1])), hw.models.load("ball"))[0]
    at = int(np.searchsorted(t, cut.t[0] - 1e-9))
    assert abs(cut.segment.yd[0] - rate[at]) < 0.06


def residuals(random: np.random.Generator, defect: float, windows: int = 12, n: int = 2000):
    """Motion at about 1.5 Hz sampled at 1 kHz, and residuals: noise of 1e-3 and a smooth error of a size."""
    t = STEP * np.arange(n)
    waves = [np.sin(9.4 * t + random.uniform(0.0, 6.28)) for _ in range(windows)]
    smooth = [np.sin(random.uniform(6.0, 14.0) * t + random.uniform(0.0, 6.28)) for _ in range(windows)]
    noise = [1e-3 * random.standard_normal(n) for _ in range(windows)]
    motion = [wave + e for wave, e in zip(waves, noise, strict=True)]
    return motion, [e + np.sqrt(2.0) * defect * s for e, s in zip(noise, smooth, strict=True)]


@pytest.mark.parametrize("seed", range(5))
def test_at_a_kilohertz_the_verdict_tells_errors_below_the_noise_from_those_above(seed: int) -> None:
    random = np.random.default_rng(seed)
    for defect, low, high in ((0.0, 0.95, 1.0), (3e-4, 0.95, 1.0), (1e-2, 0.0, 0.6)):
        motion, left = residuals(random, defect)
        noise = noise_level(motion)
        assert noise == pytest.approx(1e-3, rel=0.1)
        stride = stride_of(motion, noise)
        assert 30 < stride < 100
        assert low <= autocorrelation(left, stride=stride, floor=noise).inside <= high
    # Without either every error shows, however small: that is the test of the textbook.
    assert autocorrelation(residuals(random, 1e-3)[1]).inside < 0.1


@pytest.mark.parametrize("seed", range(3))
def test_an_input_that_the_model_misses_shows_above_the_noise(seed: int) -> None:
    random = np.random.default_rng(seed)
    u = [np.convolve(random.standard_normal(1999 + 40), np.ones(40) / 40.0, "valid") for _ in range(6)]
    noise = [0.1 * random.standard_normal(2000) for _ in u]
    assert crosscorrelation(noise, u, stride=20, floor=0.1).inside > 0.95
    missed = [e + 3.0 * x for e, x in zip(noise, u, strict=True)]
    assert crosscorrelation(missed, u, stride=20, floor=0.1).inside < 1.0


@settings(max_examples=50, deadline=None)
@given(SEEDS, st.integers(1, 5), st.integers(1, 5))
def test_inputs_that_no_motion_tells_are_named(seed: int, k: int, m: int) -> None:
    random = np.random.default_rng(seed)
    names, rows = tuple(f"u{i}" for i in range(m)), tuple(f"q{i}" for i in range(k))
    B = random.standard_normal((6, k, m))
    t = np.arange(6.0)
    if k == m:
        assert conditions(t, B, rows, names, "arm").shape == (6,)
        if m > 1:
            B[2, :, 1] = -2.0 * B[2, :, 0]
            with pytest.raises(SceneError, match=r"first at t = 2 s, condition .* cannot distinguish u0 from u1 "):
                conditions(t, B, rows, names, "arm")
        return
    with pytest.raises(SceneError, match="cannot distinguish|does nothing" if m > k else "no input balances"):
        conditions(t, B, rows, names, "arm")


def test_rows_that_do_not_hold_a_pose_are_told() -> None:
    H = np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 1.0]])
    with pytest.raises(SceneError, match=r"rank 1 .* leave coordinates \[0, 1\] free"):
        closed_by(H, np.array([0, 1]), np.ones(2))


def test_inverse_says_which_joint_has_no_motor() -> None:
    t = np.arange(0.0, 0.2, 2e-3)
    log = log_of(t, channels("coordinates", "rad", {"th1": 2.0 + np.sin(3.0 * t), "th2": 2.5 + np.cos(4.0 * t)}))
    whole = hw.models.load("double_pendulum")
    found = hw.inverse(log, whole, stride=10)
    assert np.all(np.isfinite(found.value))
    assert np.all((found.condition >= 1.0) & (found.condition < 1e3))
    with pytest.raises(SceneError, match=r"1 inputs \(torque 1\) and 2 measured .* no input balances th2"):
        hw.inverse(log, replace(whole, inputs=("torque 1",)), stride=10)
