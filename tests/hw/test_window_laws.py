"""Windows of logs that lack samples, beside what counting row by row makes of the same log."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from rig_data import channels, log_of

from crossbody import hw
from crossbody.cases import SceneError
from crossbody.hw.replaying.replay import _shortened
from crossbody.hw.windows import rates
from crossbody.hw.windows.rates import derivatives, rates_by_fit
from crossbody.hw.windows.turns import advanced, deviation, difference, increments, way
from crossbody.hw.windows.whiteness import autocorrelation, crosscorrelation
from crossbody.hw.windows.window import FEWEST, overlap, recorded_inputs, windows

STEP = 0.01


def recorded(random: np.random.Generator) -> hw.Log:
    """A double pendulum with rates, torques and lost samples; every value is another."""
    t = random.uniform(-5.0, 5.0) + STEP * np.append(0, 1 + np.flatnonzero(random.random(900) < 0.95))
    names, motors = ("th1", "th2"), ("torque 1", "torque 2")
    given = {name: random.normal(size=(4, len(t))) for name in ("q", "v", "u")}
    return log_of(
        t,
        channels("coordinates", "rad", dict(zip(names, given["q"], strict=False))),
        channels("velocities", "rad/s", dict(zip(names, given["v"], strict=False))),
        channels("inputs", "N m", dict(zip(motors, given["u"], strict=False))),
    )


@pytest.mark.parametrize("seed", range(12))
def test_windows_hold_the_rows_from_each_restart_to_its_horizon(seed: int) -> None:
    """Starts count from the first sample; a window ends with the first sample that is a horizon later."""
    random = np.random.default_rng(seed)
    log, model = recorded(random), hw.models.load("double_pendulum")
    q, v, u = (log.matrix(role) for role in ("coordinates", "velocities", "inputs"))
    restart, more = float(random.uniform(0.2, 2.0)), float(random.choice([1.0, 0.6, 2.5]))
    length, t = restart * more, log.time
    cut = windows(log, model, restart=restart, horizon=length)
    wanted, k = [], 0
    while t[0] + k * restart + length <= t[-1]:
        begin, end = (
            next(i for i in range(len(t)) if t[i] >= t[0] + x - 1e-9) for x in (k * restart, k * restart + length)
        )
        wanted.append((begin, end))
        k += 1
    assert [(w.t[0], w.t[-1]) for w in cut] == [(t[a], t[b]) for a, b in wanted]
    for window, (a, b) in zip(cut, wanted, strict=True):
        np.testing.assert_array_equal(window.t, t[a : b + 1])
        np.testing.assert_array_equal(window.y, q[a : b + 1])
        np.testing.assert_array_equal(window.u, u[a : b + 1])
        np.testing.assert_array_equal(window.age, np.column_stack([t[a : b + 1] - t[a]] * 2))
        np.testing.assert_array_equal(window.log.time, t[a : b + 1])
        np.testing.assert_array_equal((window.segment.y, window.segment.yd), (q[a], v[a]))
        np.testing.assert_array_equal(window.segment.times, t[a:b] - t[a])
        np.testing.assert_array_equal(window.segment.inputs, u[a:b])
        assert window.segment.t_end == t[b] - t[a]
    shared = [sum(one.t[0] < other.t[0] < one.t[-1] for other in cut) for one in cut]
    assert overlap(cut) == max(shared)
    assert overlap([*cut, *cut]) == max(shared)


@pytest.mark.parametrize("seed", range(12))
def test_a_shortened_window_is_that_of_a_log_that_ends_there(seed: int) -> None:
    """With inputs and without."""
    random = np.random.default_rng(seed)
    log, model = recorded(random), hw.models.load("double_pendulum")
    if seed % 3 == 0:
        log = replace(log, channels=tuple(one for one in log.channels if one.role != "inputs"))
    (whole,) = windows(log, model, restart=0.0)
    count = int(random.integers(FEWEST + 1, len(log)))
    (wanted,) = windows(log.window(log.time[0], log.time[count]), model, restart=0.0)
    found = _shortened(whole, count)
    for name in ("t", "age", "y", "u"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))
    for name in ("y", "yd", "t_end", "times", "inputs"):
        np.testing.assert_array_equal(getattr(found.segment, name), getattr(wanted.segment, name))


def test_a_window_has_eight_samples_and_lies_inside_the_log() -> None:
    log, model = recorded(np.random.default_rng(0)), hw.models.load("double_pendulum")
    (whole,) = windows(log, model, restart=0.0)
    assert (whole.t[0], whole.t[-1], len(whole.t)) == (log.time[0], log.time[-1], len(log))
    steady = log_of(
        0.5 + STEP * np.arange(100),
        channels("coordinates", "rad", {name: np.zeros(100) for name in ("th1", "th2")}),
        channels("velocities", "rad/s", {name: np.zeros(100) for name in ("th1", "th2")}),
    )
    assert len(windows(steady, model, restart=FEWEST * STEP)) == 99 // FEWEST
    assert len(windows(steady, model, restart=99 * STEP)) == 1
    for length in ((FEWEST - 1) * STEP, 100 * STEP):
        with pytest.raises(SceneError, match="no window"):
            windows(steady, model, restart=length)


@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize("half", [3, 8])
def test_polynomials_are_their_own_value_rate_and_acceleration(half: int, degree: int) -> None:
    """At the ends too, whatever the times; noise goes into each as the pseudo-inverse of the powers says."""
    random = np.random.default_rng([half, degree])
    t = np.cumsum(random.uniform(0.5, 2.0, 60)) * STEP
    line = np.polynomial.Polynomial(random.normal(size=degree + 1), domain=[t[0], t[-1]])
    value, rate, acceleration, gain = derivatives(t, line(t)[:, None], half, degree)
    for found, wanted in ((value, line), (rate, line.deriv()), (acceleration, line.deriv(2))):
        np.testing.assert_allclose(found[:, 0], wanted(t), rtol=1e-6, atol=1e-6 * np.abs(wanted(t)).max())
    for row in (0, 1, half, 30, 59):
        begin = min(max(row - half, 0), 60 - 2 * half - 1)
        near = t[begin : begin + 2 * half + 1] - t[row]
        weights = np.linalg.pinv(np.vander(near / STEP, degree + 1, increasing=True))
        sizes = np.linalg.norm(weights, axis=1)
        assert gain[row] == pytest.approx([sizes[0], sizes[1] / STEP, 2.0 * sizes[2] / STEP**2], rel=1e-6)


@pytest.mark.parametrize(("width", "degree"), rates.WIDTHS)
def test_noise_alone_refuses_a_stretch_as_often_as_is_said(
    width: int, degree: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a polynomial leaves of it has as many degrees of freedom as samples, less its coefficients."""
    monkeypatch.setattr(rates, "LEVEL", 0.2)
    monkeypatch.setattr(rates, "WORST", np.inf)
    t, rows = STEP * np.arange(4000 * width), width * np.arange(4000)
    noise = 0.3 * np.random.default_rng(width).normal(size=(len(t), 1))
    off = rates._fitted(t, noise, rows, width, degree, 0, np.array([0.3]))[1]
    assert np.mean(off > 1.0) == pytest.approx(0.2, abs=0.026)  # four standard deviations


