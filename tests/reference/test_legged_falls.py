"""Robots on legs that fall on a tilted floor: feet that come close to jams, and joints that rub."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from legged import legged

from crossbody import cases, engines
from crossbody.cases import Trajectory
from crossbody.engines.equations import system_of

TOLERANCES = (1e-6, 3e-7, 1e-9)
WENT_ASTRAY = (8, 14, 17, 20, 30, 36, 37, 43, 51, 76)
"""Robots of which runs at one of the tolerances jammed, or were not determined, where those at the others went on."""
PULLS = 1e-5


def known_until(run: Trajectory) -> float:
    return min(float(run.t[-1]), run.unique_until, run.determined_until)


def fall(path: Path, seed: int, t_end: float) -> list[float]:
    """Until when runs at all tolerances are known; no contact pulls in any."""
    path.write_text(legged(seed), encoding="utf-8")
    case = cases.from_file(str(path), friction=1, t_end=t_end)
    system, known = system_of(case), []
    touches = np.flatnonzero((system.tangents > 0) & ~np.asarray(system.dry, bool))
    for rtol in TOLERANCES:
        run = engines.load("reference").prepare(case, "compiled", rtol=rtol).run()
        assert run.lam[:, touches].min() >= -PULLS * np.abs(run.lam).max()
        known.append(known_until(run))
    return known


@pytest.mark.parametrize("seed", WENT_ASTRAY)
def test_how_far_a_fall_is_known_does_not_depend_on_the_tolerance(tmp_path: Path, seed: int) -> None:
    known = fall(tmp_path / "robot.xml", seed, 0.15)
    assert max(known) - min(known) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_how_far_many_falls_are_known_does_not_depend_on_the_tolerance(tmp_path: Path, seed: int) -> None:
    known = fall(tmp_path / "robot.xml", seed, 0.19)
    assert max(known) - min(known) < 1e-3
