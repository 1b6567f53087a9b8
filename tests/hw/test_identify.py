"""Identification: exact derivatives, intervals that hold, what no data tell, windows that were not fitted."""

from __future__ import annotations

import numpy as np
import pytest
from rig_data import channels, log_of, needs_pendulum, pendulum, run_as_log

from crossbody import cases, engines, hw
from crossbody.cases import InvalidValue, UnknownName
from crossbody.hw import models
from crossbody.hw.fitting.derivative import SETTLED, Exact, apart
from crossbody.hw.models.contract import Segment
from crossbody.hw.windows.window import windows

TRUE = {"k1": 5e-4, "s1": 8e-4, "k2": 2e-4, "s2": 3e-4, "slip": 0.05}


def swing(noise: float, seed: int, seconds: float = 4.0, rates: float = 0.0, step: float = 2e-3) -> hw.Log:
    """A double pendulum with known friction; the reference at 1e-12 is the plant."""
    model = models.load("double_pendulum")
    segment = Segment(y=np.array([2.2, 2.6]), yd=np.array([0.5, -1.0]), t_end=seconds)
    case, t = model.build(model.numbers(TRUE), segment), np.arange(0.0, seconds, step)
    run = engines.load("reference").prepare(case, samples=t, rtol=1e-12).run()
    random = np.random.default_rng(seed)
    y = run.q[:, [2, 5]] + noise * random.standard_normal((len(t), 2))
    yd = run.v[:, [2, 5]] + rates * random.standard_normal((len(t), 2))
    names = ("th1", "th2")
    return log_of(
        t, channels("coordinates", "rad", dict(zip(names, y.T, strict=True))),
        channels("velocities", "rad/s", dict(zip(names, yd.T, strict=True))),
    )  # fmt: skip


FREE = ("k1", "s1", "k2", "s2", "a1", "I2", "L1", "gravity")


