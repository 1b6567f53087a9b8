"""Contacts shorter than a step: none missed, none invented."""

import numpy as np
import pytest
from mechanisms import flyby, oscillator

from crossbody.cases import Mode
from crossbody.reference import simulate


def _touched(run):
    assert run.outcome.ok, run.message
    return any(e.after is Mode.CONTACT for e in run.events)


def _swing(rng, distance, rtol):
    """cos(w t + phase) past a wall at -1 - distance."""
    omega, phase = rng.uniform(0.5, 3.0), rng.uniform(0.2, 2.5)
    system = oscillator(-1.0 - distance, stiffness=omega**2)
    start = ([np.cos(phase)], [-omega * np.sin(phase)])
    return simulate(system, *start, 1.3 * (np.pi - phase) / omega, rtol=rtol, atol=1e-2 * rtol, samples=[0.0])


def _throw(rng, distance, rtol):
    """A parabola over a circle, closest above its top."""
    radius, speed, time = rng.uniform(0.3, 1.0), rng.uniform(0.5, 3.0), rng.uniform(0.4, 1.0)
    gravity = rng.uniform(0.0, 0.5) * speed**2 / radius
    start = ([-speed * time, radius + distance - 0.5 * gravity * time**2], [speed, gravity * time])
    if np.hypot(*start[0]) < 1.01 * radius:
        return None
    return simulate(flyby(radius, gravity), *start, 1.4 * time, rtol=rtol, atol=1e-2 * rtol, samples=[0.0])


@pytest.mark.parametrize("passing", [_swing, pytest.param(_throw, marks=pytest.mark.slow)])
def test_two_thousand_passes_within_a_nanometre(passing):
    rng = np.random.default_rng(20)
    wrong, done = [], 0
    while done < 1000:
        distance = 10.0 ** rng.uniform(-11, -9) * rng.choice([-1, 1])
        run = passing(rng, distance, 1e-13)
        if run is not None:
            done += 1
            if _touched(run) != (distance < 0):
                wrong.append(distance)
    assert not wrong


@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10, 1e-13])
def test_undecidable_passes_end_consistent(rtol):
    rng = np.random.default_rng(5)
    for distance in [0.0, *(10.0 ** rng.uniform(-17, -11, 60) * rng.choice([-1, 1], 60))]:
        run = _swing(rng, distance, rtol)
        assert run.outcome.ok, run.message
        assert run.steps < 500
