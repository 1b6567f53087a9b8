"""Rods that slide down a wall and leave it: where one has just let go, it is at its surface by rounding."""

from __future__ import annotations

import math

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Mode, Outcome
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape

HALF, BALL = 0.5, 1.0 / 32.0
AXES = (("x", "slide", (1.0, 0.0, 0.0)), ("z", "slide", (0.0, 0.0, 1.0)), ("turn", "hinge", (0.0, 1.0, 0.0)))


def rod(angle: float, rate: float, floor: float, wall: float) -> Case:
    """A rod whose lower end slides away on a floor, and the upper one down a wall, at x = 0."""
    body = Body(name="rod", mass=1.0, inertia=(1e-3, HALF**2 / 3.0, 1e-3, 0.0, 0.0, 0.0))
    joints = tuple(Joint(name=name, body="rod", type=kind, axis=axis) for name, kind, axis in AXES)
    ends = tuple(
        Shape(name=name, body="rod", size=(BALL, 0.0, 0.0), position=(0.0, 0.0, z))
        for name, z in (("low", -HALF), ("high", HALF))
    )
    planes = (
        Shape(name="floor", type="plane"),
        Shape(name="wall", type="plane", orientation=(math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)),
    )
    pairs = tuple(
        Pair(name=f"{on}:{end}", first=on, second=end, friction=(mu, mu, 0.0, 0.0, 0.0), dimension=3,
             law=RowLaw(a0=1e4, a1=200.0))
        for on, end, mu in (("floor", "low", floor), ("wall", "high", wall))
    )  # fmt: skip
    scene = Scene(bodies=(body,), joints=joints, shapes=(*planes, *ends), pairs=pairs, gravity=(0.0, 0.0, -9.81))
    q0 = [BALL + HALF * math.sin(angle), BALL + HALF * math.cos(angle), -angle]
    v0 = [-HALF * math.cos(angle) * rate, HALF * math.sin(angle) * rate, rate]
    return cases.from_scene(scene, q0=q0, v0=v0, t_end=0.34)


@pytest.mark.parametrize("seed", [*range(6), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(6, 60))])
def test_a_rod_leaves_its_wall_once_in_both_machines(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drawn = rng.uniform((0.5, -0.5, 0.0, 0.01), (1.0, -0.05, 0.3, 0.3))
    case = rod(*(drawn if seed else (0.9, -0.3, 0.3, 0.05)))
    reference, lets_go = engines.load("reference"), []
    ends = []
    for profile in ("compiled", "cvode"):
        run = reference.prepare(case, profile, rtol=1e-10, time_limit=60.0).run()
        assert run.outcome is Outcome.FINISHED, run.message
        lets_go.append([event.t for event in run.events if event.contact == 1 and event.before == Mode.SLIP][:1])
        ends.append(run.q[-1])
    np.testing.assert_allclose(lets_go[1], lets_go[0], atol=1e-7)
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-7)
