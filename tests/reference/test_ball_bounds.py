"""A ball joint that turns against its bound as fast as to come to where that has no direction: it is told, at once."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody.cases import Outcome, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, RowLaw, Scene
from crossbody.reference import simulate
from crossbody.reference.tree.system import system


def turned(seed: int, speed: float, solver: str) -> Trajectory:
    rng = np.random.default_rng([seed, 21])
    law = RowLaw(a0=1e4, a1=50.0)
    joint = Joint(name="ball", body="arm", type="ball", range=(0.0, float(rng.uniform(0.3, 2.9))), law=law)
    inertia = (*rng.uniform(0.02, 0.03, 3), 0.0, 0.0, 0.0)
    arm = Body(name="arm", mass=1.0, com=tuple(rng.uniform(-0.1, 0.1, 3)), inertia=inertia)
    scene, way = Scene(bodies=(arm,), joints=(joint,)), rng.normal(size=3)
    v = speed * way / np.linalg.norm(way)
    return simulate(system(scene, case_of(scene).law), [1.0, 0.0, 0.0, 0.0], v, 0.1, rtol=1e-8, solver=solver)


@pytest.mark.parametrize("seed", range(20))
def test_a_row_in_force_that_comes_to_where_it_has_no_direction_is_named(seed: int) -> None:
    found = turned(seed, 560.0, "compiled")
    assert found.outcome in (Outcome.FINISHED, Outcome.ILL_POSED), found.message
    if found.outcome is Outcome.ILL_POSED:
        assert "Rows [0] are in force where they have no direction" in found.message
        assert found.steps < 100_000
        angle = 2.0 * np.arctan2(np.linalg.norm(found.q[-1, 1:]), np.abs(found.q[-1, 0]))
        assert angle < 0.1


def test_some_come_there_and_some_do_not() -> None:
    """And none that turns as slowly as its bound is made for."""
    assert {turned(seed, 560.0, "compiled").outcome for seed in range(6)} == {Outcome.FINISHED, Outcome.ILL_POSED}
    assert {turned(seed, 20.0, "compiled").outcome for seed in range(6)} == {Outcome.FINISHED}


@pytest.mark.slow
def test_the_second_machine_tells_it_too() -> None:
    (seed,) = [seed for seed in range(6) if turned(seed, 560.0, "compiled").outcome is Outcome.ILL_POSED][:1]
    one, other = (turned(seed, 560.0, solver) for solver in ("compiled", "cvode"))
    assert other.outcome is Outcome.ILL_POSED, other.message
    assert "Rows [0] are in force where they have no direction" in other.message
    assert other.t[-1] == pytest.approx(one.t[-1], abs=0.1 / 560.0)  # of the last part of a turn
