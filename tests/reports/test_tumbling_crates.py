"""Boxes that tumble on a floor with friction: nothing that is said of the reference is an alarm."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import Case
from crossbody.reports.judging.verdict import Word
from crossbody.reports.runs import jobs, study

CRATE = """
<mujoco><compiler angle="radian"/><default><geom friction="{mu} 0 0"/></default><worldbody>
<geom name="floor" type="plane" size="5 5 .1"/>
<body pos="0 0 {z}" euler="{euler}"><freejoint/><geom name="crate" type="box" size="{size}" {heavy}/></body></worldbody>
<keyframe><key name="k" {key}/></keyframe></mujoco>
"""


def drawn(seed: int, least: float = 0.1) -> str:
    """Return the file of a box of any size, spin, pose and friction, at least so much, that falls upon a floor."""
    rng = np.random.default_rng(seed)
    size, quat = rng.uniform(0.03, 0.2, 3), rng.normal(size=4)
    spin, v = rng.normal(size=3) * 10.0 ** rng.uniform(-1.0, 0.7), rng.normal(size=3) * [0.5, 0.5, 0.2]
    mu, z = max(10.0 ** rng.uniform(-1.0, 0.3), least), float(np.linalg.norm(size)) + rng.uniform(0.0, 0.05)
    density, said = rng.uniform(100.0, 2000.0), partial(np.array2string, max_line_width=1000, floatmode="unique")
    pose, rates = (str(said(np.array(x)))[1:-1] for x in ([0.0, 0.0, z, *quat / np.linalg.norm(quat)], [*v, *spin]))
    return CRATE.format(
        mu=mu, z=z, euler="0 0 0", size=str(said(size))[1:-1], heavy=f'density="{density}"',
        key=f'qpos="{pose}" qvel="{rates}"',
    )  # fmt: skip


def crate(folder: Path, text: str, **given: Any) -> Case:
    path = folder / "crate.xml"
    path.write_text(text, encoding="utf-8")
    return cases.from_file(path, **given)


def alarms(case: Case, *others: tuple[str, str]) -> list[tuple[str, str, float, str]]:
    """Return engine, metric, number and reason of every row that is outside in a run of the reference and others."""
    picks = tuple(jobs.Pick(engine=engine, profile=profile) for engine, profile in (("reference", "compiled"), *others))
    rows = study.judge([jobs.run_case(case, picks, budget=2.0)], {case.label: ""})
    outside = [row for row in rows if row["verdict"] in (Word.OUTSIDE, Word.CRASHED)]
    return [(row["engine"], row["metric"], row["value"], row["why"]) for row in outside]


TIPPED = CRATE.format(mu=1, z=0.3, euler=".3 .2 0", size=".1 .15 .2", heavy='mass="2"', key="")
FALLS = CRATE.format(mu=1, z=0.6, euler=".3 .2 0", size=".1 .08 .05", heavy='density="500"', key="")


def test_a_crate_of_which_two_corners_switch_within_nanoseconds(tmp_path: Path) -> None:
    """One lets go and presses again .3 ns later, as another one stops; its other slides are hardly any."""
    assert alarms(crate(tmp_path, TIPPED, t_end=0.6), ("mujoco", "as_is")) == []


def test_a_crate_of_which_a_corner_is_tried_and_sticks_as_before(tmp_path: Path) -> None:
    """At 1e-9 a corner that slides at 4e-8 m/s sticks for .2 ms, at 1e-12 it does not; the motion is 4e-11 off."""
    assert alarms(crate(tmp_path, FALLS, t_end=0.5)) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", [6, 7, 14, 16, 24, 29])
def test_a_crate_that_comes_to_rest_by_slips_that_have_no_direction(seed: int, tmp_path: Path) -> None:
    """No tolerance determines friction of such slips, nor what lets go or holds beside them; each does their motion."""
    assert alarms(crate(tmp_path, drawn(seed, least=1.0), key="k", t_end=0.5)) == []


QUICK = (4, 13, 18, 21, 28)
"""They leave soon what their files cover."""


@pytest.mark.parametrize("seed", [pytest.param(k, marks=() if k in QUICK else pytest.mark.slow) for k in range(30)])
def test_a_crate_that_tumbles_is_no_alarm(seed: int, tmp_path: Path) -> None:
    assert alarms(crate(tmp_path, drawn(seed), key="k", t_end=0.5)) == []
