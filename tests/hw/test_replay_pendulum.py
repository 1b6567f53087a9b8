"""Real swings replayed: the rows of the joints add nothing to what minimal coordinates give; three engines agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rig_data import channels, log_of, needs_pendulum, pendulum
from scipy.integrate import solve_ivp

from crossbody import engines, hw
from crossbody.cases import SceneError
from crossbody.hw.models.contract import Segment
from crossbody.hw.windows.window import windows


def minimal(p, th, w, times):
    """The double pendulum in its two angles, written from Lagrange's equations."""
    m1, m2, a1, a2, L1 = (p[k] for k in ("m1", "m2", "a1", "a2", "L1"))
    A, B, C = p["I1"] + m1 * a1**2 + m2 * L1**2, m2 * L1 * a2, p["I2"] + m2 * a2**2

    def brake(i, rate):
        return (p[f"k{i}"] + p[f"s{i}"] / np.hypot(rate, p["slip"])) * rate

    def rhs(_t, y):
        c, s = np.cos(y[0] - y[1]), np.sin(y[0] - y[1])
        outer = brake(2, y[3] - y[2])
        first = -B * s * y[3] ** 2 + (m1 * a1 + m2 * L1) * p["gravity"] * np.sin(y[0]) - brake(1, y[2]) + outer
        second = B * s * y[2] ** 2 + m2 * a2 * p["gravity"] * np.sin(y[1]) - outer
        return [y[2], y[3], *np.linalg.solve([[A, B * c], [B * c, C]], [first, second])]

    return solve_ivp(rhs, (0.0, times[-1]), [*th, *w], method="DOP853", rtol=1e-11, atol=1e-12, t_eval=times).y[:2].T


@pytest.mark.slow
@needs_pendulum
def test_joints_as_rows_add_nothing_to_minimal_coordinates() -> None:
    log = pendulum("double")
    found = hw.replay(log, "double_pendulum", settings={"rtol": 1e-10})
    assert len(found.windows) == 34
    apart, errors = [], []
    for window, yhat in zip(found.windows, found.predictions[0].y, strict=True):
        at = [0, 1000, 2000]
        exact = minimal(found.parameters, window.segment.y, window.segment.yd, window.t[at] - window.t[0])
        apart.append(np.abs(exact - yhat[at]).max())
        errors.append(np.abs(exact - window.y[at]).max(axis=1))
    assert max(apart) < 1e-6
    for k, age in ((1, 1.0), (2, 2.0)):
        own = found.after(found.predictions[0], age)
        np.testing.assert_allclose(own, [e[k] for e in errors], atol=1e-6)
    one, two = (found.after(found.predictions[0], age) for age in (1.0, 2.0))
    assert np.median(one) < 0.0065
    assert np.percentile(one, 90) < 0.0155
    assert np.median(two) < 0.0110
    assert np.percentile(two, 90) < 0.0230


@needs_pendulum
def test_engines_of_hinges_give_the_same_replay() -> None:
    log = pendulum("double").window(10.0, 16.5)
    found = hw.replay(log, "double_pendulum", wanted=("reference", "mujoco", "pinocchio"))
    reference, *others = found.predictions
    assert [p.engine for p in found.predictions] == ["reference", "mujoco", "pinocchio"]
    for other in others:
        for one, same in zip(reference.y, other.y, strict=True):
            assert np.abs(one - same).max() < 1e-5
        assert other.failed == 0


def test_a_chain_under_torques_with_dry_friction_is_the_same_in_all_engines() -> None:
    model = hw.models.load("double_pendulum")
    numbers = model.numbers({"s1": 1e-4, "s2": 3e-5, "slip": 0.1})
    segment = Segment(
        y=np.array([2.0, 1.0]), yd=np.array([1.0, -3.0]), t_end=1.0, times=np.array([0.0, 0.3, 0.6]),
        inputs=np.array([[0.01, 0.0], [0.0, 0.02], [0.0, 0.0]]),
    )  # fmt: skip
    case, times = model.build(numbers, segment), np.linspace(0.0, 1.0, 11)
    runs = [
        engines.load(name).prepare(case, **settings).run()
        for name, settings in (("reference", {"samples": times, "rtol": 1e-11}), ("mujoco", {}), ("pinocchio", {}))
    ]
    truth, *others = (model.see(model, run, times)[0] for run in runs)
    for other in others:
        assert np.abs(other - truth).max() < 1e-6
    work = runs[0].ledger if runs[0].ledger is not None else None
    assert work is not None
    balance = runs[0].total_energy - runs[0].total_energy[0] - (work.input - work.dissipated) - work.contact.sum(axis=1)
    assert np.abs(balance).max() < 1e-8