@pytest.mark.parametrize("seed", range(8))
def test_an_admitted_error_widens_a_band_in_units_of_the_residual(seed: int) -> None:
    """By its part of what is left of the residual, whatever the unit of the input; of itself by the square of that."""
    random = np.random.default_rng(seed)
    u = random.normal(size=500)
    residual, floor = 0.3 * u + random.normal(size=500), float(random.uniform(0.1, 0.5))
    unit, other = 10.0 ** random.uniform(-3.0, 3.0, 2)
    for found, power in ((lambda r, u, f: crosscorrelation(r, u, 8, floor=f), 1),
                         (lambda r, u, f: autocorrelation(r, 8, floor=f), 2)):  # fmt: skip
        plain, wide, twice = (found(residual, u, f).band for f in (0.0, floor, 2.0 * floor))
        assert wide - plain == pytest.approx((floor / residual.std()) ** power, rel=0.1)
        assert twice - plain == pytest.approx(2.0**power * (wide - plain), rel=1e-9)
        assert found(unit * residual, other * u, unit * floor).band == pytest.approx(wide, rel=1e-6)


def turned(vector: np.ndarray) -> np.ndarray:
    """The matrix of a rotation vector, by Rodrigues."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across


def about(turn: np.ndarray) -> np.ndarray:
    """The rotation vector of a matrix that is neither no turn nor half a turn."""
    angle = np.arccos(0.5 * (np.trace(turn) - 1.0))
    skew = angle / (2.0 * np.sin(angle)) * (turn - turn.T)
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])


@pytest.mark.parametrize("seed", range(8))
def test_turns_among_other_coordinates_are_those_of_rotation_matrices(seed: int) -> None:
    """One or two turns anywhere; the other columns subtract."""
    random = np.random.default_rng(seed)
    at = ((0,), (1,), (2,), (0, 3), (1, 4), (0, 4), (2, 6), (5,))[seed]
    first, other = random.normal(scale=0.7, size=(2, 6, 9))
    delay = random.uniform(0.1, 1.0, 9)
    off, spread, steps, ways, later = (
        first - other, first.copy(), np.diff(first, axis=0), first.copy(), first[0] + other[0] * delay,
    )  # fmt: skip
    for i in at:
        part = slice(i, i + 3)
        R, S = ([turned(row[part]) for row in rows] for rows in (first, other))
        u, _, vt = np.linalg.svd(sum(R))  # the nearest rotation to all is their mean
        mean = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        off[:, part] = [about(r @ s.T) for r, s in zip(R, S, strict=True)]
        spread[:, part] = [about(r @ mean.T) for r in R]
        steps[:, part] = [about(b @ a.T) for a, b in pairwise(R)]
        ways[:, part] = np.cumsum([np.zeros(3), *(about(a.T @ b) for a, b in pairwise(R))], axis=0)
        later[part] = about(R[0] @ turned(other[0, part] * delay[part]))
    for found, wanted in (
        (difference(first, other, at), off), (deviation(first, at), spread), (increments(first, at), steps),
        (way(first, at), ways), (advanced(first[0], other[0], delay, at), later),
    ):  # fmt: skip
        np.testing.assert_allclose(found, wanted, atol=1e-7)


def test_a_bend_that_no_single_sample_shows_is_not_smoothed_over() -> None:
    """Its rate jumps by 1.5 noises a sample: over 51 samples the squares tell it, and each is within three noises."""
    t, errors = np.arange(400.0), []
    bend, rows = 1.5 * np.maximum(t - 200.0, 0.0), np.array([196, 204])
    for seed in range(60):
        noise = np.random.default_rng(seed).standard_normal(400)
        errors.append(np.abs(rates_by_fit(t, (bend + noise)[:, None], rows)[:, 0] - [0.0, 1.5]))
    across = [np.polyval(np.polyder(np.polyfit(t[:51] - 25.0, bend[row - 25 : row + 26], 3)), 0.0) for row in rows]
    smoothed = np.abs(np.array(across) - [0.0, 1.5])
    assert np.all(np.mean(errors, axis=0) < 0.8 * smoothed)


@pytest.mark.parametrize("seed", range(8))
def test_correlations_are_sums_of_products_inside_windows(seed: int) -> None:
    """Of what is left of the mean of all; of an input, with the sign of its effect at the lag at which it acts."""
    random = np.random.default_rng(seed)
    pieces = [random.normal(loc=0.7, size=n) for n in (30, 41, 57)]
    lags, x = 6, [piece - np.mean(np.concatenate(pieces)) for piece in pieces]
    wanted = [sum(sum(p[i + k] * p[i] for i in range(len(p) - k)) for p in x) for k in range(lags + 1)]
    found = autocorrelation(pieces, lags)
    assert found.lags.tolist() == list(range(lags + 1))
    np.testing.assert_allclose(found.values, np.array(wanted) / wanted[0], atol=1e-12)
    assert found.band == pytest.approx(2.576 / np.sqrt(128.0), rel=1e-4)
    late, gain = int(random.integers(0, 5)), float(random.choice([-0.8, 0.8]))
    inputs = [random.normal(size=400) for _ in range(3)]
    felt = [gain * np.roll(u, late) + 0.6 * random.normal(size=400) for u in inputs]
    beside = crosscorrelation(felt, inputs, 8)
    assert beside.values[beside.lags == late] == pytest.approx(gain, abs=0.1)
    assert np.abs(beside.values[beside.lags != late]).max() < 0.2


@pytest.mark.parametrize("late", [0, 1, 7])
@pytest.mark.parametrize("part", [0.0, 0.4])
def test_an_input_is_in_force_from_when_it_was_true(late: int, part: float) -> None:
    """A value that is read some samples late was true so long before; between two samples the one before is."""
    random = np.random.default_rng(late)
    log, model = recorded(random), hw.models.load("double_pendulum")
    delay, u = (late + part) * STEP, log.matrix("inputs")
    log = replace(
        log, channels=tuple(replace(one, delay=delay) if one.role == "inputs" else one for one in log.channels)
    )  # fmt: skip
    t = log.time
    rows = [max([k for k in range(len(t)) if t[k] - delay <= now + 1e-6 * STEP], default=0) for now in t]
    np.testing.assert_array_equal(recorded_inputs(log, model), u[rows])
    assert late == 0 or (np.array(rows) > np.arange(len(t)))[: -late - 1].any()
