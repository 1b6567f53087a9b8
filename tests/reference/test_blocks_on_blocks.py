"""Blocks that stand on each other, and that nothing pushes aside, stay where they are whatever they weigh."""

from __future__ import annotations

import numpy as np
import pytest
from friction_scenes import pair, run

from crossbody.cases import Outcome
from crossbody.cases.scene import Body, Joint, RowLaw, Scene, Shape

LAW = RowLaw(a0=2e4, a1=80.0)
FOOT, TOP = 0.05, 0.4  # m, radius of feet, and where the upper block stands
STILL = 1e-12


def stacked(rng: np.random.Generator, blocks: int) -> Scene:
    """Draw blocks that only slide, each on one foot upon the one below it."""
    names, floors = [f"b{i}" for i in range(blocks)], ["floor", *(f"top{i}" for i in range(blocks - 1))]
    axes = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    tops = (
        Shape(name=f"top{i}", body=f"b{i}", type="box", size=(1.0, 1.0, 0.1), position=(0.0, 0.0, 0.2))
        for i in range(blocks - 1)
    )
    return Scene(
        bodies=tuple(Body(name=n, mass=10.0 ** rng.uniform(-1, 1), inertia=(1, 1, 1, 0, 0, 0)) for n in names),
        joints=tuple(Joint(name=n + k, body=n, type="slide", axis=axis) for n in names for k, axis in axes.items()),
        shapes=(
            Shape(name="floor", type="plane"), *tops,
            *(Shape(name=f"foot{i}", body=n, type="sphere", size=(FOOT, 0, 0)) for i, n in enumerate(names)),
        ),
        pairs=tuple(pair(floor, f"foot{i}", rng.uniform(0.05, 1.2), LAW) for i, floor in enumerate(floors)),
    )  # fmt: skip


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-11])
@pytest.mark.parametrize("seed", range(30))
def test_a_stack_at_rest_stays(seed: int, rtol: float) -> None:
    """What rounding leaves of forces aside is rounding, beside the loads that the same rows carry."""
    rng = np.random.default_rng([seed, 61])
    blocks = int(rng.integers(2, 4))
    scene = stacked(rng, blocks)
    start = np.array([[0.0, 0.0, FOOT + i * (TOP - FOOT)] for i in range(blocks)]).ravel()
    found = run(scene, start, np.zeros(3 * blocks), 0.3, rtol=rtol)
    assert found.outcome is Outcome.FINISHED, found.message
    aside = np.arange(3 * blocks) % 3 != 2
    assert np.abs(found.q[:, aside]).max() <= STILL
