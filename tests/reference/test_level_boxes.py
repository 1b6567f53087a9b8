"""Two level boxes on each other that are thrown up by a floor they start in.

They touch each other and the floor at almost the same instants, so that heights depend on the order of these; and where
they let go no load is left on contacts that depend on each other.
"""

from __future__ import annotations

import numpy as np
import pytest
from friction_scenes import HALF, Joint, RowLaw, Scene, Shape, account, box_body, pair, run

from crossbody.cases import Outcome, Trajectory

DEEP, T_END = 0.01, 0.5
QUICK = (*range(12), 38, 40, 179)  # of the last three rounding had one corner bear the upper box where the lower lands


def two(mu: float, masses: tuple[float, float], law: RowLaw) -> Scene:
    bodies = tuple(box_body(name, HALF, mass) for name, mass in zip(("low", "high"), masses, strict=True))
    return Scene(
        bodies=bodies, joints=tuple(Joint(name=body.name, body=body.name, type="free") for body in bodies),
        shapes=(
            Shape(name="floor", type="plane"), Shape(name="low", body="low", type="box", size=HALF),
            Shape(name="top", body="low", type="plane", position=(0.0, 0.0, HALF[2])),
            Shape(name="high", body="high", type="box", size=HALF),
        ),
        pairs=(pair("floor", "low", mu, law), pair("top", "high", mu, law)),
    )  # fmt: skip


def thrown(scene: Scene, rtol: float) -> Trajectory:
    low = HALF[2] - DEEP
    return run(scene, [0, 0, low, 1, 0, 0, 0, 0, 0, low + 2 * HALF[2], 1, 0, 0, 0], np.zeros(12), T_END, rtol=rtol)


@pytest.mark.parametrize("rtol", [1e-5, 1e-6, 1e-7, 1e-9])
@pytest.mark.parametrize("mu", [0.5, 1.0, 1.887])
def test_level_boxes_land(mu: float, rtol: float) -> None:
    masses, law = (0.8439025393404018, 1.3545818249020878), RowLaw(a0=11800.0, a1=39.0)
    motion = thrown(two(mu, masses, law), rtol)
    assert motion.outcome is Outcome.FINISHED, motion.message
    assert account(motion) < 1e3 * rtol


@pytest.mark.parametrize("seed", [pytest.param(k, marks=() if k in QUICK else pytest.mark.slow) for k in range(200)])
def test_level_boxes_of_any_weight_land(seed: int) -> None:
    rng = np.random.default_rng(seed)
    law = RowLaw(a0=float(10 ** rng.uniform(3.5, 4.5)), a1=float(rng.uniform(5.0, 100.0)))
    scene = two(float(rng.uniform(0.3, 2.0)), tuple(rng.uniform(0.5, 2.0, 2).tolist()), law)
    motion = thrown(scene, float(10 ** rng.uniform(-9, -5)))
    assert motion.outcome is Outcome.FINISHED, motion.message
