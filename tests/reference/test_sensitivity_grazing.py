"""Derivatives of motions that only just touch: there are none, and the row and the instant are told."""

from __future__ import annotations

import re

import numpy as np
import pytest
from friction_scenes import LAW, box_on_floor, sphere_on_floor
from mechanisms import oscillator

from crossbody.cases import Outcome
from crossbody.cases.files.case import case_of
from crossbody.reference import simulate
from crossbody.reference.linear import Sensitivity, sensitivity
from crossbody.reference.tree.system import system

RTOL = 1e-11


def swing(depth: float) -> Sensitivity:
    """Return derivatives of cos(t + 1/2) beside a wall, that far before where it turns at t = pi - 1/2."""
    return sensitivity(oscillator(-1.0 + depth), [np.cos(0.5)], [-np.sin(0.5)], 4.0, rtol=RTOL)


@pytest.mark.parametrize("depth", [0.0, *(sign * size for sign in (-1, 1) for size in (1e-15, 1e-13, 1e-11))])
def test_a_swing_that_touches_a_wall_no_deeper_than_is_known(depth: float) -> None:
    found = swing(depth)
    assert found.outcome is Outcome.ILL_POSED
    told = re.fullmatch(r"The gap of row 0 is only grazed at t = ([\d.]+) s\.", found.message)
    assert told is not None, found.message
    assert float(told[1]) == pytest.approx(np.pi - 0.5, abs=1e-5)
    assert np.isnan(found.by_start).all()


@pytest.mark.parametrize("depth", [1e-9, 1e-6, 1e-5])
def test_one_that_touches_so_slowly_that_nothing_presses(depth: float) -> None:
    """The wall's damper, 20 v, does not outweigh the spring that draws it back: it lets go where it touches."""
    found = swing(depth)
    assert found.outcome is Outcome.FINISHED
    np.testing.assert_allclose(found.by_start, [[np.cos(4), np.sin(4)], [-np.sin(4), np.cos(4)]], atol=1e-9)


@pytest.mark.parametrize("depth", [1e-4, 2e-3, 1e-2, 1e-1])
def test_one_that_goes_deeper_has_the_derivative_of_runs(depth: float) -> None:
    found = swing(depth)
    assert found.outcome is Outcome.FINISHED

    def end(q: float, v: float) -> np.ndarray:
        run = simulate(oscillator(-1.0 + depth), [q], [v], 4.0, rtol=1e-13)
        return np.concatenate([run.q[-1], run.v[-1]])

    step, start = min(1e-6, 1e-3 * depth), np.array([np.cos(0.5), -np.sin(0.5)])
    slopes = np.stack([(end(*(start + e)) - end(*(start - e))) / (2.0 * step) for e in step * np.eye(2)], axis=-1)
    np.testing.assert_allclose(found.by_start, slopes, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("height", [1e-8, 1e-4])
def test_one_that_passes_by_has_that_of_a_swing(height: float) -> None:
    found = swing(-height)
    assert found.outcome is Outcome.FINISHED
    np.testing.assert_allclose(found.by_start, [[np.cos(4), np.sin(4)], [-np.sin(4), np.cos(4)]], atol=1e-9)


@pytest.mark.parametrize("speed", [0.0, 1e-14, -1e-14])
def test_a_start_on_the_wall_from_which_it_turns_away(speed: float) -> None:
    found = sensitivity(oscillator(-1.0), [-1.0], [speed], 1.0, rtol=RTOL)
    assert found.outcome is Outcome.ILL_POSED
    assert found.message == "The gap of row 0 is only grazed at the start, t = 0 s."


@pytest.mark.parametrize("seed", range(6))
def test_bodies_that_rise_from_the_floor_graze_it_at_their_start(seed: int) -> None:
    """Thrown off the floor at no speed they are lifted: gravity points up. With friction or none."""
    rng, mu = np.random.default_rng(seed), (0.0, 0.5)[seed % 2]
    scene = sphere_on_floor(mu, 0.1) if seed < 3 else box_on_floor(mu)
    scene = scene.replace(gravity=(0.0, 0.0, 9.81))
    q0 = [*rng.normal(size=2), 0.1, 1.0, 0.0, 0.0, 0.0]
    found = sensitivity(system(scene, case_of(scene).law), q0, [*rng.normal(size=2), 0.0, 0.0, 0.0, 0.0], 0.1)
    assert LAW.a0 > 0.0
    assert found.outcome is Outcome.ILL_POSED
    assert "only grazed at the start, t = 0 s" in found.message
