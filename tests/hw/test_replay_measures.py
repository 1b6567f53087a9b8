"""Metrics, residual tests, sensors and impacts against signals whose answer is known."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from crossbody.cases import InvalidValue
from crossbody.hw import Sensor, unlagged
from crossbody.hw.replaying import measures as _measures
from crossbody.hw.replaying import tracked
from crossbody.hw.replaying.sensors import lagged
from crossbody.hw.windows.rates import Impacts, derivatives, felt, impacts, least_of, matched
from crossbody.hw.windows.whiteness import OVERSAMPLED, autocorrelation, crosscorrelation, stride_of

STEP = 0.88e-3


def test_fit_is_hundred_for_the_measurement_and_nothing_for_its_mean() -> None:
    y = np.sin(np.linspace(0.0, 7.0, 500))
    assert _measures.fit(y, y) == 100.0
    assert _measures.fit(y, np.full(500, y.mean())) == pytest.approx(0.0, abs=1e-12)
    assert _measures.bias(y, y + 0.25) == pytest.approx(0.25)
    assert _measures.rmse(y, y - 0.25) == pytest.approx(0.25)
    assert _measures.largest(y, y - 0.25) == pytest.approx(0.25)


@pytest.mark.parametrize("late", [-2.3e-3, 0.0, 1e-4, 0.4e-3, 0.88e-3, 7.77e-3])
def test_delay_is_found_to_a_part_of_a_sample(late: float) -> None:
    t = STEP * np.arange(4000)

    def signal(at):
        return np.sin(2 * np.pi * 1.1 * at) + 0.3 * np.sin(2 * np.pi * 9.0 * at + 1.0) + 0.1 * at

    found = _measures.delay(signal(t - late) + 2e-5 * np.random.default_rng(1).standard_normal(4000), signal(t), STEP)
    assert found == pytest.approx(late, abs=5e-5)


@pytest.mark.parametrize("part", [-0.24, -0.15, -0.05, 0.05, 0.15, 0.24, 0.3])
def test_a_delay_is_looked_for_up_to_a_quarter_of_the_record(part: float) -> None:
    """Steps at random, which no lag but the right one explains; what is later than a quarter is not told."""
    late = round(part * 2000)
    whole = np.cumsum(np.random.default_rng(3).standard_normal(4000))
    found = _measures.delay(whole[1000 - late : 3000 - late], whole[1000:3000], STEP)
    if abs(part) <= 0.25:
        assert found == pytest.approx(late * STEP, abs=STEP)
    else:
        assert not abs(found) > 0.25 * 2000 * STEP


@pytest.mark.parametrize("lengths", [(7,), (7, 400), (400, 8), (5, 6, 7)])
def test_a_delay_by_half_a_period_is_unknown_however_short_the_windows(lengths: tuple[int, ...]) -> None:
    moved = [(-1.0) ** np.arange(n) for n in lengths]
    assert np.isnan(_measures.shift(moved, [-x for x in moved], 1e-2))


def test_delay_of_what_does_not_move_is_unknown() -> None:
    assert np.isnan(_measures.delay(np.ones(100), np.ones(100), STEP))


def test_bands_hold_for_noise_and_not_for_what_is_left_to_explain() -> None:
    random = np.random.default_rng(3)
    slow = np.convolve(random.standard_normal(6000), np.ones(40) / 40, "valid")
    inside, mixed = [], []
    for _ in range(40):
        noise = random.standard_normal(len(slow))
        inside += [autocorrelation(noise).inside, crosscorrelation(noise, slow).inside]
        mixed.append(crosscorrelation(noise + 4.0 * np.roll(slow, 3), slow).inside)
    assert np.mean(inside) == pytest.approx(0.99, abs=0.01)
    assert autocorrelation(slow).inside < 0.2
    # An input that acts three samples late sticks out at that lag.
    test = crosscorrelation(noise + 4.0 * np.roll(slow, 3), slow)
    assert test.lags[np.argmax(np.abs(test.values))] == 3
    assert max(mixed) < 1.0


def test_a_lag_is_undone_with_the_noise_it_says() -> None:
    t = STEP * np.arange(3000)
    force = np.where((t > 0.5) & (t < 1.4), 3.0, -1.0)[:, None]
    y = lagged(t, force, 200.0)
    np.testing.assert_allclose(unlagged(t, y, 200.0, 0.0).force, force[:-1], atol=1e-11)
    noisy = 0.01 * np.rint((y + 0.02 * np.random.default_rng(0).standard_normal(y.shape)) / 0.01)
    found = unlagged(t, noisy, 200.0, 0.02, 0.01)
    within = np.mean(np.abs(found.force - force[:-1]) < 2.0 * found.std)
    assert within == pytest.approx(0.954, abs=0.015)


@pytest.mark.parametrize("seed", range(6))
def test_a_force_without_its_lag_scatters_as_it_says(seed: int) -> None:
    """Of 20000 readings of noise alone, at rates and times between samples at random: 1 % is two deviations."""
    rng = np.random.default_rng(seed)
    rate, noise = rng.uniform(20.0, 2000.0), rng.uniform(0.01, 1.0)
    quantum = rng.uniform(0.1, 1.0) * noise
    t = np.cumsum(np.tile(rng.uniform(0.5e-3, 2e-3, 2), 10000))
    y = quantum * np.rint(noise * rng.normal(size=(len(t), 1)) / quantum)
    found = unlagged(t, y, rate, noise, quantum)
    for part in (slice(0, None, 2), slice(1, None, 2)):  # the two times between samples
        assert found.std[part].std() <= 1e-9 * found.std[part].mean()
        assert found.force[part].std() == pytest.approx(found.std[part, 0][0], rel=0.03)


def test_sensors_delay_and_round() -> None:
    t = STEP * np.arange(500)
    x, xd = np.sin(5.0 * t)[:, None], 5.0 * np.cos(5.0 * t)[:, None]
    late = Sensor(delay=4e-4).read(t, x, xd)
    np.testing.assert_allclose(late[10:, 0], np.sin(5.0 * (t[10:] - 4e-4)), atol=1e-11)
    rounded = Sensor(quantum=1e-3).read(t, x)
    assert np.abs(rounded - x).max() <= 0.5e-3 * (1 + 1e-9)
    slow = Sensor(rate=50.0).read(t, x, xd)
    exact = lagged(np.linspace(t[0], t[-1], 499 * 50 + 1), np.sin(5.0 * np.linspace(t[0], t[-1], 499 * 50 + 1)), 50.0)
    np.testing.assert_allclose(slow[:, 0], exact[::50], atol=1e-4)
    with pytest.raises(InvalidValue, match="rate is -1"):
        Sensor(rate=-1.0)


@pytest.mark.parametrize("seed", range(6))
def test_a_late_sensor_shows_what_was_true_and_before_that_the_start(seed: int) -> None:
    """Held or cubic between samples of any distance; rounded to its counts, or following by its lag."""
    random = np.random.default_rng(seed)
    t = random.uniform(-3.0, 3.0) + np.cumsum(random.uniform(0.5, 1.5, 60)) * 0.01
    lines = [np.polynomial.Polynomial(c, domain=[t[0], t[-1]]) for c in random.normal(size=(2, 4))]
    x, xd = (np.column_stack([line(t) for line in each]) for each in (lines, [line.deriv() for line in lines]))
    delay, quantum, ks = random.uniform(0.005, 0.1), random.uniform(0.01, 0.2), random.uniform(20.0, 200.0)
    then = np.maximum(t - delay, t[0])
    last = [max(i for i in range(len(t)) if t[i] <= at) for at in then]
    np.testing.assert_array_equal(Sensor(delay=delay).read(t, x), x[last])
    smooth = Sensor(delay=delay).read(t, x, xd)
    np.testing.assert_allclose(smooth, np.column_stack([line(then) for line in lines]), atol=1e-10)
    rounded = Sensor(delay=delay, quantum=quantum).read(t, x, xd)
    np.testing.assert_allclose(rounded / quantum, np.round(smooth / quantum), atol=1e-9)
    for rate in (None, xd):
        fine = np.concatenate([np.linspace(a, b, 200, endpoint=False) for a, b in pairwise(t)])
        k = np.searchsorted(t, fine, side="right") - 1
        share = 0.0 if rate is None else ((fine - t[k]) / (t[k + 1] - t[k]))[:, None]
        felt_, y = x[k] + share * (x[k + 1] - x[k]), [x[0]]
        for step, now in zip(np.diff(np.append(fine, t[-1])), felt_, strict=True):
            y.append(y[-1] + (1.0 - np.exp(-ks * step)) * (now - y[-1]))
        np.testing.assert_allclose(Sensor(rate=ks).read(t, x, rate), y[::200], atol=1e-3)


def test_polynomials_give_rates_and_say_how_noisy_they_are() -> None:
    random = np.random.default_rng(5)
    t = np.sort(STEP * (np.arange(400) + 0.1 * random.standard_normal(400)))
    y = np.column_stack([t**3, 2.0 * t])
    value, rate, acceleration, gain = derivatives(t, y)
    np.testing.assert_allclose(value, y, atol=1e-12)
    np.testing.assert_allclose(rate[:, 0], 3.0 * t**2, atol=1e-9)
    np.testing.assert_allclose(acceleration[:, 0], 6.0 * t, atol=1e-6)
    draws = [derivatives(t, random.standard_normal((400, 1)), rows=np.array([3, 200]))[1:3] for _ in range(600)]
    spread = np.std(np.array(draws)[..., 0], axis=0)
    np.testing.assert_allclose(spread, gain[[3, 200], 1:].T, rtol=0.12)


def test_a_held_acceleration_is_felt_as_the_polynomials_show_it() -> None:
    random = np.random.default_rng(6)
    t = STEP * np.arange(200)
    a, delay = random.standard_normal((200, 1)), 0.5 * STEP
    v = np.concatenate(([[0.0]], np.cumsum(a[:-1] * STEP, axis=0)))
    y = np.concatenate(([[0.0]], np.cumsum(v[:-1] * STEP + 0.5 * a[:-1] * STEP**2, axis=0)))
    i = np.arange(1, 200)
    late = y.copy()  # half a sample before each time, by the acceleration that held then
    late[i] = y[i - 1] + 0.5 * STEP * v[i - 1] + 0.125 * STEP**2 * a[i - 1]
    rows = np.arange(40, 150)
    for seen, d in ((y, 0.0), (late, delay)):
        np.testing.assert_allclose(derivatives(t, seen, rows=rows)[2], felt(t, a, d, 25, 3, rows), atol=1e-8)


@pytest.mark.parametrize("seed", range(20))
def test_impacts_belong_together_up_to_a_twentieth_of_a_second(seed: int) -> None:
    """Half a second from one to the next; each is off by a drawn time, those beyond .05 s are not the same impact."""
    rng = np.random.default_rng(seed)
    t, jump = 0.5 * np.arange(1, 13), rng.uniform(0.5, 2.0, 12)
    late, harder = rng.uniform(0.01, 0.05, 12) * rng.choice([-4.0, -1.1, -0.9, 0.9, 1.1, 4.0], 12), rng.normal(size=12)
    offsets, jumps = matched(Impacts(t=t, jump=jump), Impacts(t=t + late, jump=jump + harder))
    same = np.abs(late) <= 0.05
    np.testing.assert_allclose(offsets, late[same], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(jumps, harder[same], rtol=0.0, atol=1e-12)


def test_impacts_are_found_matched_and_measured() -> None:
    t = np.arange(0.0, 2.0, 1 / 500)

    def bouncing(first):
        y, v, at = np.empty(len(t)), 0.0, 0.0
        edges, speeds = [first, first + 0.6], [2.0, 1.2]
        for k, s in enumerate(t):
            n = sum(s > e for e in edges)
            at, v = (edges[n - 1], speeds[n - 1]) if n else (0.0, 0.0)
            y[k] = (0.5 * 9.81 * first**2 if n == 0 else 0.0) + v * (s - at) - 0.5 * 9.81 * (s - at) ** 2
            y[k] = max(y[k], 0.0) if n else y[k]
        return y

    one, other = (impacts(t, bouncing(first), least_of(t, bouncing(0.4))) for first in (0.4, 0.406))
    assert len(one.t) >= 2
    assert one.t[0] == pytest.approx(0.4, abs=2e-3)
    assert one.jump[0] == pytest.approx(2.0 + 9.81 * 0.4, abs=0.1)
    offsets, _ = matched(one, other)
    assert offsets[:2] == pytest.approx([0.006, 0.006], abs=2e-3)


@pytest.mark.parametrize("seed", range(5))
def test_the_instant_and_the_jump_of_an_impact_are_known_between_samples(seed: int) -> None:
    random = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, 101)
    when, jumps = np.array([0.2, 0.5, 0.8]) + random.uniform(0.0, 0.05, 3), random.uniform(1.0, 3.0, 3)
    y = 0.4 - t + sum(jump * np.maximum(t - at, 0.0) for at, jump in zip(when, jumps, strict=True))
    found = impacts(t, y, least=1e-3)
    np.testing.assert_allclose(found.t, when, atol=1e-12)
    np.testing.assert_allclose(found.jump, jumps, atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_means_of_held_inputs_are_those_of_any_instants(seed: int) -> None:
    """From each to the next, the last as long as the one before; beyond its own times an input holds."""
    random = np.random.default_rng(seed)
    times = random.uniform(-1.0, 1.0) + np.cumsum(random.uniform(0.01, 0.1, 30))
    held = random.normal(size=(30, 2))
    t = np.sort(random.uniform(times[0] - 0.1, times[-1] + 0.1, 12))
    found = tracked._means(times, held, t)
    for i, (a, b) in enumerate(pairwise([*t, 2.0 * t[-1] - t[-2]])):
        cuts = np.unique([a, b, *times[(times > a) & (times < b)]])
        now = [held[max(int(np.sum(times <= at)) - 1, 0)] for at in cuts[:-1]]
        np.testing.assert_allclose(found[i], np.diff(cuts) @ np.array(now) / (b - a), atol=1e-12)


@pytest.mark.parametrize("pull", [-9.81, 0.0, 4.0])
@pytest.mark.parametrize("seed", range(4))
def test_what_no_noise_and_no_weight_is_an_impact(seed: int, pull: float) -> None:
    """Six deviations of the second differences, whose variance is six times that of a sample; or a part of the blow."""
    random, t = np.random.default_rng(seed), STEP * np.arange(2000)
    noise = 10.0 ** random.uniform(-8.0, -5.0)
    y = 0.5 * pull * t**2 + noise * random.normal(size=len(t))
    clear = 6.0 * np.sqrt(6.0) * noise / STEP**2
    assert least_of(t, y) == pytest.approx(max(clear, 0.25 * pull), rel=0.1)
    hit = 100.0 * clear
    assert least_of(t, y + hit * STEP * np.maximum(t - t[900], 0.0)) == pytest.approx(0.25 * (hit + pull), rel=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_correlations_at_lags_are_those_of_the_samples_that_both_have_there(seed: int) -> None:
    """Of windows whose size changes along them, counted sample by sample."""
    random = np.random.default_rng(seed)
    lengths, most = random.integers(9, 30, 3), 5
    a, b = ([random.standard_normal(n) * np.exp(3.0 * np.arange(n) / n) for n in lengths] for _ in range(2))
    lags, rho = _measures._lagged(a, b, most)
    for lag, found in zip(lags, rho, strict=True):
        pairs = [(x[i + lag], y[i]) for x, y in zip(a, b, strict=True) for i in range(len(y)) if 0 <= i + lag < len(x)]
        x, y = np.array(pairs).T
        assert found == pytest.approx(x @ y / np.sqrt((x @ x) * (y @ y)), abs=1e-12)


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.02])
def test_what_moves_is_told_from_its_noise_where_residuals_are_averaged(noise: float) -> None:
    """A period of 200 samples is one whatever noise its differences have."""
    draw = np.random.default_rng(5)
    y = np.sin(2.0 * np.pi * np.arange(200_000) / 200.0) + noise * draw.standard_normal(200_000)
    assert stride_of(y, noise) == pytest.approx(200.0 / OVERSAMPLED, abs=1.0, rel=0.05)