@pytest.mark.parametrize("low", [-np.inf, 0.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_column_that_is_off_is_found_by_differences_within_its_bounds(seed: int, low: float) -> None:
    """Those of second order are exact for a quadratic, central or forward; below its bound nothing is evaluated."""
    rng, step, asked = np.random.default_rng(seed), 1e-2, list[float]()
    x, A, B = np.append(rng.uniform(0.5, 1.0, 2), 1e-3), rng.normal(size=(7, 3)), rng.normal(size=(7, 3, 3))

    def residual(at: np.ndarray) -> np.ndarray:
        asked.append(float(at[2]))
        return A @ at + np.einsum("nij,i,j->n", B, at, at)

    J = A + np.einsum("nij,j->ni", B + B.swapaxes(1, 2), x)
    assert apart(residual, x, J, 2, step, low) < 1e-10
    assert apart(residual, x, 0.99 * J, 2, step, low) == pytest.approx(0.01 / 0.99, rel=1e-6)
    assert apart(residual, x, np.zeros_like(J), 2, step, low) == 1.0
    assert apart(lambda _: np.zeros(7), x, np.zeros_like(J), 2, step, low) == 0.0
    assert min(asked) >= low
    assert (min(asked) < 0.0) == np.isinf(low)


@pytest.mark.parametrize("starts", [False, True])
def test_derivatives_are_exact(starts: bool) -> None:
    model, log = models.load("double_pendulum"), swing(0.0, 0)
    problem = Exact(model, model.numbers(TRUE), (*FREE, "delay"), windows(log, model, 2.0), starts, 10)
    x = problem.first()
    J = problem.jacobian(x)
    assert J.shape == (len(problem.residual(x)), len(FREE) + 1 + (4 if starts else 0))
    sizes = np.where(x == 0.0, 1e-3, np.abs(x))
    assert problem.checked(x, J, sizes, np.full(len(x), -np.inf)) < 1e-5
    wrong = J.copy()
    wrong[:, 2] *= 1.001
    assert problem.checked(x, wrong, sizes, np.full(len(x), -np.inf)) > 5e-4


def test_the_fixed_steps_follow_the_integrator_of_the_reference() -> None:
    model, log = models.load("double_pendulum"), swing(0.0, 0)
    problem = Exact(model, model.numbers(TRUE), ("k1",), windows(log, model, 2.0), False, 10)
    assert np.abs(problem.residual(problem.first())).max() < 1e-5


@pytest.mark.parametrize("delay", [0.0, 5e-3])
def test_residuals_vanish_at_the_true_delay_and_starts_at_both_ends_of_every_window(delay: float) -> None:
    model, late, every = models.load("double_pendulum"), round(delay / 1e-3), swing(0.0, 0, step=1e-3)
    names = ("th1", "th2")
    y, yd = (
        np.stack([every.channel(role, name).values for name in names], axis=1) for role in ("coordinates", "velocities")
    )
    rows = np.arange(late, len(y) - late, 2)
    log = log_of(
        every.time[rows], channels("coordinates", "rad", dict(zip(names, y[rows - late].T, strict=True))),
        channels("velocities", "rad/s", dict(zip(names, yd[rows - late].T, strict=True))),
    )  # fmt: skip
    cut = windows(log, model, 1.0)
    begin = np.searchsorted(every.time, [window.t[0] for window in cut])
    problem = Exact(model, model.numbers(TRUE), ("delay",), cut, True, 7)
    x = np.concatenate([[delay], *(np.concatenate([y[k], yd[k]]) for k in begin)])
    assert np.abs(problem.residual(x)).max() < 1e-5
    if delay:
        x[0] = -delay
        assert np.abs(problem.residual(x)).max() > 1e-3
    for j, window in enumerate(cut):
        before = problem.residual_of(j, x)
        for end in (0, -1):
            window.y[end] += 1e-3
            assert np.abs(problem.residual_of(j, x) - before).max() == pytest.approx(1e-3, rel=1e-6)
            window.y[end] -= 1e-3


@pytest.mark.parametrize("step", [5e-3, 1e-2, 2e-2])
def test_integration_steps_are_as_many_as_every_coordinate_needs_and_no_more(step: float) -> None:
    """Twice as many change none by a millionth of its own size, half as many do."""
    model = models.load("double_pendulum")
    problem = Exact(model, model.numbers(TRUE), ("k1",), windows(swing(0.0, 0, step=step), model, 1.0), False, 1)
    runs, parts = [], problem.parts
    for problem.parts in (parts // 2, parts, 2 * parts):
        runs.append(problem._run(0, problem.first().astype(complex))[1].real if problem.parts else None)
    half, now, twice = runs
    assert np.all(np.abs(twice - now) <= SETTLED * np.abs(twice).max(axis=0))
    assert half is None or np.any(np.abs(now - half) > SETTLED * np.abs(now).max(axis=0))


@pytest.mark.slow
def test_friction_comes_out_inside_its_intervals() -> None:
    missed = white = 0
    for seed in range(4):
        fit = hw.identify(
            swing(1e-3, seed), "double_pendulum", list(FREE[:4]), restart=0.0, hold=0, stride=10, starts="free",
            parameters={"k1": 1e-4, "s1": 1e-4, "k2": 1e-4, "s2": 1e-4, "slip": TRUE["slip"]},
        )  # fmt: skip
        assert fit.success
        white += fit.covariance == "white residuals"
        assert not [warning for warning in fit.warnings if "halves" not in warning]
        missed += sum(not e.low <= TRUE[e.name] <= e.high for e in fit.estimates)
        assert all(e.std < 0.2 * e.value for e in fit.estimates)
    assert missed <= 3  # of 16, 0.8 expected
    assert white >= 3  # one of 20 tests of white residuals says no


@pytest.mark.slow
def test_what_the_motion_cannot_tell_is_said() -> None:
    """A free swing scales with all masses, inertias and friction: one of them must be kept."""
    free = ["m1", "m2", "I1", "I2", "k1", "k2", "s1", "s2"]
    fit = hw.identify(swing(1e-3, 0), "double_pendulum", free, restart=0.0, hold=0, stride=20, parameters=TRUE)
    assert not any(e.identifiable for e in fit.estimates if e.name in ("m1", "m2", "I1", "I2"))
    assert any("all multiplied by the same factor. Fix one" in warning for warning in fit.warnings)
    assert len(fit.kept) == 1
    assert fit.evaluations < 60  # the search does not wander along what nobody sees
    model = models.load("double_pendulum")
    true = model.numbers(TRUE)
    others = [e for e in fit.estimates if e.name not in fit.kept]
    assert all(np.isinf(e.low) for e in others)
    assert sum(e.kept_low <= true[e.name] <= e.kept_high for e in others) >= 5  # 6.7 of 7 expected
    kept = hw.identify(swing(1e-3, 0), "double_pendulum", free[1:], restart=0.0, hold=0, stride=20, parameters=TRUE)
    assert kept["m2"].identifiable
    assert not any("combination" in warning for warning in kept.warnings)


def test_two_frictions_that_act_alike_are_not_identifiable() -> None:
    """Dry friction smoothed over far more than any rate is viscous: k1 + s1/slip is all that a swing tells."""
    fit = hw.identify(
        swing(1e-3, 0, seconds=2.0), "double_pendulum", ["k1", "s1"], restart=0.0, hold=0, stride=20,
        parameters=TRUE | {"slip": 3e3, "s1": 1.0},
    )  # fmt: skip
    assert not any(e.identifiable for e in fit.estimates)
    assert any("k1" in words and "s1" in words for words in fit.unseen)
    assert any("Fix one of them" in warning for warning in fit.warnings)


def test_a_stiffness_is_found_where_contacts_open() -> None:
    case = cases.load("bouncing_ball", variant="linear", t_end=1.5)
    log = run_as_log(case, {"height": 0}, 1e-4)
    known = {name: case.parameters[name] for name in ("a0", "a1", "a2")}
    fit = hw.identify(log, "ball", ["a1"], parameters=known | {"a1": 15.0}, hold=0)
    assert fit["a1"].value == pytest.approx(20.0, abs=0.1)
    assert "central differences" in fit.sensitivities
    found = hw.replay(log, "ball", wanted=("reference", "mujoco", "pinocchio"), parameters=known)
    for prediction in found.predictions:
        assert np.sqrt(np.mean(found.residual(prediction) ** 2)) < 1.2e-4
    clear = hw.replay(run_as_log(case, {"height": 0}, 1e-7), "ball", parameters=known)
    rows = {(r.engine, r.metric): r.value for r in clear.rows()}
    assert rows["reference", "impacts_too_many"] == 0.0
    assert abs(rows["reference", "impact_offset_largest"]) < 1e-3
    assert abs(rows["reference", "impulse_error"]) < 0.01 * rows["reference", "impulse_measured"]


def test_a_damping_is_found_from_positions_alone() -> None:
    """Windows of .25 s start beside bounces, where a polynomial across one gives a rate that is .25 m/s off."""
    case = cases.load("bouncing_ball", variant="linear", t_end=1.5, a1=71.0)
    log = run_as_log(case, {"height": 0}, 1e-4)
    heights = log_of(log.time, tuple(c for c in log.channels if c.role == "coordinates"))
    starts = windows(heights, models.load("ball"), 0.25)
    rates = log.matrix("velocities")[np.searchsorted(log.time, [w.t[0] for w in starts]), 0]
    assert np.abs([w.segment.yd[0] for w in starts] - rates).max() < 0.02
    known = {name: case.parameters[name] for name in ("a0", "a1", "a2")}
    fit = hw.identify(heights, "ball", ["a1"], parameters=known | {"a1": 60.0}, restart=0.25, hold=0)
    assert fit["a1"].value == pytest.approx(71.0, abs=0.5)
    assert fit["a1"].low <= 71.0 <= fit["a1"].high
    assert fit["a1"].identifiable
    assert not any("a1 is not identifiable" in warning for warning in fit.warnings)


def test_windows_that_were_held_out_start_from_what_was_measured() -> None:
    """Their error is that of a replay from the measured starts: none was fitted to the samples that it is judged by."""
    case = cases.load("bouncing_ball", variant="linear", t_end=1.5)
    log = run_as_log(case, {"height": 0}, 1e-4)
    known = {name: case.parameters[name] for name in ("a0", "a1", "a2")}
    fit = hw.identify(log, "ball", ["a1"], parameters=known | {"a1": 15.0}, restart=0.25, hold=2)
    found = hw.replay(log, "ball", parameters=fit.parameters, restart=0.25)
    held = [found.windows[i].y - found.predictions[0].y[i] for i in fit.held]
    assert len(held) == len(fit.held) == 2
    assert fit.after["rmse"][1] == pytest.approx(np.sqrt(np.mean(np.concatenate(held) ** 2)), rel=1e-9)
    for i in fit.held:
        row = np.searchsorted(log.time, found.windows[i].t[0])
        assert found.windows[i].segment.y == log.matrix("coordinates", ["height"])[row]


def test_a_maze_is_replayed_from_where_its_ball_was_seen() -> None:
    log = run_as_log(cases.load("ball_maze", variant="free", t_end=1.5), {"theta": 0, "x": 1, "y": 2}, 1e-6)
    found = hw.replay(log, "maze")
    assert np.abs(found.residual(found.predictions[0])).max() < 1e-5


def test_wrong_use_is_one_sentence() -> None:
    log = swing(0.0, 0, seconds=2.5)
    for free, more, error, words in (
        (["mass"], {}, UnknownName, "no parameter 'mass' of double_pendulum"),
        ([], {}, InvalidValue, "at least one"),
        (["k1", "k1"], {}, InvalidValue, "none twice"),
        (["k1"], {"hold": 1}, InvalidValue, "hold is"),
        (["k1"], {"bounds": {"k1": (1.0, 0.0)}}, InvalidValue, "Bounds of k1"),
        (["k1"], {"starts": "guessed"}, InvalidValue, "starts is"),
    ):
        with pytest.raises(error, match=words):
            hw.identify(log, "double_pendulum", free, **more)


def after(log: hw.Log, model: str, fit: hw.Fit | None, restart: float, horizon: float, held: bool) -> np.ndarray:
    """Errors at the end of the windows that were held out of a fit (or of all), s."""
    found = hw.replay(log, model, parameters=fit.parameters if fit else None, restart=restart, horizon=horizon)
    errors = found.after(found.predictions[0], horizon)
    return errors[1::2] if held else errors


@pytest.mark.slow
@needs_pendulum
def test_identified_friction_of_the_double_pendulum_does_better_on_windows_not_fitted() -> None:
    log = pendulum("double")
    fit = hw.identify(log, "double_pendulum", ["k1", "k2", "s1", "s2"], restart=2.0, stride=20)
    assert fit.held == tuple(range(1, 34, 2))
    for horizon in (1.0, 2.0):
        published, own = (after(log, "double_pendulum", f, 2.0, horizon, True) for f in (None, fit))
        print(f"{horizon:g} s: median {np.median(published):.4f} -> {np.median(own):.4f} rad")
        assert np.median(own) < 0.75 * np.median(published)
    assert fit.after["end_median"][1] < 0.75 * fit.before["end_median"][1]
    assert fit["s1"].low > 0.0


@needs_pendulum
def test_identified_friction_of_the_single_pendulum_halves_the_published_error() -> None:
    log = pendulum("single")
    fit = hw.identify(
        log, "single_pendulum", ["k1", "s1"], restart=1.0, horizon=5.0, stride=50, starts="measured"
    )  # fmt: skip
    errors = after(log, "single_pendulum", fit, 1.0, 5.0, True)
    published = after(log, "single_pendulum", None, 1.0, 5.0, True)
    print(f"5 s: median {np.median(published):.4f} -> {np.median(errors):.4f} rad")
    assert np.median(errors) < 0.049
    assert np.median(errors) < 0.6 * np.median(published)
    assert any("s1 cannot be distinguished from its bound" in warning for warning in fit.warnings)
