"""The reference beside its own truth on robots: no number of it is outside, and no control fails."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Mode, Tier
from crossbody.reports import metrics
from crossbody.reports.judging import audit, controls, truth
from crossbody.reports.judging.covered import covered
from crossbody.reports.judging.run_verdicts import Entry, verdicts
from crossbody.reports.judging.verdict import Word
from crossbody.reports.measuring.truth import from_run
from crossbody.reports.runs import jobs, study
from crossbody.reports.runs.store import Trace, load, save

FIVE_BAR = """
<mujoco><worldbody><geom name="floor" type="plane" size="5 5 1" friction=".6 0 0"/>
<body name="u0" pos=".15 0 .45"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .15 0 -.2" size=".02" mass=".3"
 contype="0" conaffinity="0"/><body name="l0" pos=".15 0 -.2"><joint axis="0 1 0"/><geom type="capsule"
 fromto="0 0 0 -.22 0 -.2" size=".015" mass=".2" contype="0" conaffinity="0"/><body name="p" pos="-.22 0 -.2">
<joint axis="0 1 0" damping=".01"/><geom type="sphere" size=".02" pos="-.15 0 -.03" mass=".02"/>
<geom type="sphere" size=".02" pos="0 0 -.03" mass=".02"/></body></body></body>
<body name="u1" pos="-.15 0 .45"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 -.15 0 -.2" size=".02"
 mass=".3" contype="0" conaffinity="0"/><body name="l1" pos="-.15 0 -.2"><joint axis="0 1 0"/><geom type="capsule"
 fromto="0 0 0 .22 0 -.2" size=".015" mass=".2" contype="0" conaffinity="0"/></body></body></worldbody>
<equality><connect body1="p" body2="l1" anchor="-.16 0 0" solref=".01 .5"/></equality></mujoco>
"""


FOUR_BAR = """
<mujoco><worldbody><geom name="floor" type="plane" size="5 5 1" friction=".5 0 0"/>
<body pos="0 0 .3490092739265187"><joint axis="0 1 0" frictionloss=".05"/><geom type="capsule" size=".02" mass=".4"
 fromto="0 0 0 .1 0 -.2" contype="0" conaffinity="0"/><body name="c" pos=".1 0 -.2"><joint axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".02" contype="0" conaffinity="0" mass=".6"/>
<geom type="sphere" pos=".2 0 -.1" size=".04900927392651871" mass=".2"/></body></body>
<body name="b" pos=".4 0 .3490092739265187"><joint axis="0 1 0" frictionloss=".05"/><geom type="capsule" size=".02"
 fromto="0 0 0 .1 0 -.2" contype="0" conaffinity="0" mass=".4"/></body></worldbody>
<equality><connect body1="c" body2="b" anchor=".4 0 0" solref=".01 .5"/></equality></mujoco>
"""


def robot(folder: Path, text: str, **given: Any) -> Case:
    """A robot's file as a case."""
    path = folder / "robot.xml"
    path.write_text(text, encoding="utf-8")
    return cases.from_file(path, **given)


@pytest.mark.parametrize(("name", "off"), [("a0", 1.05), ("a1", 0.95)])
def test_the_law_of_a_file_is_that_of_mujoco_itself(name: str, off: float, tmp_path: Path) -> None:
    """A stiffness by the square of dmax was 5 % off in every row of a file, and no run told."""
    path = cases.from_file(robot(tmp_path, FIVE_BAR).file)
    scene = path.scene
    assert scene is not None
    loop = scene.loops[0]
    law = replace(loop.law, **{name: off * getattr(loop.law, name)})
    shown = engines.load("mujoco").prepare(path, "as_is").audit()
    other = replace(path, scene=scene.replace(loops=(replace(loop, law=law),)))
    for case, same in ((path, True), (other, False)):
        (row,) = (row for row in audit.audit(shown, {}, case) if row.quantity == "law")
        assert row.ok == same
        assert same or row.difference == pytest.approx(abs(1.0 / off - 1.0), rel=1e-9)


def wrong(case: Case, profile: str = "compiled") -> list[tuple[str, str, float, str]]:
    """Engine, metric, number and reason of every row that is outside of a case in the reference."""
    result = jobs.run_case(case, (jobs.Pick(engine="reference", profile=profile, every=False),), budget=2.0)
    rows = study.judge([result], {case.label: ""})
    assert len(rows) > 5
    outside = [row for row in rows if row["verdict"] in (Word.OUTSIDE, Word.CRASHED)]
    return [(row["engine"], row["metric"], row["value"], row["why"]) for row in outside]


