"""Models of rigs: what they take from a log, and what they show of a run, in closed form."""

from __future__ import annotations

import json

import numpy as np
import pytest
from rig_data import PENDULUM, needs_pendulum
from scipy.spatial.transform import Rotation

from crossbody import hw
from crossbody.cases import Trajectory
from crossbody.cases.mechanisms.maze.geometry import maze_of
from crossbody.engines.equations import system_of
from crossbody.hw.models.contract import Segment


@pytest.mark.parametrize("side", ["inner", "outer"])
@pytest.mark.parametrize("ring", range(4))
def test_a_ball_seen_beside_a_face_rolls_on_that_face(ring: int, side: str) -> None:
    """A little off it, on either side: as the nearest, and without slip by the rows of the mechanism."""
    random, model = np.random.default_rng([ring, side == "inner"]), hw.models.load("maze")
    numbers = model.numbers()
    face, out = getattr(maze_of(numbers).rings[ring], side), -1.0 if side == "inner" else 1.0
    for off in (-3e-4, 0.0, 3e-4):
        rho, angle = face + out * maze_of(numbers).ball + off, random.uniform(-np.pi, np.pi)
        theta, turning, along = random.normal(size=3)
        n, ahead = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        segment = Segment(y=np.append(theta, rho * n), yd=np.append(turning, along * ahead), t_end=0.1)
        case = model.build(numbers, segment)
        assert (case.parameters["ring"], case.parameters["side"]) == (ring, side)
        np.testing.assert_array_equal(case.q0, [*segment.y, 0.0])
        np.testing.assert_array_equal(case.v0[:3], segment.yd)
        rolls = case.contacts.index("slip above" if side == "inner" else "slip below")
        if not off:
            assert abs(system_of(case).gap(case.q0, case.v0)[1][rolls]) < 1e-12
        # The point of the ball towards the face moves as the maze does there.
        point = along - out * maze_of(numbers).ball * case.v0[3]
        assert point == pytest.approx(face * turning, abs=1e-12)


@needs_pendulum
@pytest.mark.parametrize("name", ["single_pendulum", "double_pendulum"])
def test_the_numbers_of_a_pendulum_are_those_published_with_its_logs(name: str) -> None:
    published = json.loads((PENDULUM / "published_parameters.json").read_text())[name.partition("_")[0]]
    numbers = hw.models.load(name).numbers()
    assert {key: numbers["gravity" if key == "g" else key] for key in published} == published


def run_of(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> Trajectory:
    nothing = np.zeros((len(t), 0))
    return Trajectory(
        t=t, q=q, v=v, gap=nothing, lam=nothing, energy=np.zeros((len(t), 2)), mode=nothing.astype(np.int8)
    )


@pytest.mark.parametrize("name", ["ball", "maze", "single_pendulum", "double_pendulum"])
def test_measured_coordinates_of_a_run_are_cubic_between_its_samples(name: str) -> None:
    """Those that are measured, of the others' number; behind the run there is no prediction."""
    random, model = np.random.default_rng(3), hw.models.load(name)
    t = np.append(0.0, np.sort(random.uniform(0.0, 2.0, 30)))
    lines = [np.polynomial.Polynomial(random.normal(size=4)) for _ in range(max(model.seen) + 3)]
    run = run_of(*(np.repeat(x, 2, axis=0) for x in (
        t, np.column_stack([line(t) for line in lines]), np.column_stack([line.deriv()(t) for line in lines]),
    )))  # fmt: skip
    times = np.sort(np.append(random.uniform(0.0, t[-1], 50), [t[-1], t[-1] + 1e-6]))
    y, yd = model.see(model, run, times)
    for found, wanted in ((y, lines), (yd, [line.deriv() for line in lines])):
        np.testing.assert_allclose(found[:-1], np.column_stack([wanted[i](times[:-1]) for i in model.seen]), atol=1e-9)
        assert np.isnan(found[-1]).all()


def test_a_cube_turns_the_shorter_way_between_samples_and_stands_before_the_first() -> None:
    random, model = np.random.default_rng(4), hw.models.load("cube_toss")
    t, axis, rate = np.linspace(0.5, 1.5, 21), np.array([0.6, 0.0, 0.8]), 1.7
    places, speed = random.normal(size=(2, 3))
    first = Rotation.from_rotvec([0.3, -0.2, 0.1])
    turned = [first * Rotation.from_rotvec(axis * rate * (at - t[0])) for at in t]
    q = np.column_stack([places + np.multiply.outer(t - t[0], speed), [r.as_quat(scalar_first=True) for r in turned]])
    q[::2, 3:] *= -1.0  # the same rotations
    run = run_of(t, q, np.tile(np.append(speed, axis * rate), (len(t), 1)))
    times = np.array([0.4, 0.5, 0.777, 1.5, 1.6])
    y, yd = model.see(model, run, times)
    for row, at in enumerate(np.clip(times[:-1], 0.5, 1.5) - 0.5):
        np.testing.assert_allclose(y[row, :3], places + speed * at, atol=1e-12)
        there = (Rotation.from_rotvec(y[row, 3:]) * (first * Rotation.from_rotvec(axis * rate * at)).inv()).magnitude()
        assert there < 1e-9
        np.testing.assert_allclose(yd[row], np.append(speed, axis * rate), atol=1e-12)
    assert np.isnan(y[-1]).all()
    assert np.isnan(yd[-1]).all()
