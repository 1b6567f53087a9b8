"""Scenes drawn at random, with up to 32 corners, friction, dry joints and none: what has to hold of every motion."""

from __future__ import annotations

import pytest
from friction_obeyed import obeys
from friction_scenes import drawn, run

from crossbody.cases import Outcome

BLOCK, BLOCKS = 50, 40
WENT_ASTRAY = {
    "frictionless corners beside joints that rub": (10014, 10104, 10293, 10343, 10346, 10362, 11157, 11638, 11665),
    "rows that depend on each other contradict later": (10111, 10232, 10282, 10292, 10299),
    "forces that grow towards a jam": (10252, 10521, 10815, 10922, 11473, 11759, 11792),
    "a candidate's noise hid where others let go": (10954,),
    "shares of least norm with and without a contact": (10999, 11631),
    "a jam that forces do not tell": (11613,),
    "rows that nearly depend on each other are pulled back": (11877, 20712),
}


def obeyed(seed: int, steps: int = 150_000) -> int:
    scene, q, v, mu, t_end = drawn(seed)
    motion = run(scene, q, v, t_end, rtol=1e-6, max_steps=steps)
    assert motion.outcome in (Outcome.FINISHED, Outcome.PAINLEVE), (seed, motion.message)
    return obeys(scene, motion, mu, 1e-6)


@pytest.mark.parametrize("seed", [pytest.param(s, id=f"{why}: {s}") for why, all_ in WENT_ASTRAY.items() for s in all_])
def test_scenes_that_went_astray(seed: int) -> None:
    obeyed(seed, 20_000)


@pytest.mark.slow
@pytest.mark.parametrize("block", range(BLOCKS))
def test_two_thousand_scenes(block: int) -> None:
    seeds = range(10_000 + BLOCK * block, 10_000 + BLOCK * (block + 1))
    assert sum(obeyed(seed) for seed in seeds) > BLOCK
