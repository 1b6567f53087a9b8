"""The energy account of spec 1.4: E(t) - E(0) = input - dissipated + work of every row."""

import numpy as np
import pytest
from mechanisms import ball, flyby, oscillator, sliders
from test_machines import gusty

from crossbody.reference import simulate

SCENES = {
    "listing": (ball(), [1.0], [0.0], {}),
    "elastic": (ball(a1=0.0), [1.0], [0.0], {}),
    "start below": (ball(), [-0.01], [0.0], {}),
    "oscillator": (oscillator(-0.5), [1.0], [0.0], {}),
    "pendulum": (flyby(1.0, 9.81, a0=25.0, a1=10.0, unilateral=False), [1.0, 0.0], [0.0, 0.0], {}),
    "sliders": (sliders(4, a1=30.0), [0.0, 0.01, 0.02, 0.03], [1.0, 0.0, 0.0, 0.0], {}),
    "stiff rest": (ball(a0=1e8, a1=2e4, a2=0.0), [0.01], [0.0], {}),
}


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("name", SCENES)
def test_ledger_closes(name, rtol):
    system, q0, v0, more = SCENES[name]
    run = simulate(system, q0, v0, 2.0, rtol=rtol, ledger=True, **more)
    assert run.outcome.ok, run.message
    account = run.ledger.input - run.ledger.dissipated + run.ledger.contact.sum(axis=1)
    residual = run.total_energy - run.total_energy[0] - account
    scale = run.energy[:, 0].max() + np.ptp(run.energy[:, 1])
    assert np.abs(residual).max() < 200.0 * rtol * scale + 1e-13


def test_work_of_one_bounce_is_the_law_s():
    # No gravity, linear law: the row takes m v^2 (1 - e^2) / 2.
    system = ball(a0=1e4, a1=40.0, a2=0.0, gravity=0.0)
    run = simulate(system, [0.01], [-1.0], 0.1, rtol=1e-11, ledger=True)
    assert run.ledger.contact[-1, 0] == pytest.approx(0.5 * (run.v[-1, 0] ** 2 - 1.0), rel=1e-9)


def test_input_force_does_no_work_without_a_power_kernel():
    run = simulate(gusty(), [0.5], [0.0], 0.1, ledger=True)
    assert np.all(run.ledger.input == 0.0)
