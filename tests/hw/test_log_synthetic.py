"""Synthetic logs of the delta rig: named so, made by a plant whose energy adds up, with the faults that were asked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crossbody import hw
from crossbody.cases import InvalidValue
from crossbody.reference.delta import flanges, scene

pytest.importorskip("mujoco")

PERIOD = 0.88e-3
PUSH = hw.Push(start=0.4, length=0.1, force=(1.0, -2.0, 5.0))
QUIET = hw.Sensors(noise=0.0, bits=40, delay=0.0, touch_noise=0.0, touch_step=0.0)


@pytest.fixture(scope="module")
def plant() -> hw.Plant:
    return hw.delta_plant([PUSH], t_end=0.8)


def test_the_energy_of_the_plant_is_the_work_of_what_its_log_says(plant: hw.Plant) -> None:
    at = np.searchsorted(plant.trajectory.t, plant.t - 1e-12)
    energy = plant.trajectory.energy.sum(axis=1)[at]
    robot = scene.robot_of(plant.case.parameters)
    y, z = plant.q[:, ::3], flanges(robot, plant.q)
    work = np.sum(plant.u[:-1] * np.diff(y, axis=0), axis=1) + np.sum(plant.force[:-1] * np.diff(z, axis=0), axis=1)
    power = np.sum(np.tile([robot.d1, robot.d2, robot.d3], 3) * plant.v**2, axis=1)
    lost = 0.5 * (power[1:] + power[:-1]) * PERIOD
    balance = energy[1:] - energy[0] - np.cumsum(work - lost)
    assert np.abs(balance).max() < 1e-5 * np.abs(work).sum()  # 6e-3 with torques a tick late


def test_a_log_says_that_it_is_synthetic_wherever_it_goes(plant: hw.Plant, tmp_path: Path) -> None:
    log = hw.delta_log(plant)
    hw.store(log, tmp_path / "log.parquet")
    for one in (log, hw.read(tmp_path / "log.parquet")):
        assert one.provenance.synthetic
        assert one.provenance.about.startswith("SYNTHETIC, no measurement")
        assert "mujoco" in one.provenance.library
    assert b"SYNTHETIC" in (tmp_path / "log.parquet").read_bytes()


def test_a_seed_is_a_log(plant: hw.Plant) -> None:
    noisy = hw.Sensors(jitter=1e-6, dropped=0.01)
    one, same, other = (hw.delta_log(plant, noisy, seed) for seed in (1, 1, 2))
    assert one.time.tobytes() == same.time.tobytes()
    assert one.provenance.sha256 == same.provenance.sha256 != other.provenance.sha256


def test_without_faults_it_is_the_plant(plant: hw.Plant) -> None:
    log = hw.delta_log(plant, QUIET)
    np.testing.assert_allclose(log.matrix("coordinates", ("q11", "q21", "q31")), plant.q[:, ::3], atol=1e-11)
    np.testing.assert_array_equal(log.matrix("inputs"), plant.u)
    np.testing.assert_array_equal(log.matrix("references"), plant.r)
    np.testing.assert_array_equal(log.time, PERIOD * np.arange(len(log)))


@pytest.mark.parametrize("delay", [0.0, 3e-4, 1.3e-3])
def test_the_delay_can_be_found_again(delay: float, plant: hw.Plant) -> None:
    y = hw.delta_log(plant, hw.Sensors(delay=delay)).matrix("coordinates")
    moving = plant.t > 0.1
    lag, v = (plant.q[:, ::3] - y)[moving], plant.v[:, ::3][moving]
    assert np.sum(lag * v) / np.sum(v * v) == pytest.approx(delay, abs=2e-5)


def test_noise_and_counts_are_those_asked_for(plant: hw.Plant) -> None:
    y = hw.delta_log(plant, hw.Sensors(noise=1e-4, bits=16, delay=0.0)).matrix("coordinates")
    count = 2 * np.pi / 2**16
    np.testing.assert_allclose(y / count, np.rint(y / count), atol=1e-6)
    assert np.std(y - plant.q[:, ::3]) == pytest.approx(np.hypot(1e-4, count / np.sqrt(12)), rel=0.05)


def test_a_touch_sensor_lags(plant: hw.Plant) -> None:
    rate = 150.0
    log = hw.delta_log(plant, hw.Sensors(touch_rate=rate, touch_noise=0.0, touch_step=0.0))
    begin, end = (int(np.argmax(plant.force[:, 2] > 0)), int(np.flatnonzero(plant.force[:, 2] > 0)[-1]) + 1)
    force = log.matrix("sensors")
    assert not force[: begin + 1].any()
    rise = 1.0 - np.exp(-rate * (plant.t[begin:end] - plant.t[begin]))
    np.testing.assert_allclose(force[begin:end], rise[:, None] * PUSH.force, atol=1e-12)


def test_losses_jitter_and_drift_are_found_by_the_checks(plant: hw.Plant) -> None:
    log = hw.delta_log(plant, hw.Sensors(dropped=0.05, jitter=3e-6, drift=1e-4), seed=4)
    whole = len(plant.t)
    assert whole - len(log) == pytest.approx(0.05 * whole, abs=4 * np.sqrt(0.05 * whole))
    (dropped,) = [finding for finding in log.findings if finding.check == "dropped"]
    assert dropped.text.startswith(f"{whole - len(log)} samples")
    slope = np.polyfit(np.rint(log.time / PERIOD) * PERIOD, log.time, 1)[0]
    assert slope - 1.0 == pytest.approx(1e-4, abs=5e-6)


@pytest.mark.parametrize("wrong", [{"dropped": 0.9}, {"noise": -1.0}, {"delay": np.nan}, {"drift": 0.5}])
def test_sensors_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidValue, match=next(iter(wrong))):
        hw.Sensors(**wrong)  # type: ignore[arg-type]


def test_a_push_outside_the_run_is_refused() -> None:
    with pytest.raises(InvalidValue, match="does not lie within"):
        hw.delta_plant([hw.Push(start=0.7, length=0.2, force=(0.0, 0.0, 1.0))], t_end=0.8)
