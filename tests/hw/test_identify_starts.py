"""Windows that restart: intervals hold with the default starts, and measured ones that are wrong are found out."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from rig_data import channels, log_of
from scipy import signal
from scipy.integrate import solve_ivp

from crossbody import hw
from crossbody.cases import InvalidValue
from crossbody.hw import models
from crossbody.hw.fitting import search
from crossbody.hw.fitting.derivative import Exact
from crossbody.hw.fitting.doubts import moves
from crossbody.hw.windows.window import windows

NOISE = 1e-3
STEP = 5e-3


def truth() -> dict[str, float]:
    """Inertia and friction for which th'' = 58 sin th - 0.2 th'."""
    p = {name: one.default for name, one in models.load("single_pendulum").parameters.items()}
    weight = float(p["m1"]) * float(p["gravity"]) * float(p["a1"])
    return {"I1": weight / 58.0 - float(p["m1"]) * float(p["a1"]) ** 2, "k1": 0.2 * weight / 58.0}


def swing(seed: int, rho: float = 0.0, seconds: float = 8.0) -> hw.Log:
    """A swing of the pendulum with noise of the lag-1 correlation rho."""
    t = np.arange(0.0, seconds, STEP)
    motion = solve_ivp(
        lambda _, y: [y[1], 58.0 * np.sin(y[0]) - 0.2 * y[1]], (0.0, t[-1]), [2.5, 0.0], t_eval=t, rtol=1e-11,
        atol=1e-12,
    ).y[0]  # fmt: skip
    white = np.random.default_rng(seed).standard_normal(len(t) + 200)
    noise = NOISE * signal.lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], white)[200:]
    return log_of(t, channels("coordinates", "rad", {"th1": motion + noise}))


def fitted(log: hw.Log, restart: float = 2.0, **more: object) -> hw.Fit:
    true = truth()
    start = {"I1": 1.02 * true["I1"], "k1": 1.1 * true["k1"]}
    return hw.identify(log, "single_pendulum", list(true), restart=restart, parameters=start, **more)  # type: ignore[arg-type]


@pytest.mark.slow
def test_default_intervals_are_not_biased_by_the_noise_of_starts() -> None:
    found = [fitted(swing(seed)) for seed in range(5)]
    for name, value in truth().items():
        z = np.array([(fit[name].value - value) / fit[name].std for fit in found])
        assert abs(z.mean()) < 2.5 / np.sqrt(len(z))  # of a mean of unit normals: 1 in 80
        assert np.abs(z).max() < 4.0
    assert all(e.identifiable for fit in found for e in fit.estimates)
    assert not any("start from measured states" in warning for fit in found for warning in fit.warnings)


def test_measured_starts_that_are_wrong_are_found_out() -> None:
    fit = fitted(swing(0), starts="measured")
    assert not fit["I1"].identifiable
    assert any("I1 is not identifiable: its interval" in warning for warning in fit.warnings)
    assert any("whose noise the intervals do not include" in warning for warning in fit.warnings)


@pytest.mark.parametrize("starts", ["measured", "free"])
def test_halves_of_a_log_are_told_as_what_each_is(starts: str) -> None:
    """The friction of the joint grows by a quarter amid the log: the first half has less of it."""
    t, drag = np.arange(0.0, 16.0, STEP), 0.2 * np.array([0.9, 1.15])
    y, found = np.array([2.5, 0.0]), []
    for part, k in zip(np.split(t, [len(t) // 2]), drag, strict=True):
        ends = (part[0], part[-1] + STEP)
        ran = solve_ivp(
            lambda _, y, k=k: [y[1], 58.0 * np.sin(y[0]) - k * y[1]], ends, y, t_eval=[*part, ends[1]], rtol=1e-11,
            atol=1e-12,
        )  # fmt: skip
        y = ran.y[:, -1]
        found.append(ran.y[0, :-1])
    motion = np.concatenate(found) + NOISE * np.random.default_rng(1).standard_normal(len(t))
    log = log_of(t, channels("coordinates", "rad", {"th1": motion}))
    fit = hw.identify(log, "single_pendulum", ["k1"], restart=1.0, parameters=truth(), starts=starts)
    (half,) = fit.agreement
    per_rate = truth()["k1"] / 0.2
    np.testing.assert_allclose(half.values, drag * per_rate, rtol=0.05)
    assert not half.agrees


def test_a_step_from_measured_starts_is_one_of_all_unknowns() -> None:
    """The Schur complement of every window leaves the step of the parameters that the whole problem makes."""
    model = models.load("single_pendulum")
    numbers = model.numbers(truth())
    cut = windows(swing(0), model, 2.0)
    measured, joint = (Exact(model, numbers, ("I1", "k1"), cut, free, 3) for free in (False, True))
    z = joint.first()
    J = joint.jacobian(z)
    size = np.linalg.norm(J, axis=0)
    step = -np.linalg.lstsq(J / size, joint.residual(z), rcond=None)[0] / size  # J is that of residuals
    found = moves(measured, z[:2], np.abs(z[:2]), ())
    np.testing.assert_allclose([found[i].by for i in range(2)], step[:2], rtol=1e-6)
    assert set(moves(measured, z[:2], np.abs(z[:2]), (0,))) == {1}


def test_free_starts_are_refused_where_derivatives_are_not_exact() -> None:
    with pytest.raises(InvalidValue, match="starts"):
        fitted(swing(0, seconds=4.0), starts="free", engine="reference")


@pytest.mark.slow
@pytest.mark.parametrize(("rho", "least", "most"), [(0.0, 0.93, 0.97), (0.95, 0.90, 0.98)])
def test_default_intervals_hold_where_windows_restart(rho: float, least: float, most: float) -> None:
    """Coverage over draws and both parameters lies in its band but for the scatter of the count itself."""
    draws, true = 60, truth()
    found = [fitted(swing(seed, rho)) for seed in range(draws)]
    held = np.array([[fit[name].low <= value <= fit[name].high for name, value in true.items()] for fit in found])
    inside = held.mean()
    print(f"lag-1 correlation {rho:g}: of {draws} intervals of {', '.join(true)} {held.sum(axis=0)} hold")
    scatter = 2.0 * np.sqrt(0.95 * 0.05 / (2 * draws))
    assert least - scatter <= inside <= most + scatter


@pytest.mark.parametrize("runs", [0, 30])
def test_an_identification_stops_at_its_time_limit_with_what_it_reached(
    runs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = itertools.count()  # a clock that every look moves by a second
    monkeypatch.setattr(search, "time", SimpleNamespace(monotonic=lambda: float(next(now))))
    fit = fitted(swing(0), time_limit=runs + 0.5)
    assert (fit.outcome, fit.success) == ("stopped", False)
    assert f"Stopped at the time limit of {runs + 0.5:g} s" in fit.message
    assert fit.warnings[0].startswith(fit.message)
    for e in fit.estimates:
        assert (e.low, e.high, e.identifiable) == (-np.inf, np.inf, False)
        assert e.bounds[0] <= e.value <= e.bounds[1]
        assert fit.parameters[e.name] == e.value
    assert all(e.value == e.start for e in fit.estimates) == (runs == 0)


def test_a_limit_that_is_not_reached_changes_nothing() -> None:
    free, limited = (fitted(swing(0, seconds=6.0), time_limit=limit) for limit in (np.inf, 1e6))
    assert limited.outcome == "converged"
    assert [(e.value, e.low, e.high) for e in free.estimates] == [(e.value, e.low, e.high) for e in limited.estimates]
    with pytest.raises(InvalidValue, match="time_limit"):
        fitted(swing(0), time_limit=0.0)
