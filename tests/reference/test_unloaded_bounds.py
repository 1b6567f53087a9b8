"""Bounds that bear nothing stay undecided by rounding of what else is carried: robots that stand straight go on."""

from __future__ import annotations

import numpy as np
import pytest
from resting import run, standing

STILL = 1e-6
"""What rounding grows to by then: upright legs are not stable, the fastest by 50 a second."""


@pytest.mark.parametrize("seed", range(40))
def test_a_robot_that_stands_straight_goes_on_standing(seed: int) -> None:
    found = run(standing(seed))
    assert np.abs(found.q).max() < STILL
    assert len(found.events) < 60


@pytest.mark.parametrize(
    ("profile", "engine", "seed", "t_end"),
    [
        *(("cvode", "reference", seed, 0.02) for seed in range(8)),
        *(("law", "pinocchio", seed, 1e-4) for seed in (0, 2, 3, 6)),
        ("matched", "mujoco", 0, 0.02),
    ],
)
def test_in_other_engines_it_does_so_too(profile: str, engine: str, seed: int, t_end: float) -> None:
    assert np.abs(run(standing(seed, t_end=t_end), profile, engine).q).max() < STILL