@pytest.mark.parametrize("text", [FIVE_BAR, FOUR_BAR], ids=["five-bar", "four-bar"])
def test_a_linkage_that_stands_with_rows_that_follow_from_others(tmp_path: Path, text: str) -> None:
    """One row of its loop has no multiplier, and its feet have gaps of rounding size, as have its coordinates.

    What sticks holds more than moves: shares of multipliers that exert no force are no size to measure the law by.
    """
    assert wrong(robot(tmp_path, text, t_end=0.05, friction=1)) == []


HELD = """
<mujoco><worldbody><body gravcomp="1"><joint name="arm" axis="0 1 0" armature=".1"/>
<geom type="capsule" fromto="0 0 0 .5 0 0" size=".03" mass="3"/>
<body pos=".5 0 0"><joint name="a" type="slide" axis="0 1 0"
 stiffness="{stiffness}"/><geom type="box" size=".01 .01 .02" mass=".02"/></body>
<body pos=".5 0 0"><joint name="b" type="slide" axis="0 -1 0"/><geom type="box" size=".01 .01 .02" mass=".02"/></body>
</body></worldbody><equality><joint joint1="a" joint2="b" solref=".01 1"/></equality>
<keyframe><key name="home" qpos="0 .001 .001" qvel="2 0 0"/></keyframe><contact/></mujoco>
"""


@pytest.mark.parametrize("stiffness", [0.3, 3.0, 3e3])
def test_an_arm_whose_couplings_carry_next_to_nothing(tmp_path: Path, stiffness: float) -> None:
    """A spring at one of two fingers that a row holds together: its force is far below what moves the arm, or not."""
    text = HELD.format(stiffness=stiffness)
    assert wrong(robot(tmp_path, text, t_end=0.2, without="contacts")) == []


BALLS = """
<mujoco><option gravity="0 0 0" timestep="1e-4"/>
<default><geom condim="3" friction=".3 0 0" solref=".01 .05" solimp=".9 .9 .001"/></default><worldbody>
<body pos="-.5 0 .0451"><freejoint/><geom type="sphere" size=".05" mass="1"/></body>
<body><freejoint/><geom type="sphere" size=".05" mass="1"/></body></worldbody>
<keyframe><key name="go" qpos="-.5 0 .0451 1 0 0 0 0 0 0 1 0 0 0" qvel="2.677 0 0 0 0 0 0 0 0 0 0 0"/></keyframe>
</mujoco>
"""


ROLLS_OFF = """
<mujoco><worldbody><geom type="box" size=".2 .2 .1" pos="0 0 -.1" friction=".5 0 0" condim="3"/>
<body pos=".17 0 .05"><freejoint/><geom type="sphere" size=".05" mass=".5" friction=".5 0 0" condim="3"/></body>
</worldbody><keyframe><key name="k" qpos=".17 0 .05 1 0 0 0" qvel=".3 .1 0 0 0 0"/></keyframe></mujoco>
"""


@pytest.mark.parametrize("speed", [0.2, 0.3, 0.5])
def test_a_ball_that_rolls_over_the_edge_of_a_table(tmp_path: Path, speed: float) -> None:
    """Where its gap is that of the edge, no longer of the face, the curvature jumps, and the force with it."""
    case = robot(tmp_path, ROLLS_OFF.replace(".3 .1", f"{speed} .1"), key="k", t_end=0.25)
    assert wrong(case) == []


TUMBLES = """
<mujoco><worldbody><geom type="plane" size="2 2 .1" condim="3" friction="1 .005 .0001"/>
<body pos="0 0 .25" euler="35 20 10"><freejoint/><geom type="box" size=".05 .05 .05" mass="1" condim="3"
friction="1 .005 .0001"/></body></worldbody><keyframe><key name="k" qpos="0 0 .2 .00125712137695683 .3052947823033319
-.2801476385953972 -.9101158256692538" qvel="-.1364012355515168 -.2974939664989387 0 4.0206457366636 -1.476619555653989
-1.8614246994598211"/></keyframe></mujoco>
"""


def test_a_box_that_slides_on_a_corner_near_a_jam(tmp_path: Path) -> None:
    """Doubled, its friction asks for a normal force far larger than the doubled one is off by."""
    assert wrong(robot(tmp_path, TUMBLES, key="k", t_end=0.2)) == []