def test_a_log_without_what_the_model_needs_is_refused() -> None:
    t = np.linspace(0.0, 1.0, 101)
    log = log_of(t, channels("coordinates", "rad", {"th1": np.sin(t)}))
    with pytest.raises(ValueError, match="no coordinate th2"):
        hw.replay(log, "double_pendulum")
    with pytest.raises(ValueError, match="no window of 5 s"):
        hw.replay(log, "single_pendulum")
    with pytest.raises(ValueError, match="restart is -1"):
        hw.replay(log, "single_pendulum", restart=-1.0)
    with pytest.raises(ValueError, match="has no controller"):
        hw.replay(log, "single_pendulum", kind="closed_loop")
    with pytest.raises(hw_error(), match="There is no parameter 'mass' of single_pendulum"):
        hw.replay(log, "single_pendulum", parameters={"mass": 1.0})


def driven(delay: float = 0.0, unit: str = "N m", names: tuple[str, ...] = ("torque 1", "torque 2")) -> hw.Log:
    t = np.linspace(0.0, 1.0, 101)
    pushes = {name: np.random.default_rng(i).normal(size=len(t)) for i, name in enumerate(names)}
    inputs = tuple(replace(one, delay=delay) for one in channels("inputs", unit, pushes))
    return log_of(t, channels("coordinates", "rad", {"th1": np.sin(t), "th2": np.cos(t)}), inputs)


@pytest.mark.parametrize(
    ("log", "says"),
    [
        (driven(unit="A"), r"inputs\.torque 1 of the log is in \[A\]; double_pendulum takes it in N m"),
        (driven(names=("torque 1",)), "the input torque 1, and no torque 2"),
    ],
)
def test_inputs_of_another_mechanism_are_refused(log: hw.Log, says: str) -> None:
    for use in (hw.replay, hw.inverse):
        with pytest.raises(SceneError, match=says):
            use(log, "double_pendulum", **({"restart": 0.5} if use is hw.replay else {}))


def test_coordinates_in_another_unit_are_refused() -> None:
    t = np.linspace(0.0, 1.0, 101)
    log = log_of(t, channels("coordinates", "m", {"th1": np.sin(t)}))
    with pytest.raises(SceneError, match=r"coordinates\.th1 of the log is in \[m\]; single_pendulum takes it in rad"):
        hw.replay(log, "single_pendulum", restart=0.5)


@pytest.mark.parametrize("late", [-3, 0, 1, 7])
def test_an_input_acts_when_it_was_true(late: int) -> None:
    """What stands at t was in force at t less its delay, until the next one is."""
    model = hw.models.load("double_pendulum")
    told = np.concatenate([w.u for w in windows(driven(), model, restart=0.0)])
    found = np.concatenate([w.u for w in windows(driven(delay=0.01 * late), model, restart=0.0)])
    np.testing.assert_array_equal(found, told[np.clip(np.arange(len(told)) + late, 0, len(told) - 1)])


@pytest.mark.parametrize(("told", "more"), [(0.0, 0.0), (0.02, 0.0), (0.0, 0.02), (0.015, 0.01), (0.0, -0.01)])
def test_a_window_starts_where_the_motion_was_and_not_where_a_late_sensor_reads(told: float, more: float) -> None:
    t = np.linspace(0.0, 3.0, 3001)
    late = channels("coordinates", "rad", {"th1": np.sin(2.0 * (t - told - more))})
    log = log_of(t, tuple(replace(one, delay=told) for one in late))
    for window in windows(log, hw.models.load("single_pendulum"), restart=0.5, delay=more):
        begun = window.t[0]
        assert window.segment.y[0] == pytest.approx(np.sin(2.0 * begun), abs=2.1 * (told + more) ** 2 + 1e-6)
        np.testing.assert_allclose(window.age[:, 0], window.t - begun - told - more, atol=1e-12)


def hw_error() -> type[Exception]:
    from crossbody.cases import UnknownName

    return UnknownName
