"""What the sources of a truth tell of touches beside their motion is held against each other."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from friction_scenes import sphere_on_floor

from crossbody import engines
from crossbody.cases import Case, Trajectory, load
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import RowLaw
from crossbody.reports.judging import truth as judging
from crossbody.reports.judging.told import runs_of, sentence
from crossbody.reports.judging.truth_row import touching, truth_row
from crossbody.reports.judging.verdict import Word
from crossbody.reports.measuring.scale import energy
from crossbody.reports.measuring.truth import Truth

RADIUS = 0.1


@cache
def pressed(seed: int) -> tuple[Case, Truth]:
    """Return a sphere that begins below a floor, at a depth and with velocities that are drawn, and its truth."""
    draw = np.random.default_rng(seed)
    deep = float(draw.uniform(1e-3, 1e-2))
    v = [*draw.uniform(-1.0, 1.0, 2), draw.uniform(-0.5, 0.5), *draw.uniform(-5.0, 5.0, 3)]
    scene = sphere_on_floor(draw.uniform(0.1, 0.8), RADIUS, law=RowLaw(a0=1e4, a1=5.0))
    case = case_of(scene, q0=[0, 0, RADIUS - deep, 1, 0, 0, 0], v0=v, t_end=0.3, name="pressed")
    return case, judging.truth_of(case)


@pytest.mark.parametrize("seed", range(5))
def test_sources_tell_the_same_of_what_touches_gave_out(seed: int) -> None:
    case, truth = pressed(seed)
    assert truth.witness == ("reference", "cvode")
    assert truth.trajectory.energy_handed > 0.0
    assert {"energy_gained", "energy_handed", "contact_work", "energy_integrator"} <= truth.agreement.keys()
    assert truth_row(case, truth, "")[0].verdict == Word.WITHIN


def more(run: Trajectory, name: str) -> Trajectory:
    """Return a motion that tells another number of something, and is the same but for that."""
    if hasattr(run, name):
        return replace(run, **{name: getattr(run, name) + 1e-5 * energy(run)})
    return replace(run, counts={**run.counts, name: run.counts.get(name, 0) + 1})


@pytest.mark.parametrize("name", ["energy_gained", "energy_handed", "starts_inside"])
@pytest.mark.parametrize("seed", range(3))
def test_a_source_that_tells_something_else_of_touches_is_no_witness(
    seed: int, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    case, _ = pressed(seed)
    second = judging._in_time

    def planted(case: Case, solver: str, *args: Any) -> Trajectory:
        return more(second(case, solver, *args), name)

    monkeypatch.setattr(judging, "_in_time", planted)
    row = truth_row(case, judging.truth_of(case), "")[0]
    assert row.verdict == Word.OUTSIDE
    assert row.why.startswith(f"The difference of its sources in {name} is ")
    said = sentence(runs_of([row.row()]))
    assert f"The difference of its sources in {name} is" in said
    assert "times its limit" not in said


@pytest.mark.parametrize("touches", [True, False])
def test_engines_that_all_touch_where_the_truth_does_not_are_told(touches: bool) -> None:
    case = load("bouncing_ball", "linear", t_end=1.0 if touches else 0.1)
    truth = judging.truth_of(case)
    run = engines.load("reference").prepare(load("bouncing_ball", "linear", t_end=1.0), "compiled").run()
    none = replace(run, events=(), mode=np.zeros_like(run.mode))
    early = replace(run, events=tuple(replace(one, t=0.01 * (1 + k)) for k, one in enumerate(run.events[:2])))
    (row,) = touching(case, truth, [none, none] if touches else [early, early], "")
    assert row.verdict == Word.INFO
    said = {"engine": "mujoco", "profile": "matched", "metric": "position", "verdict": "within", "value": 0.0}
    ran = row.row() | said | {"limit": 1.0}
    assert ("none of any engine" if touches else "some of every engine") in sentence(runs_of([row.row(), ran]))
    assert touching(case, truth, [none, early], "") == []
