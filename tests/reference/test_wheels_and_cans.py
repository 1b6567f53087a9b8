"""Cylinders on a floor with friction against closed forms: wheels, coins that roll on a rim, cans that stand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from friction_scenes import G, account, on_floor, run
from scipy.spatial.transform import Rotation

from crossbody.cases import Mode, Outcome, Trajectory
from crossbody.cases.scene import Body, Scene, Shape

TIME, STATE = 1e-11, 1e-9
RADIUS, HALF = 0.1, 0.04
ACROSS = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
"""A cylinder whose axis points to -y."""


def moments(radius: float, half: float) -> tuple[float, float]:
    """Return the moments of inertia of a homogeneous cylinder of 1 kg, across its axis and about it."""
    return (3.0 * radius**2 + 4.0 * half**2) / 12.0, radius**2 / 2.0


def cylinder(mu: float, radius: float = RADIUS, half: float = HALF, **given: Any) -> Scene:
    """Return a homogeneous cylinder of 1 kg on a plane that falls in x by `tilt`."""
    across, about = moments(radius, half)
    body = Body(name="can", mass=1.0, inertia=(across, across, about, 0.0, 0.0, 0.0))
    return on_floor(body, Shape(name="can", body="can", type="cylinder", size=(radius, half, 0.0)), mu, **given)


def stops(found: Trajectory) -> set[float]:
    """Return when contacts began to stick, but at the start."""
    return {event.t for event in found.events if event.after is Mode.STICK and event.t > 0.0}


@pytest.mark.parametrize("solver", ["compiled", pytest.param("cvode", marks=pytest.mark.slow)])
def test_a_wheel_rolls_down_a_slope(solver: str) -> None:
    """On the rims of both caps, whose rows along its axis are one and the same: a = 2/3 g sin."""
    found = run(cylinder(0.6, tilt=0.3), [0, 0, RADIUS, *ACROSS], np.zeros(6), 0.5, solver=solver, rtol=1e-10)
    assert found.outcome is Outcome.FINISHED, found.message
    down = 2.0 / 3.0 * G * np.sin(0.3)
    assert found.v[-1] == pytest.approx([0.5 * down, 0, 0, 0, 0, -0.5 * down / RADIUS], abs=1e-8)
    assert found.q[-1, 0] == pytest.approx(0.125 * down, abs=STATE)
    assert set(found.mode[-1, [0, 2]]) == {Mode.STICK}
    assert found.lam[-1, [0, 2]] == pytest.approx([0.5 * G * np.cos(0.3)] * 2, rel=1e-8)
    assert not [event for event in found.events if event.t > 0.0]


@pytest.mark.parametrize("tan", [1.2, 1.6])
def test_a_wheel_rolls_as_long_as_a_third_of_the_slope_is_below_the_coefficient(tan: float) -> None:
    found = run(cylinder(tan / 3.0 * 1.01, tilt=np.arctan(tan)), [0, 0, RADIUS, *ACROSS], np.zeros(6), 0.1)
    slides = run(cylinder(tan / 3.0 * 0.99, tilt=np.arctan(tan)), [0, 0, RADIUS, *ACROSS], np.zeros(6), 0.1)
    assert found.mode[-1, 0] == Mode.STICK
    assert slides.mode[-1, 0] == Mode.SLIP
    a = G * (np.sin(np.arctan(tan)) - tan / 3.0 * 0.99 * np.cos(np.arctan(tan)))
    assert slides.v[-1, 0] == pytest.approx(0.1 * a, abs=STATE)


def test_a_wheel_with_backspin_slides_then_rolls_back() -> None:
    v0, spin, mu = 1.0, 30.0, 0.2
    found = run(cylinder(mu), [0, 0, RADIUS, *ACROSS], [v0, 0, 0, 0, 0, spin], 1.2)
    [t] = stops(found)  # of both rims at once
    assert abs(t - (v0 + RADIUS * spin) / (3.0 * mu * G)) < TIME
    assert found.v[-1, 0] == pytest.approx((2.0 * v0 - RADIUS * spin) / 3.0, abs=STATE)
    assert account(found) < STATE


def steady(lean: float, turn: float, radius: float, half: float) -> tuple[float, float, float]:
    """Return spin, speed and height of a disc whose axis leans so far and goes round at a rate `turn`, rolling.

    With w = turn z + spin e the moment of the forces at the rim is the change of the angular momentum
    A w + (C - A) w_e e, which is linear in the spin.
    """
    (A, C), sin, cos = moments(radius, half), np.sin(lean), np.cos(lean)
    out, up = half * sin - radius * cos, half * cos + radius * sin  # from the rim to the centre
    pulled = turn**2 * sin * cos * (C - A) - out * G - up * out * turn**2
    spin = -pulled / (up * radius * turn + C * turn * sin)
    return float(spin), float(turn * out - radius * spin), float(up)


@pytest.mark.parametrize("upside_down", [False, True])
@pytest.mark.parametrize(("lean", "turn", "half"), [(1.3, 2.0, 0.01), (1.0, 5.0, 0.01), (0.5, 9.0, 0.03)])
def test_a_coin_rolls_steadily_on_its_rim(lean: float, turn: float, half: float, upside_down: bool) -> None:
    """It goes round a circle of |v|/turn, level, and is back after one turn."""
    spin, speed, up = steady(lean, turn, RADIUS, half)
    pose = Rotation.from_euler("y", lean) * Rotation.from_euler("x", np.pi * upside_down)
    w = [spin * np.sin(lean), 0.0, turn + spin * np.cos(lean)]
    q0 = [speed / turn, 0.0, up, *np.roll(pose.as_quat(), 1)]
    v0 = [0.0, speed, 0.0, *pose.inv().apply(w)]
    found = run(cylinder(0.95 * 1.2 * abs(turn * speed) / G + 0.05, half=half), q0, v0, 2.0 * np.pi / turn, rtol=1e-10)
    assert found.outcome is Outcome.FINISHED, found.message
    assert not [event for event in found.events if event.t > 0.0]
    assert np.abs(np.hypot(*found.q[:, :2].T) - abs(speed / turn)).max() < STATE
    assert np.abs(found.q[:, 2] - up).max() < STATE
    assert np.abs(found.q[-1, :2] - q0[:2]).max() < 1e-8
    pressed = 2 * int(upside_down)
    assert found.lam[-1, pressed] == pytest.approx(G, rel=1e-7)
    assert np.hypot(*found.lam[-1, 4 + 2 * pressed :][:2]) == pytest.approx(abs(turn * speed), rel=1e-7)


@pytest.mark.parametrize(("half", "part"), [(HALF, 0.3), (0.2, 0.97)])
@pytest.mark.parametrize("angle", [0.0, 0.4, 0.25 * np.pi])
def test_a_standing_can_slides_to_a_stop(angle: float, half: float, part: float) -> None:
    """v^2/(2 mu g), and mu half/radius is below 1: it does not tip over."""
    v0, mu = np.array([np.cos(angle), np.sin(angle)]), part * RADIUS / half
    found = run(cylinder(mu, half=half), [0, 0, half, 1, 0, 0, 0], [*v0, 0, 0, 0, 0], 1.2 / (mu * G))
    assert abs(min(stops(found)) - 1.0 / (mu * G)) < TIME
    assert found.q[-1, :2] == pytest.approx(v0 / (2.0 * mu * G), abs=STATE)
    assert found.mode[-1, 0] == Mode.STICK
    assert Mode.SLIP not in found.mode[-1]


@pytest.mark.parametrize("angle", [0.0, 0.4, 0.25 * np.pi])
@pytest.mark.parametrize("part", [0.97, 1.03])
def test_a_can_tips_over_on_a_slope_of_radius_over_half_height(part: float, angle: float) -> None:
    q0 = [0, 0, 0.1, np.cos(0.5 * angle), 0, 0, np.sin(0.5 * angle)]
    scene = cylinder(0.7, radius=0.05, half=0.1, tilt=np.arctan(0.5 * part))
    found = run(scene, q0, np.zeros(6), 0.5, rtol=1e-9)
    assert found.outcome is Outcome.FINISHED, found.message
    fallen = 2.0 * np.linalg.norm(found.q[-1, 4:6])
    assert fallen > 0.1 if part > 1.0 else fallen < 1e-12


@pytest.mark.parametrize("seed", range(10))
def test_a_can_stands_on_its_rim_whatever_the_way_it_faces(seed: int) -> None:
    """On slopes and as it slides, as long as its load does not come to the rim: it is no square."""
    rng = np.random.default_rng(seed)
    radius, angle, way = 0.05, rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 2.0 * np.pi)
    half = radius * rng.uniform(0.5, 2.5)
    tan, q0 = rng.uniform(0.4, 0.98) * radius / half, [0, 0, half, np.cos(0.5 * angle), 0, 0, np.sin(0.5 * angle)]
    scene = cylinder(tan * rng.uniform(1.05, 1.5), radius=radius, half=half, tilt=np.arctan(tan))
    stands = run(scene, q0, np.zeros(6), 0.5, rtol=1e-9, max_steps=5000)
    assert stands.outcome is Outcome.FINISHED, stands.message
    assert np.abs(stands.q - q0).max() < 1e-12
    v0 = np.array([np.cos(way), np.sin(way)])
    slides = run(cylinder(tan, radius=radius, half=half), q0, [*v0, 0, 0, 0, 0], 1.2 / (tan * G), max_steps=5000)
    assert slides.outcome is Outcome.FINISHED, slides.message
    assert slides.q[-1, :2] == pytest.approx(v0 / (2.0 * tan * G), abs=STATE)