def test_a_slide_so_short_that_a_fault_of_it_is_no_larger_than_errors_grow(tmp_path: Path) -> None:
    assert wrong(robot(tmp_path, BALLS, t_end=0.3)) == []


def test_free_balls_without_gravity_have_the_forces_of_another_program(tmp_path: Path) -> None:
    """None but for rounding, which is no difference."""
    case = robot(tmp_path, BALLS)
    mine, theirs = (engines.load(name).prepare(case, profile).audit() for name, profile in ENGINES)
    found = {row.quantity: row for row in audit.audit(mine, theirs, case)}
    assert found["bias"].ok
    off = {**mine, "bias": lambda q, v: np.asarray(mine["bias"](q, v)) + 1e-6}
    assert not {row.quantity: row for row in audit.audit(off, theirs, case)}["bias"].ok


ENGINES = (("mujoco", "as_is"), ("reference", "compiled"))


PUCK = """
<mujoco><worldbody><geom type="plane" size="1 1 1"/><body pos="0 0 .02"><freejoint/>
<geom type="cylinder" size=".1 .02" mass="1"/></body></worldbody>
<keyframe><key name="shove" qpos="0 0 .02 1 0 0 0" qvel="{} {} 0 0 0 {}"/></keyframe></mujoco>
"""


@pytest.mark.parametrize("seed", range(3))
def test_friction_opposes_the_slip_of_the_points_on_which_a_puck_stands(tmp_path: Path, seed: int) -> None:
    """They are those that lie where its load leans to at the start."""
    text = PUCK.format(*np.random.default_rng(seed).uniform(-1.0, 1.0, 2), 5.0)
    case = robot(tmp_path, text, t_end=0.05, friction=1, without="rolling")
    run = engines.load("reference").prepare(case, "compiled").run()
    assert np.isin(run.mode, Mode.SLIP).any()
    angle = metrics.of(case)["friction_angle"].measure(from_run(run, Tier.D, ""), run, case)
    assert angle is not None
    assert angle < 1e-9


CAN = """
<mujoco><default><geom solref="-5000 -50"/></default><worldbody><geom type="plane" size="2 2 .1"/>
<body pos="0 0 .07"><freejoint/><geom type="capsule" size=".05 .1" mass="1" euler="0 90 0"/></body></worldbody>
</mujoco>
"""


def test_a_can_that_lands_flat_and_never_slips_has_no_angle_of_friction(tmp_path: Path) -> None:
    """Its ends open at one instant, one behind the other: what the last one slips by there is rounding."""
    case = covered(robot(tmp_path, CAN, t_end=0.2), 5.0)
    run = engines.load("reference").prepare(case, "compiled").run()
    assert np.isin(run.mode, Mode.SLIP).any()
    assert metrics.of(case)["friction_angle"].measure(from_run(run, Tier.D, ""), run, case) is None
    measured = metrics.of(case)["lam_impulse_path"].measure(from_run(run, Tier.D, ""), run, case)
    assert measured is None or measured < 1e-9


RUBBER = """
<mujoco><worldbody><geom type="plane" size="9 9 .1" friction="{mu} 0 0"/><body pos="0 0 .2">
<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
<geom type="sphere" size=".1" mass="1" friction="{mu} 0 0"/></body></worldbody>
<keyframe><key name="s" qpos="0 -.05" qvel="9 0"/></keyframe></mujoco>
"""


@pytest.mark.parametrize("mu", [0.5, 6.0, 40.0])
def test_controls_of_forces_hold_whatever_a_coefficient_of_friction_is(tmp_path: Path, mu: float) -> None:
    """The largest force may be friction, which is measured by what pushes."""
    case = covered(robot(tmp_path, RUBBER.format(mu=mu), key="s", t_end=0.2), 5.0)
    known = from_run(engines.load("reference").prepare(case, "compiled").run(), Tier.D, "")
    assert (known.trajectory.mode == Mode.SLIP).any()
    assert [found for found in controls.unseen(case, known, lambda *_: True) if found[0] == "law_residual"] == []


