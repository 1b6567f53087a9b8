"""Capsules that lie on a slope: one foot sticks, and how the other one slips, hardly at all, is stiff."""

from __future__ import annotations

import numpy as np
import pytest
from friction_scenes import pair, run

from crossbody.cases import Outcome
from crossbody.cases.scene import Body, Joint, RowLaw, Scene, Shape

RADIUS, HORIZON = 0.05, 0.4
MOST_STEPS = 20_000
HARDLY_SLIP = (55, 84, 112, 156, 175, 240, 251)
"""Of which a foot slips by a part of 1e-8 of what turns, for long."""


def lying(seed: int) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Draw a capsule that turns about one of its ends on a rough slope, and rolls."""
    rng = np.random.default_rng([seed, 67])
    half, mass, mu = rng.uniform(0.1, 0.2), 10.0 ** rng.uniform(-1, 1), rng.choice([0.8, 1.5])
    law = RowLaw(a0=10.0 ** rng.uniform(3.3, 4.7), a1=10.0 ** rng.uniform(1, 2))
    slope, to = rng.uniform(0.3, 1.0) * np.arctan(mu), rng.uniform(-np.pi, np.pi)
    across = mass * half**2 / 3.0
    scene = Scene(
        bodies=(Body(
            name="b", mass=mass, com=(0.0, 0.0, rng.uniform(-0.7, 0.7) * half),
            inertia=(across, across, mass * RADIUS**2 / 2.0, 0.0, 0.0, 0.0),
        ),),
        joints=(Joint(name="free", body="b", type="free"),),
        shapes=(Shape(name="floor", type="plane"), Shape(name="s", body="b", type="capsule", size=(RADIUS, half, 0.0))),
        pairs=(pair("floor", "s", mu, law),),
        gravity=(
            9.81 * np.sin(slope) * np.cos(to), 9.81 * np.sin(slope) * np.sin(to), -9.81 * np.cos(slope),
        ),
    )  # fmt: skip
    turn, roll = 3.0 * rng.normal(size=2)
    foot = half * rng.choice([-1.0, 1.0])
    start = np.array([0.0, 0.0, RADIUS, np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])
    return scene, start, np.array([0.0, -turn * foot, 0.0, -turn, 0.0, roll])


@pytest.mark.parametrize("rtol", [1e-9, 1e-10, 1e-11])
@pytest.mark.parametrize("seed", [*range(6), *HARDLY_SLIP])
def test_slips_of_rounding_s_size_are_left_to_the_implicit_method(seed: int, rtol: float) -> None:
    """Explicit steps that follow them are so short that their stages do not show how stiff they are."""
    scene, q, v = lying(seed)
    found = run(scene, q, v, HORIZON, rtol=rtol, max_steps=MOST_STEPS)
    assert found.outcome in (Outcome.FINISHED, Outcome.PAINLEVE), found.message
