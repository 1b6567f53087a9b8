"""The delta robot's synthetic logs: MuJoCo's motion from torques alone, the reference in closed loop, force, torque."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from crossbody import hw
from crossbody.cases import InvalidValue, SceneError
from crossbody.engines.equations import system_of
from crossbody.hw.models.contract import Segment
from crossbody.hw.replaying.inverse import _one

pytest.importorskip("mujoco")

PUSHES = (
    hw.Push(start=0.5, length=0.2, force=(1.0, -2.0, 5.0)),
    hw.Push(start=0.9, length=0.2, force=(-3.0, 2.0, 1.0)),
)
QUIET = hw.Sensors(noise=0.0, bits=44, delay=0.0, touch_noise=0.0, touch_step=0.0)
DELAY = 4e-4


@pytest.fixture(scope="module")
def plant() -> hw.Plant:
    return hw.delta_plant(t_end=1.2)


@pytest.fixture(scope="module")
def pushed() -> hw.Plant:
    return hw.delta_plant(PUSHES, t_end=1.2)


def worst(found: hw.Comparison) -> float:
    return float(np.abs(found.residual(found.predictions[0])).max())


def test_recorded_torques_give_the_recorded_motion(plant: hw.Plant) -> None:
    quiet = hw.replay(hw.delta_log(plant, QUIET), "delta", restart=0.0)
    assert worst(quiet) < 1e-9
    noisy = hw.replay(hw.delta_log(plant), "delta", restart=0.4, delay=DELAY)
    assert len(noisy.windows) == 2
    assert worst(noisy) < 2e-4
    rows = {(r.metric, r.channel): r.value for r in noisy.rows()}
    assert rows["rmse", "q11"] < 5e-5
    assert noisy.log.provenance.synthetic


def test_torques_that_hold_a_sample_late_are_noticed(plant: hw.Plant) -> None:
    log = hw.delta_log(plant, QUIET)
    late = np.roll(log.matrix("inputs"), 1, axis=0)
    late[0] = log.matrix("inputs")[0]
    changed = tuple(
        hw.Channel(role=c.role, name=c.name, unit=c.unit, values=late[:, i])
        for i, c in enumerate(c for c in log.channels if c.role == "inputs")
    )
    rest = tuple(c for c in log.channels if c.role != "inputs")
    other = hw.Log(time=log.time, channels=rest + changed, sample_time=log.sample_time, provenance=log.provenance)
    assert worst(hw.replay(other, "delta", restart=0.0)) > 1e-6


def test_the_recorded_reference_drives_model_and_controller(plant: hw.Plant) -> None:
    found = hw.replay(hw.delta_log(plant), "delta", kind="closed_loop", wanted=("reference", "mujoco"))
    assert [p.engine for p in found.predictions] == ["reference"]
    assert "follows only the paths of a case" in found.skipped["mujoco", "matched"]
    delays = [r.value for r in found.rows() if r.metric == "delay"]
    assert np.median(delays) == pytest.approx(DELAY, abs=1e-4)
    known = hw.replay(hw.delta_log(plant), "delta", kind="closed_loop", delay=DELAY)
    assert worst(known) < 5e-4
    rows = {(r.metric, r.channel): r.value for r in known.rows()}
    assert min(rows["fit", c.name] for c in known.coordinates) > 99.0


def test_when_the_clock_of_a_log_began_changes_nothing(plant: hw.Plant) -> None:
    log = hw.delta_log(plant).window(0.0, 0.3)
    later = replace(log, time=log.time + 64.0)
    for kind in ("forward", "closed_loop"):
        one, other = (hw.replay(each, "delta", kind=kind, restart=0.0, delay=DELAY) for each in (log, later))
        np.testing.assert_allclose(
            other.residual(other.predictions[0]), one.residual(one.predictions[0]), atol=1e-8, err_msg=kind
        )
    for found in (hw.inverse, hw.estimate_force, partial(hw.track_force, size=3.0, memory=0.1)):
        one, other = (found(each, "delta", delay=DELAY, stride=5) for each in (log, later))
        np.testing.assert_allclose(other.t - 64.0, one.t, atol=1e-12)
        np.testing.assert_allclose(other.value, one.value, atol=1e-5 * np.abs(one.value).max())


def test_a_delay_that_is_known_changes_no_force(pushed: hw.Plant) -> None:
    """Angles that come 20 samples late tell, at their own times, what they tell at once."""
    late = 20 * float(np.diff(pushed.t[:2])[0])
    logs = [hw.delta_log(pushed, replace(QUIET, delay=delay)) for delay in (0.0, late)]
    for force in (hw.estimate_force, partial(hw.track_force, size=3.0, memory=0.1)):
        found = [force(log, "delta", delay=delay, stride=2) for log, delay in zip(logs, (0.0, late), strict=True)]
        t = found[0].t[(found[0].t > 0.55) & (found[0].t < 0.65)]
        pushes = [[np.interp(t, one.t, f).mean() for f in one.value.T] for one in found]
        np.testing.assert_allclose(pushes, [PUSHES[0].force] * 2, atol=0.1)


@pytest.mark.parametrize("seed", range(6))
def test_what_an_instant_needs_are_the_inputs_that_make_its_motion(seed: int) -> None:
    """At speeds at which what the rows do by themselves counts, as it does not on a slow circle."""
    rng, model = np.random.default_rng(seed), hw.models.load("delta")
    start = Segment(y=np.full(3, 0.4), yd=rng.uniform(-9.0, 9.0, 3), t_end=1.0)
    case = model.build(model.numbers({}), start)
    system, q, v = system_of(case), case.q0, case.v0
    u, (H, _, drift) = rng.uniform(-2.0, 2.0, system.inputs), system.constraint(q, v)
    M, f = system.terms(q, v, u)
    whole = np.block([[M, -H.T], [H, np.zeros((len(H), len(H)))]])
    vd = np.linalg.solve(whole, np.concatenate([f, -drift]))[: system.n]
    own = list(model.seen)
    _, needed, inputs, mass = _one(system, model.seen, q, q[own], v[own], vd[own])
    np.testing.assert_allclose(needed, inputs @ u, atol=1e-9 * np.abs(mass @ vd[own]).max())
    assert np.abs(drift).max() > 1.0


def test_torque_that_the_motion_needs_is_the_recorded_one(plant: hw.Plant) -> None:
    found = hw.inverse(hw.delta_log(plant), "delta", delay=DELAY, stride=3)
    error = found.value - found.recorded
    assert np.sqrt(np.mean(error**2)) < 2.0 * found.std.mean()
    assert np.mean(np.abs(error) < 2.0 * found.std) > 0.9
    wrong = hw.inverse(hw.delta_log(plant), "delta", delay=DELAY, stride=30, parameters={"m3": 0.33})
    assert np.mean(np.abs(wrong.value - wrong.recorded) < 2.0 * wrong.std) < 0.2


def test_a_force_that_was_not_measured_is_found_within_its_uncertainty(pushed: hw.Plant) -> None:
    found = hw.estimate_force(hw.delta_log(pushed), "delta", delay=DELAY, stride=2)
    true = pushed.force[np.searchsorted(pushed.t, found.t + 1e-9) - 1]
    edges = np.array([0.5, 0.7, 0.9, 1.1])
    steady = np.abs(found.t[:, None] - edges).min(axis=1) > 27 * 0.88e-3  # a mean over the polynomial's samples
    error = (found.value - true)[steady]
    assert found.std.max() < 0.03
    assert np.abs(true).max() == 5.0
    assert np.mean(np.abs(error) < 2.0 * found.std[steady]) > 0.9
    assert np.sqrt(np.mean(error**2)) < 1.5 * found.std.mean()


def test_a_force_is_followed_from_positions_alone_within_its_uncertainty(pushed: hw.Plant) -> None:
    log = hw.delta_log(pushed)
    found = hw.track_force(log, "delta", size=3.0, memory=0.1, delay=DELAY, stride=2)
    true = pushed.force[np.clip(np.searchsorted(pushed.t, found.t + 1e-9) - 1, 0, len(pushed.force) - 1)]
    edges = np.array([0.5, 0.7, 0.9, 1.1, found.t[0], found.t[-1]])
    steady = np.abs(found.t[:, None] - edges).min(axis=1) > 0.03  # a jump is no Gauss-Markov process
    error = (found.value - true)[steady]
    assert np.mean(np.abs(error) < 2.0 * found.std[steady]) > 0.9
    assert np.median(found.std[steady]) < 0.5
    with pytest.raises(InvalidValue, match="time_force"):
        hw.track_force(log, "delta", size=3.0, memory=0.0)
    with pytest.raises(SceneError, match="no input for a force"):
        hw.track_force(log, "ball", size=1.0, memory=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_touch_sensors_tell_the_force_within_their_uncertainty(pushed: hw.Plant, seed: int) -> None:
    log = hw.delta_log(pushed, seed=seed)
    found = hw.unlagged(log.time, log.matrix("sensors"), rate=200.0, noise=0.02, quantum=0.01)
    error = (found.force - pushed.force[:-1]) / found.std
    assert np.mean(np.abs(error) < 2.0) == pytest.approx(0.954, abs=0.02)
    assert found.std.max() < 0.2


def test_motion_and_touch_tell_the_same_force(pushed: hw.Plant) -> None:
    """The estimate of the motion, put through the sensor's lag, is what the sensor showed."""
    log = hw.delta_log(pushed)
    found = hw.estimate_force(log, "delta", delay=DELAY)
    shown = hw.Sensor(rate=200.0).read(found.t, found.value)
    read = log.matrix("sensors")[np.searchsorted(log.time, found.t - 1e-9)]
    steady = (found.t > 0.6) & (found.t < 0.66)
    np.testing.assert_allclose(shown[steady].mean(axis=0), read[steady].mean(axis=0), atol=0.05)
