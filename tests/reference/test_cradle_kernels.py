"""Equations of the cradle's two forms against complex-step derivatives, and what a bad row of balls is told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crossbody.cases import CrossbodyError, SceneError, load
from crossbody.reference import System
from crossbody.reference.systems import pendulums, sliders

STEP = 1e-30
SYSTEMS = {"sliders": sliders, "pendulums": pendulums}
N = 5


@pytest.fixture(params=SYSTEMS)
def system(request: pytest.FixtureRequest) -> System:
    case = load("newtons_cradle", request.param, n=N, gap=2e-3, masses="4,2,1,3,0.5")
    built: System = SYSTEMS[request.param].build(case.parameters, case.law)
    return built


def states() -> list[tuple[Any, Any]]:
    rng = np.random.default_rng(7)
    return [(rng.uniform(-0.4, 0.4, N), rng.normal(size=N)) for _ in range(20)]


def complex_gaps(system: System, q: Any, v: Any) -> tuple[Any, Any]:
    h, hd = np.zeros(N - 1, complex), np.zeros(N - 1, complex)
    system.gaps(0.0, np.asarray(q, complex), np.asarray(v, complex), np.asarray(system.p, complex), h, hd)
    return h, hd


def test_rows_are_the_derivative_of_the_gaps(system: System) -> None:
    for q, v in states():
        H, h, Hdv = system.constraint(q, v)
        by_step = [complex_gaps(system, q + 1j * STEP * e, v)[0].imag / STEP for e in np.eye(N)]
        np.testing.assert_allclose(H, np.transpose(by_step), atol=1e-14)
        along = complex_gaps(system, q + 1j * STEP * v, v)
        np.testing.assert_allclose(H @ v, along[0].imag / STEP, atol=1e-14)
        np.testing.assert_allclose(Hdv, along[1].imag / STEP, atol=1e-13)
        np.testing.assert_allclose(np.stack(system.gap(q, v)), [h, H @ v], atol=1e-14)


def test_every_row_touches_its_two_balls_alone(system: System) -> None:
    for q, v in states():
        H = system.constraint(q, v)[0]
        for i, (first, last) in enumerate(np.asarray(system.span)):
            assert set(np.flatnonzero(H[i])) <= set(range(first, last)) == {i, i + 1}


def test_forces_are_the_slope_of_the_energy(system: System) -> None:
    for q, v in states():
        M, f = system.terms(q, v)
        e = np.zeros(2, complex)
        slope = np.zeros(N)
        for i in range(N):
            at = q + 1j * STEP * np.eye(N)[i]
            system.energy(at, np.asarray(v, complex), np.asarray(system.p, complex), e)
            slope[i] = e[1].imag / STEP
        np.testing.assert_allclose(f, -slope, atol=1e-14)
        assert e[0].real == pytest.approx(0.5 * v @ M @ v, rel=1e-14)


def test_gap_is_the_distance_of_the_circles() -> None:
    case = load("newtons_cradle", "pendulums", gap=2e-3)
    system = pendulums.build(case.parameters, case.law)
    r, L = case.number("radius"), case.number("length")
    for q, _ in states():
        x, y = np.arange(N) * (2 * r + 2e-3) + L * np.sin(q), -L * np.cos(q)
        np.testing.assert_allclose(system.gap(q)[0], np.hypot(np.diff(x), np.diff(y)) - 2 * r, atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, -0.5, 1e-9])
def test_pendulums_side_by_side_touch_exactly(angle: float) -> None:
    case = load("newtons_cradle", "pendulums", gap=0.0)
    system = pendulums.build(case.parameters, case.law)
    h, rate = system.gap(np.full(N, angle), np.full(N, 0.3))
    assert not h.any()
    assert np.abs(rate).max() < 1e-16


@pytest.mark.parametrize(
    ("parameters", "says"),
    [
        ({"gap": -1e-3}, "overlap at the start"),
        ({"lifted": 5}, "lifted is 5 of n = 5 balls; valid: 1 to 4"),
        ({"lifted": 0}, "lifted is 0"),
        ({"n": 1}, "n is 1"),
        ({"masses": "1,2"}, "lists 2 numbers"),
        ({"masses": "0"}, "masses is 0"),
        ({"masses": "1,1,-1,1,1"}, "masses[2] is -1"),
        ({"speed": 0.0}, "speed is 0"),
        ({"t_end": 0.0}, "or: auto"),
        ({"angle": 0.1}, "angle is 0.1"),
        ({"collisions": "guess"}, "sequential, simultaneous, resolved"),
    ],
)
@pytest.mark.parametrize("variant", SYSTEMS)
def test_a_bad_row_of_balls_is_told_why(variant: str, parameters: dict[str, Any], says: str) -> None:
    with pytest.raises(CrossbodyError) as told:
        load("newtons_cradle", variant, **parameters)
    assert says in str(told.value)


@pytest.mark.parametrize("variant", SYSTEMS)
def test_an_overlapping_start_is_refused(variant: str) -> None:
    case = load("newtons_cradle", variant)
    with pytest.raises(SceneError, match="balls 1 and 2 overlap"):
        SYSTEMS[variant].check_start(case.parameters, np.array([0.0, 1e-3, 0.0, 0.0, 0.0]), np.zeros(N))
    SYSTEMS[variant].check_start(case.parameters, case.q0, case.v0)