def test_a_truth_whose_witness_takes_too_long_is_held_to_the_same_budget(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    budgets, growing = [], truth._growing

    def told(*given: Any) -> Any:
        budgets.append(given[-1])
        return growing(*given)

    monkeypatch.setattr(truth, "_growing", told)
    monkeypatch.setattr(truth, "OF_WITNESS", 1e-9)
    truth.truth_of(robot(tmp_path, BALLS, t_end=0.05, friction=1), budget=1.5)
    assert budgets == [1.5]


@pytest.mark.parametrize("a1", [1e4, 1e5, 1e6])
def test_a_stiff_row_that_is_always_on_and_starts_off_its_law(a1: float) -> None:
    """It brings the ball to its rate within 1/a1, between two samples."""
    case = cases.load("bouncing_ball", "bilateral", a0=100.0 * a1, a1=a1, a2=0.0)
    assert wrong(case) == []


def test_velocities_that_are_wrong_are_outside_where_samples_tell() -> None:
    case = cases.load("bouncing_ball", "bilateral")
    known = truth.truth_of(case)
    fast = replace(known.trajectory, v=1.1 * known.trajectory.v)
    rows = verdicts(case, Entry(engine="reference", profile="compiled", run=fast), known, "")
    assert {row.metric: row.verdict for row in rows}["rate_residual"] == Word.OUTSIDE


def test_a_motion_without_rows_is_read_back_with_its_account(tmp_path: Path) -> None:
    case = robot(tmp_path, HELD.format(stiffness=1.0), t_end=0.05, without="contacts,loops")
    run = engines.load("reference").prepare(case, "compiled").run()
    assert run.ledger is not None
    assert run.ledger.contact.shape == (len(run.t), 0)
    save(tmp_path / "run.parquet", Trace(run=run, about={}))
    read = load(tmp_path / "run.parquet").run.ledger
    assert read is not None
    for name in ("contact", "input", "dissipated"):
        np.testing.assert_array_equal(getattr(read, name), getattr(run.ledger, name))


def test_a_metric_that_is_blind_is_told_of_a_linkage_with_rows_that_follow_from_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What these would carry is carried by the others, so that faults can be put there too."""
    case = robot(tmp_path, FIVE_BAR, t_end=0.05, friction=1)
    known, every = truth.truth_of(case), metrics.of(case)
    assert np.isnan(known.trajectory.lam).any()
    freed = np.where(known.trajectory.mode == Mode.STICK, Mode.FREE, known.trajectory.mode)
    assert every["mode_contradicted"].measure(known, replace(known.trajectory, mode=freed), case)
    assert list(controls.unseen(case, known, lambda *_: True)) == []
    for name in ("law_residual", "velocity", "gap_residual"):
        own = metrics.load(name)
        none = SimpleNamespace(UNIT=own.UNIT, CLAIMED=own.CLAIMED, measure=lambda *_: 0.0)
        with monkeypatch.context() as changed:
            changed.setattr(metrics, "of", lambda _, one={**every, name: none}: one)
            assert [one[0] for one in controls.unseen(case, known, lambda *_: True)] == [name]


@pytest.mark.parametrize("label", ["dry_oscillator:swings", "sliding_block:rests"])
def test_pages_of_one_engine_with_several_known_properties_are_read_as_they_are(label: str, tmp_path: Path) -> None:
    """Its name, the same in every row of a table, stood above it, and the reason was taken for the engine."""
    out = tmp_path / "out"
    done = subprocess.run(
        [sys.executable, "-m", "crossbody", "run", label, "-e", "mujoco:default", "-q", "--out", str(out)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


WALL = """
<mujoco><worldbody><geom type="plane" size="5 5 .1" friction=".6 0 0"/>
<geom type="plane" size="5 5 .1" pos=".5 0 0" euler="0 -90 0" friction=".3 0 0"/>
<body pos="0 0 .05"><freejoint/><geom type="cylinder" size=".05 .08" mass=".3" friction=".6 0 0"/></body></worldbody>
<keyframe><key name="roll" qpos="0 0 .05 .7071067811865476 .7071067811865476 0 0" qvel="1 0 0 0 0 -20"/></keyframe>
</mujoco>
"""


def test_a_can_that_rolls_to_a_wall_in_a_round_number_of_steps(tmp_path: Path) -> None:
    """A sample stands at the instant of its touch, before it in the run and behind it in the truth, by rounding."""
    case = robot(tmp_path, WALL, key="roll", t_end=1.0)
    found = jobs.run_case(case, (jobs.Pick(engine="reference", profile="compiled"),), budget=2.0)
    run = found.entries[0].run
    assert run is not None
    measured = metrics.load("lam_impulse").measure(found.truth, run, found.case)
    assert measured is not None
    assert measured < 1e-8
