"""Motions of scenes drawn at random do not depend on the tolerance before they say that they may."""

from __future__ import annotations

import pytest
from friction_scenes import drawn
from tolerances import ALLOWED, Tolerances

TOLERANCES = (1e-6, 1e-7, 1e-9)
BLOCK, BLOCKS = 20, 30
QUICK = tuple(range(12_000, 12_020))
WENT_ASTRAY = {
    "a sticking foot that drifts slid along its error": (10150,),
    "rounding chose which of rows that depend on each other press": (10104,),
    "a jam that rounding passed, or that no step reached": (10041,),
    "corrections below rounding never ended": (10000, 10440),
    "a slip passed zero by small steps": (10318,),
    "a contact pressed for a part of a long step alone, before another touch": (10454,),
}


def agrees(seed: int) -> None:
    scene, q, v, _, t_end = drawn(seed)
    at = Tolerances(scene, q, v, t_end)
    for rtol in TOLERANCES:
        worst, told = at.parted(rtol)
        assert worst < ALLOWED, (seed, told)


@pytest.mark.parametrize("seed", [pytest.param(s, id=f"{why}: {s}") for why, all_ in WENT_ASTRAY.items() for s in all_])
def test_motions_that_depended_on_the_tolerance(seed: int) -> None:
    agrees(seed)


@pytest.mark.parametrize("seed", QUICK)
def test_tolerances_agree_until_a_run_says_more(seed: int) -> None:
    agrees(seed)


@pytest.mark.slow
@pytest.mark.parametrize("block", range(BLOCKS))
def test_tolerances_agree_in_six_hundred_scenes(block: int) -> None:
    for seed in range(10_000 + BLOCK * block, 10_000 + BLOCK * (block + 1)):
        agrees(seed)
