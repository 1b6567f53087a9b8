"""What a plan says is what is run: settings, time limits, and who is the witness of the truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from crossbody import cases
from crossbody.cases import Outcome, Tier
from crossbody.engines.reference import Reference
from crossbody.reports.commands import planned
from crossbody.reports.judging import truth
from crossbody.reports.runs import choice, jobs

SLIDES = """<mujoco><option timestep=".002"/><worldbody><geom name="floor" type="plane" size="5 5 .1" friction=".5"/>
<body name="ball" pos="0 0 .1"><freejoint name="free"/><geom name="g" type="sphere" size=".1" mass="1" friction=".5"/>
</body></worldbody><keyframe><key name="k" qpos="0 0 .1 1 0 0 0" qvel="2 0 0 0 0 0"/></keyframe></mujoco>"""

LOOP = """<mujoco><worldbody><body name="crank"><joint name="a" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .2 0 0" size=".01" mass=".2" contype="0" conaffinity="0"/>
<body name="coupler" pos=".2 0 0"><joint name="b" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".01" mass=".4" contype="0" conaffinity="0"/></body></body>
<body name="rocker" pos="1 0 0"><joint name="c" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 -.4 0 0" size=".01" mass=".4" contype="0" conaffinity="0"/></body></worldbody>
<equality><connect name="pin" body1="coupler" body2="rocker" anchor=".4 0 0"/></equality></mujoco>"""
"""A four-bar linkage whose links are aligned at the start."""


@pytest.fixture
def slides(tmp_path: Path) -> Any:
    (tmp_path / "slides.xml").write_text(SLIDES)
    return cases.load(str(tmp_path / "slides.xml"), "k", t_end=0.1)


def test_the_witness_of_a_truth_is_not_run_again_unless_it_is_asked_for(
    slides: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, whole = Reference.prepare, list[float]()

    def prepare(self: Any, case: Any, profile: str = "compiled", **more: Any) -> Any:
        whole.extend([case.t_end] if profile == "cvode" and case.t_end == slides.t_end else [])
        return own(self, case, profile, **more)

    monkeypatch.setattr(Reference, "prepare", prepare)
    result = jobs.run_case(slides, choice.picks(["reference"]), refine=False)
    assert result.truth.witness == ("reference", "cvode")
    told = {entry.profile: entry.skipped for entry in result.entries}
    assert told["cvode"] == "It is the witness of the truth. -e reference:cvode runs it again."
    assert len(whole) == 1
    (entry,) = jobs.run_case(slides, choice.picks(["reference:cvode"]), refine=False, truth=result.truth).entries
    assert entry.run is not None


def test_a_witness_that_took_all_its_time_is_not_run_again(slides: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(truth, "OF_FILES", 1e-9)
    result = jobs.run_case(slides, choice.picks(["reference"]), refine=False)
    assert result.truth.spent == ("reference", "cvode")
    assert result.truth.tier is Tier.D
    told = {entry.profile: entry.skipped for entry in result.entries}
    assert told["cvode"] == "As the witness of the truth it took all its time. -e reference:cvode runs it again."


def test_no_witness_is_asked_which_way_a_mechanism_leaves_a_dead_centre(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The equations leave it open: no other integrator knows better, however long it searches."""
    (tmp_path / "loop.xml").write_text(LOOP)
    monkeypatch.setattr(truth, "_witness", lambda *_: pytest.fail("it is run all the same"))
    case = cases.load(str(tmp_path / "loop.xml"), "reference")
    found = truth.truth_of(case)
    assert found.trajectory.outcome is Outcome.ILL_POSED
    assert (found.tier, found.witness, found.spent) == (Tier.D, ("", ""), ("", ""))


@pytest.mark.parametrize("budget", [3.0, 5.0])
def test_a_plan_has_the_settings_of_the_run(slides: Any, budget: float) -> None:
    picks = choice.picks(["reference", "mujoco"])
    plan = {(engine, profile): told for engine, profile, told in planned._planned(slides, picks, {}, None, budget)}
    assert plan["reference", "cvode"]["time_limit"] == choice.DEAR * budget  # type: ignore[index]
    result = jobs.run_case(slides, picks, refine=False, budget=budget)
    ran = {(one.engine, one.profile): one.settings for one in result.entries if one.run is not None}
    assert len(ran) > 1
    for who, settings in ran.items():
        assert {name: plan[who][name] for name in settings} == settings  # type: ignore[index]
