"""A run that says at another time than forces act is told, of every engine that steps, and none that is right."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Acts, Case
from crossbody.reports.judging.acting import SUMS, misacting, uncertain
from crossbody.reports.judging.run_verdicts import Entry, verdicts
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.measuring.impulse import cumulative
from crossbody.reports.measuring.momenta import unseen

RUNS = (
    ("bouncing_ball:linear", "mujoco:default"), ("bouncing_ball:linear", "mujoco:matched"),
    ("bouncing_ball:listing", "pinocchio:admm"), ("bouncing_ball:listing", "pymunk:matched"),
    ("bouncing_ball:linear", "dart:matched"), ("bouncing_ball:listing", "drake:matched"),
    ("sliding_block:stops", "dart:default"), ("sliding_block:turns", "pinocchio:admm"),
    ("held_weight:slips", "mujoco:default"), ("delta_free:light", "mujoco:default"),
)  # fmt: skip
BALL = """<mujoco><option integrator="{}" timestep="{}"/><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body name="ball" pos="0 0 {}"><freejoint/><geom type="sphere" size=".1" mass="1"/></body></worldbody></mujoco>"""


def ran(case: Case, who: str, **settings: Any) -> Entry:
    name, _, profile = who.partition(":")
    try:
        run = engines.load(name).prepare(case, profile, **settings)
    except cases.EngineUnavailable as error:
        pytest.skip(str(error))
    return Entry(engine=name, profile=profile, settings=run.settings, run=run.run())


def others(acts: Acts) -> Iterator[Acts]:
    """What else may be said; both are at instants, and trapezoids of what follows forces show no difference."""
    return (one for one in Acts if one != acts and {one, acts} != {Acts.AT, Acts.GRID})


@pytest.mark.parametrize(("label", "who"), RUNS)
def test_forces_that_are_told_of_another_step_are_told(label: str, who: str) -> None:
    case = cases.load(*label.split(":"))
    entry = ran(case, who)
    assert entry.run is not None
    assert list(misacting(case, entry.settings, entry.run)) == []
    wrong = [one for one in others(entry.run.acts) if entry.run.acts != Acts.AT or one != Acts.GRID]
    for acts in wrong:
        told = list(misacting(case, entry.settings, replace(entry.run, acts=acts)))
        assert [value > 0.25 for value, _ in told] == [True], acts


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
def test_a_file_whose_method_is_told_as_another_is_told(integrator: str, seed: int, tmp_path: Path) -> None:
    """Thrown from anywhere with any step that resolves the contact."""
    draw, path = np.random.default_rng(seed), tmp_path / "ball.xml"
    path.write_text(BALL.format(integrator, draw.uniform(1e-3, 4e-3), draw.uniform(0.12, 0.3)))
    case = cases.from_file(path, t_end=0.8, friction=1)
    entry = ran(case, "mujoco:as_is")
    assert entry.run is not None
    right = Acts.GRID if integrator == "RK4" else Acts.BEHIND
    for acts in Acts:
        told = list(misacting(case, entry.settings, replace(entry.run, acts=acts)))
        assert bool(told) == (acts != right), (acts, told)


def test_it_is_a_row_of_a_run() -> None:
    case = cases.load("bouncing_ball", "linear")
    entry = ran(case, "mujoco:default")
    assert entry.run is not None
    late = replace(entry, run=replace(entry.run, acts=Acts.BEFORE))
    rows = [row for row in verdicts(case, late, truth_of(case), "") if row.metric == "impulses (control)"]
    assert [(row.verdict, row.value > 1.0) for row in rows] == [("outside", True)]
    assert "over the steps that end at its samples" in rows[0].why


@pytest.mark.parametrize("seed", range(4))
def test_sums_that_samples_do_not_tell_are_not_judged_and_say_how_far_they_are_off(seed: int, tmp_path: Path) -> None:
    """Stages of Runge-Kutta's steps push where no sample does: a sum is off by what the momentum of the ball tells."""
    draw, path = np.random.default_rng(seed), tmp_path / "ball.xml"
    path.write_text(BALL.format("RK4", draw.uniform(2e-3, 5e-3), draw.uniform(0.12, 0.3)))
    case = cases.from_file(path, t_end=0.8, friction=1)
    entry = ran(case, "mujoco:as_is")
    assert entry.run is not None
    run = entry.run
    gained = run.v[:, 2] - run.v[0, 2] + 9.81 * run.t
    off = np.max(np.abs(cumulative(run)[:, 0] - gained)) / np.max(np.abs(gained))
    assert unseen(run, case) == pytest.approx(off, rel=0.1)
    rows = {row.metric: row for row in verdicts(case, entry, truth_of(case), "") if row.metric in SUMS}
    assert {"lam_impulse", "lam_impulse_path"} <= set(rows)
    assert {row.verdict for row in rows.values()} == {"not judged"}
    assert all("trapezoids" in row.why for row in rows.values())
    fine = replace(run, lam=0.0 * run.lam, acts=Acts.BEHIND)
    assert uncertain(case, fine) == {}
