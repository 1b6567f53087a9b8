"""A ball that rolls between a floor and a plate: rows that rounding alone moves are rows that nothing moves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.engines.equations import system_of
from crossbody.reference.linear import LinearModel, linearise

RADIUS = 0.2
AXES = {"x": (1.0, 0.0, 0.0), "z": (0.0, 0.0, 1.0)}


def between_plates(turn: tuple[float, ...]) -> LinearModel:
    """The model where it rests; the plate's plane stands so in its body."""
    bodies = (
        Body(name="ball", mass=1.0, inertia=(0.016, 0.016, 0.016, 0.0, 0.0, 0.0), position=(0.0, 0.0, RADIUS)),
        Body(name="plate", mass=1.5, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0), position=(0.0, 0.0, 2.0 * RADIUS)),
    )
    slides = tuple(Joint(name=f"{name} {k}", body=name, type="slide", axis=AXES[k])
                   for name in ("ball", "plate") for k in "xz")  # fmt: skip
    joints = (*slides[:2], Joint(name="turn", body="ball", type="hinge", axis=(0.0, 1.0, 0.0)), *slides[2:])
    shapes = (
        Shape(name="floor", type="plane"), Shape(name="ball", body="ball", size=(RADIUS, 0.0, 0.0)),
        Shape(name="under", body="plate", type="plane", orientation=turn),
    )  # fmt: skip
    pairs = tuple(Pair(name=one, first=one, second="ball", dimension=3, friction=(0.5, 0.5, 0.0, 0.0, 0.0))
                  for one in ("floor", "under"))  # fmt: skip
    scene = Scene(bodies=bodies, joints=joints, shapes=shapes, pairs=pairs, gravity=(0.0, 0.0, -9.81))
    case = cases.from_scene(scene, q0=np.zeros(5), t_end=1.0)
    found: LinearModel = linearise(system_of(case), case.q0, case.v0, active=[0, 1], reduce=True)
    return found


@pytest.mark.parametrize("axis", [(1.0, 0.0), (0.0, 1.0), (0.6, 0.8)])
def test_a_plane_that_is_turned_over_by_rounding_is_one_that_is_turned_over(axis: tuple[float, float]) -> None:
    exact, rounded = between_plates((0.0, *axis, 0.0)), between_plates((math.cos(0.5 * math.pi), *axis, 0.0))
    assert rounded.states == exact.states
    np.testing.assert_allclose(np.sort(rounded.poles().real), np.sort(exact.poles().real), atol=1e-6)
