"""Robot files as cases: published robots against MuJoCo's own arrays, small files of our own through every engine."""

from __future__ import annotations

import dataclasses
import random
import re
import xml.etree.ElementTree as ET
import zipfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from places import ROBOTS
from published import SAME, STATES, dynamics_of, moves_as_in_mujoco

from crossbody import cases, engines
from crossbody.cases import CrossbodyError, InvalidValue, Outcome, SceneError, UnknownName
from crossbody.cases.files.mjcf import scene_of
from crossbody.cases.files.reading import model_of
from crossbody.cases.files.reading import scene_of as scene_of_file
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Actuator
from crossbody.reference import System, simulate
from crossbody.reference.tree import mechanism
from crossbody.reference.tree.table import tabulate
from crossbody.reports.cli import cli
from crossbody.reports.judging.run_verdicts import verdicts
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.verdict import Word
from crossbody.reports.measuring.scale import scale_of
from crossbody.reports.runs import choice, jobs

PUBLISHED = ("agility_cassie/cassie", "franka_emika_panda/panda", "robotiq_2f85/2f85", "unitree_go1/go1",
             "universal_robots_ur5e/ur5e")  # fmt: skip
ARM = """
<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="{integrator}"/><worldbody><body>
<joint name="shoulder" axis="0 1 0" damping=".3" armature=".02" {shoulder}/>
<geom name="upper" type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1.2"/>
<body pos="0 0 -.4"><joint name="elbow" axis="0 1 0" damping=".2" stiffness="1.5" springref=".4" {elbow}/>
<geom name="lower" type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass=".7"/></body></body>{more}</worldbody>
<actuator><motor name="m1" joint="shoulder" gear="2"/><position name="m2" joint="elbow" kp="8"/></actuator>
<keyframe><key name="raised" qpos="1.2 -.3" qvel=".5 0" ctrl=".6 .2"/><key name="down" ctrl="0 1"/>
<key name="loose" qpos="1.2 -.3" qvel=".5 3" ctrl="0 -.3"/></keyframe>
</mujoco>
"""


def write(folder: Path, name: str = "arm.xml", **fields: str) -> str:
    path = folder / name
    text = ARM.format(**{"integrator": "RK4", "shoulder": "", "elbow": "", "more": "", **fields})
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("robot", PUBLISHED)
def test_published_robots_have_the_dynamics_of_mujoco(robot: str) -> None:
    path = ROBOTS / f"{robot}.xml"
    if not path.is_file():
        pytest.skip(f"The robot's file {path} is not here.")
    model = model_of(path)
    moves_as_in_mujoco(model, scene_of(model))


FLOATING = """
<mujoco><option gravity="0 0 -9.81"/><worldbody><body name="base" pos="0 0 1"><freejoint/>
<geom type="box" size=".2 .15 .05" mass="3"/>
<body name="leg" pos=".2 0 0"><joint name="hip" type="ball" {ball}/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1"/>
<body name="shank" pos="0 0 -.4"><joint name="knee" axis="0 1 0" stiffness="4" springref=".5"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass=".6"/></body></body>
<body name="tail" pos="-.2 0 0"><joint name="tail" axis="0 1 1"/>
<geom type="capsule" fromto="0 0 0 -.3 0 .1" size=".02" mass=".4"/>
</body></body></worldbody><contact><exclude body1="base" body2="leg"/><exclude body1="base" body2="tail"/>
<exclude body1="base" body2="shank"/><exclude body1="leg" body2="shank"/><exclude body1="leg" body2="tail"/>
<exclude body1="shank" body2="tail"/></contact>
<keyframe><key name="thrown" qpos="0 0 1 .9 .3 .2 -.1 .8 .1 -.4 .2 .3 -.2"
qvel=".5 -.3 4 1.5 -2.5 1 .5 2 -1 3 -2"/></keyframe>
</mujoco>
"""


def floating(folder: Path, **fields: str) -> str:
    path = folder / "floating.xml"
    path.write_text(FLOATING.format(**{"ball": "", **fields}), encoding="utf-8")
    return str(path)


def turned(q: Any) -> Any:
    """Rotations of the base and of the hip."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.concatenate([q[:, 3:7], q[:, 7:11]]), scalar_first=True).as_matrix()


def test_a_floating_robot_moves_alike_in_three_engines(tmp_path: Path) -> None:
    case = cases.load(floating(tmp_path, ball='damping=".05" stiffness="3"'), t_end=1.0)
    assert case.quaternions == (3, 7)
    assert (len(case.coordinates), len(case.velocities)) == (13, 11)
    ours = engines.load("reference").prepare(case, "compiled", rtol=1e-12).run()
    others = [
        engines.load("reference").prepare(case, "cvode", rtol=1e-12).run(),
        engines.load("reference").prepare(case, "ida", rtol=1e-12).run(),
        engines.load("pinocchio").prepare(case, "law", rtol=1e-12).run(),
        engines.load("mujoco").prepare(case, "matched", dt=2e-4).run(),
    ]
    for run in others:
        assert run.outcome is Outcome.FINISHED
        assert np.abs(turned(run.q[-1:]) - turned(ours.q[-1:])).max() <= 1e-8
        assert np.abs(run.q[-1, [0, 1, 2, 11, 12]] - ours.q[-1, [0, 1, 2, 11, 12]]).max() <= 1e-8
        assert np.abs(run.v[-1] - ours.v[-1]).max() <= 1e-7
        assert np.abs(run.energy[-1].sum() - ours.energy[-1].sum()) <= 1e-7


def momenta(model: Any, q: Any, v: Any) -> Any:
    """Linear momentum and angular momentum about the centre, by MuJoCo, at every row."""
    data, found = mujoco.MjData(model), []
    for one, rate in zip(q, v, strict=True):
        data.qpos[:], data.qvel[:] = one, rate
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        found.append([*data.subtree_linvel[0] * model.body_subtreemass[0], *data.subtree_angmom[0]])
    return np.array(found)


def test_a_floating_robot_keeps_energy_and_momenta(tmp_path: Path) -> None:
    """Over 5 s at rtol 1e-11 nothing drifts by more than 1e-10 of its size."""
    path = floating(tmp_path)
    case = cases.load(path, t_end=5.0)
    run = engines.load("reference").prepare(case, "compiled", rtol=1e-11, samples=101).run()
    assert run.outcome is Outcome.FINISHED
    energy = run.energy.sum(axis=1)
    size = np.abs(run.energy).max()
    assert np.abs(energy - energy[0]).max() <= 1e-10 * size
    momentum = momenta(mujoco.MjModel.from_xml_path(path), run.q, run.v)
    momentum[:, 2] += 5.0 * 9.81 * run.t
    assert np.abs(momentum - momentum[0])[:, :3].max() <= 1e-10 * np.abs(momentum[:, :3]).max()
    assert np.abs(momentum - momentum[0])[:, 3:].max() <= 1e-10 * np.abs(momentum[:, 3:]).max()


def robot(name: str, **parameters: Any) -> cases.Case:
    path = ROBOTS / f"{name}.xml"
    if not path.is_file():
        pytest.skip(f"The robot's file {path} is not here.")
    return cases.load(str(path), without="friction,contacts", **parameters)


@pytest.mark.parametrize(("name", "rows"), [("agility_cassie/cassie", 12), ("robotiq_2f85/2f85", 6)])
def test_planar_loops_closed_in_space_leave_out_what_follows(name: str, rows: int) -> None:
    """Rank 10 of 12 and 4 of 6; the loops stay closed, and what was left out has no multiplier."""
    case = robot(name, assemble=True)
    joined = [i for i, loop in enumerate(case.contacts) if loop.startswith("loop") and loop[-2:] in (" x", " y", " z")]
    assert len(joined) == rows
    run = engines.load("reference").prepare(case, "compiled", rtol=1e-10).run()
    assert run.outcome is Outcome.FINISHED
    assert np.abs(run.gap[:, joined]).max() < 1e-9
    assert np.isnan(run.lam[-1, joined]).sum() == 2
    assert run.counts["redundant"] == 2


def test_loops_of_a_robot_move_alike_in_another_solver() -> None:
    case = robot("agility_cassie/cassie", assemble=True, t_end=0.03)
    runs = [engines.load("reference").prepare(case, profile, rtol=1e-9).run() for profile in ("compiled", "cvode")]
    assert all(run.outcome is Outcome.FINISHED for run in runs)
    assert np.abs(runs[0].q[-1] - runs[1].q[-1]).max() < 1e-8


def test_a_start_that_does_not_assemble_is_refused_with_the_nearest() -> None:
    case = robot("agility_cassie/cassie")
    with pytest.raises(
        SceneError, match=r"off 'loop0 x', which is always on.*--set assemble=1 .* changes '.*' by 0\.0"
    ):
        engines.load("reference").prepare(case, "compiled")


def test_bounds_and_a_coupling_that_depend_on_each_other_do_not_end_a_run() -> None:
    """Both fingers of a gripper stand at their bounds and follow each other: one bound holds them both."""
    run = engines.load("reference").prepare(robot("franka_emika_panda/panda", t_end=0.2), "compiled").run()
    assert run.outcome is Outcome.FINISHED


FOUR_BAR = """
<mujoco><worldbody><body><joint name="crank" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 .3" size=".02" mass="1"/>
<body pos="0 0 .3"><joint name="coupler" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .6 0 0" size=".02" mass="2"/>
<body name="last" pos=".6 0 0"><joint name="rocker" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".02" mass="1"/>
</body></body></body></worldbody><equality>{loops}</equality>
<contact/><keyframe><key name="turning" qpos=".2 .1 -.3" qvel="0 0 0"/></keyframe></mujoco>
"""


def test_a_loop_given_twice_moves_as_once(tmp_path: Path) -> None:
    """Rows that follow from others change nothing: one loop has rank 2 of 3, two of them at one place 2 of 6."""
    loop = '<connect name="{}" body1="last" anchor="0 0 -.4" solref="-1 -2"/>'
    ends = []
    for count in (1, 2):
        path = tmp_path / "bar.xml"
        text = FOUR_BAR.format(loops="".join(loop.format(f"loop {k}") for k in range(count)))
        path.write_text(text, encoding="utf-8")
        case = cases.load(str(path), t_end=1.0, without="contacts", assemble=True)
        run = engines.load("reference").prepare(case, "compiled", rtol=1e-11).run()
        assert run.outcome is Outcome.FINISHED
        assert run.counts["redundant"] == 3 * count - 2
        assert np.abs(run.gap).max() < 1e-9
        ends.append(np.concatenate([run.q[-1], run.v[-1]]))
    assert np.abs(ends[0]).max() > 0.5
    assert np.abs(ends[0] - ends[1]).max() < 1e-9


TILTED = (
    FOUR_BAR.replace("<mujoco>", '<mujoco><option gravity="3 0 -9.81"/>')
    .replace('name="coupler" axis="0 1 0"', 'name="coupler" axis="{tilt} 1 0"')
    .replace('qpos=".2 .1 -.3"', 'qpos="0 0 0"')
)


def tilted(folder: Path, tilt: float, **parameters: Any) -> cases.Case:
    """A four-bar that is closed where it starts, one of whose axes is off by an angle, rad."""
    path = folder / "tilted.xml"
    loop = '<connect name="loop" body1="last" anchor="0 0 -.4" solref="-1 -2"/>'
    path.write_text(TILTED.format(loops=loop, tilt=tilt), encoding="utf-8")
    return cases.load(str(path), t_end=0.2, without="contacts", **parameters)


@pytest.mark.parametrize("tilt", [1e-5, 1e-7])
def test_a_row_that_is_nearly_dependent_is_named_and_left_out_or_kept(tmp_path: Path, tilt: float) -> None:
    """Without it the four-bar moves, with it it stands: both are told, and in both witnesses `rank` decides."""
    for rank, moves in ((-1, True), (2, True), (3, False)):
        case = tilted(tmp_path, tilt, rank=rank)
        runs = [
            engines.load(name).prepare(case, profile).run()
            for name, profile in (("reference", "compiled"), ("reference", "cvode"), ("pinocchio", "law"))
        ]
        for run in runs:
            assert run.outcome is Outcome.FINISHED, run.message
            assert bool(np.abs(run.q[-1]).max() > 1e-2) is moves
            assert np.abs(run.q[-1] - runs[0].q[-1]).max() <= 1e-7
        assert "near_dependent: a pivot between 1e-08 and 0.0001 of the first has 'loop y' (" in runs[0].message
        assert f"{2 if moves else 3} of 3 rows hold" in runs[0].message


@pytest.mark.parametrize(
    ("tilt", "rank", "valid"), [(0.0, 3, "2, of 3"), (1e-6, 1, "from 2 to 3"), (0.3, 2, "3, of 3")]
)
def test_a_rank_that_rounding_does_not_leave_open_is_refused(
    tmp_path: Path, tilt: float, rank: int, valid: str
) -> None:
    with pytest.raises(SceneError, match=f"rank is {rank}; valid: {valid}"):
        engines.load("reference").prepare(tilted(tmp_path, tilt, rank=rank))
    with pytest.raises(SceneError, match="no loops"):
        cases.load(write(tmp_path), "raised", rank=3)


def test_a_nearly_dependent_row_is_told_before_the_run(tmp_path: Path) -> None:
    path = tilted(tmp_path, 1e-6).file
    arguments = ["run", path, "-e", "reference:compiled", "--t-end", ".1", "--without", "contacts", "--rank", "3"]
    result = CliRunner().invoke(cli, [*arguments, "--out", str(tmp_path / "out")])
    assert "note: tilted.xml: near_dependent" in result.stderr
    assert "3 of 3 rows hold" in result.stderr


WELDED = """
<mujoco><option timestep="1e-3"/>
  <default><joint axis="0 1 0" damping=".01"/><geom type="capsule" size=".02" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body pos="0 0 1"><joint/><geom fromto="0 0 0 0 0 -.4"/>
      <body name="left" pos="0 0 -.4"><joint/><geom fromto="0 0 0 .22 0 0"/></body></body>
    <body pos=".5 0 1"><joint/><geom fromto="0 0 0 0 0 -.35"/>
      <body name="right" pos="0 0 -.35"><joint/><geom fromto="0 0 0 -.22 0 0"/></body></body>
  </worldbody>
  <equality><weld name="coupler" body1="left" body2="right" relpose=".2 0 0 1 0 .3 0" anchor="-.25 0 0"
    torquescale=".3" solref="-1 -2"/></equality>
</mujoco>
"""
"""A four-bar whose coupler is two halves that are welded: six rows of which three hold."""


def test_loops_move_alike_in_three_engines(tmp_path: Path) -> None:
    """A four-bar in MuJoCo and in Pinocchio, whose rows are its own; and a robot with redundant loops in both.

    MuJoCo's loops give: 3e-10 of what they bear, times the condition of the rows, is missing of accelerations.
    """
    path = tmp_path / "bar.xml"
    loop = '<connect name="loop" body1="last" anchor="0 0 -.4" solref="-1 -2"/>'
    path.write_text(FOUR_BAR.format(loops=loop), encoding="utf-8")
    bar = cases.load(str(path), t_end=0.3, without="contacts", assemble=True)
    path = tmp_path / "welded.xml"
    path.write_text(WELDED, encoding="utf-8")
    welded = cases.load(str(path), t_end=0.3, assemble=True)
    assert len(welded.contacts) == 6
    for case in (bar, welded, robot("agility_cassie/cassie", assemble=True, t_end=0.004)):
        runs = [
            engines.load("reference").prepare(case, "compiled", rtol=1e-11).run(),
            engines.load("mujoco").prepare(case, "matched", dt=2e-4).run(),
            engines.load("pinocchio").prepare(case, "law", rtol=1e-11).run(),
        ]
        for run, off in zip(runs, (0.0, 1e-7, 1e-8), strict=True):
            assert run.outcome is Outcome.FINISHED
            assert np.abs(run.q[-1] - runs[0].q[-1]).max() <= off


def test_a_row_that_was_left_out_and_does_not_follow_ends_the_run() -> None:
    """Dropping a row that holds by itself is seen: its gap opens."""
    from mechanisms import ball

    system = replace_rows(ball(), unilateral=False, redundant=[0])
    run = simulate(system, [0.0], [1.0], 1.0, consistent=False)
    assert run.outcome is Outcome.INCONSISTENT
    assert "Row 0 followed from the others at the start and was left out" in run.message


def replace_rows(system: System, **changes: Any) -> System:
    """The system with other rows."""
    names = [field.name for field in dataclasses.fields(System) if field.init]
    return System(**({name: getattr(system, name) for name in names} | changes))


def test_an_unnamed_floating_box_runs_in_every_engine(tmp_path: Path) -> None:
    path = write(tmp_path, more='<body name="box" pos="3 0 2"><freejoint/><geom size=".1"/></body>')
    text = Path(path).read_text(encoding="utf-8")
    Path(path).write_text(text[: text.index("<keyframe>")] + "</mujoco>", encoding="utf-8")
    case = cases.load(path, t_end=0.2)
    for engine, profile in (
        ("reference", "compiled"),
        ("mujoco", "matched"),
        ("mujoco", "as_is"),
        ("pinocchio", "law"),
    ):
        run = engines.load(engine).prepare(case, profile).run()
        assert run.outcome is Outcome.FINISHED
        assert run.q[-1, 4] == pytest.approx(2.0 - 0.5 * 9.81 * 0.2**2, abs=1e-2 if profile == "as_is" else 1e-9)


def test_an_arm_moves_alike_in_three_engines(tmp_path: Path) -> None:
    case = cases.load(write(tmp_path), "raised")
    ours = engines.load("reference").prepare(case, "compiled", rtol=1e-12).run()
    assert ours.outcome is Outcome.FINISHED
    assert np.abs(ours.q[-1] - ours.q[0]).max() > 0.5
    others = [
        engines.load("reference").prepare(case, "cvode", rtol=1e-12).run(),
        engines.load("pinocchio").prepare(case, "law", rtol=1e-12).run(),
        engines.load("mujoco").prepare(case, "matched", dt=2e-4).run(),
    ]
    for run in others:
        assert np.abs(run.q[-1] - ours.q[-1]).max() <= 1e-8
        assert np.abs(run.energy[-1].sum() - ours.energy[-1].sum()) <= 1e-7


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
def test_a_file_as_it_stands_steps_as_mujoco_does(tmp_path: Path, integrator: str) -> None:
    path = write(tmp_path, integrator=integrator)
    case = cases.load(path, "raised", t_end=0.2)
    run = engines.load("mujoco").prepare(case, "as_is").run()
    model = mujoco.MjModel.from_xml_path(path)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(200):
        mujoco.mj_step(model, data)
    assert np.abs(run.q[-1] - data.qpos).max() <= 1e-12


def test_bounds_are_rows_that_open_and_close(tmp_path: Path) -> None:
    law = 'limited="true" range="-.35 -.25" solreflimit="-4000 -20" solimplimit="1 1 .001"'
    case = cases.load(write(tmp_path, elbow=law), "loose", t_end=0.5)
    assert case.contacts == ("elbow low", "elbow high")
    runs = [engines.load("reference").prepare(case, "compiled", rtol=1e-11).run(),
            engines.load("pinocchio").prepare(case, "law", rtol=1e-11).run()]  # fmt: skip
    times = [np.array([event.t for event in run.events]) for run in runs]
    assert len(times[0]) >= 2
    assert len(times[0]) == len(times[1])
    assert np.abs(times[0] - times[1]).max() <= 1e-8
    assert np.abs(runs[0].q[-1] - runs[1].q[-1]).max() <= 1e-7


BALL = """
<mujoco><compiler angle="radian"/><option timestep="1e-3"/><worldbody><body pos="0 0 1"><joint name="ball" type="ball"
damping=".05" limited="true" range="0 {range}" solreflimit="-{K} -20" solimplimit="1 1 .001"/>
<geom type="capsule" fromto="0 0 0 .1 0 -.4" size=".03" mass="1"/><geom size=".05" pos="0 .1 -.2" mass=".5"/>
</body></worldbody><keyframe><key qpos="1 .1 .2 .1" qvel="{v}"/></keyframe></mujoco>
"""


def ball_joint(folder: Path, **fields: Any) -> str:
    path = folder / "ball.xml"
    path.write_text(BALL.format(**fields), encoding="utf-8")
    return str(path)


def test_a_ball_joint_meets_its_bound_alike_in_every_engine(tmp_path: Path) -> None:
    case = cases.load(ball_joint(tmp_path, range=0.9, K=4000, v="5 -6 4"), t_end=0.3)
    assert case.contacts == ("ball high",)
    asked: Any = [("reference", "compiled"), ("reference", "cvode"), ("reference", "ida"), ("pinocchio", "law")]
    runs = [engines.load(name).prepare(case, profile, rtol=1e-11).run() for name, profile in asked]
    touches = [np.array([event.t for event in run.events]) for run in runs]
    assert len(touches[0]) == 3
    for run, times in zip(runs, touches, strict=True):
        assert np.abs(times - touches[0]).max() <= 1e-9
        assert np.abs(run.q[-1] - runs[0].q[-1]).max() <= 1e-8
    # A step of MuJoCo's is first order where it meets the bound, and its row is gone where it stops pushing.
    case = dataclasses.replace(case, t_end=0.19)
    run = engines.load("mujoco").prepare(case, "matched", dt=1e-4).run()
    ours = engines.load("reference").prepare(case, "compiled").run()
    assert np.abs(run.q[-1] - ours.q[-1]).max() <= 1e-4


def test_the_bound_of_a_ball_joint_turns_round_at_half_a_turn(tmp_path: Path) -> None:
    """Too soft to hold, it is turned through: what has pushed back pushes on, from an instant that is located."""
    case = cases.load(ball_joint(tmp_path, range=2.9, K=1, v="0 24 0"), t_end=0.3)
    runs = [engines.load("reference").prepare(case, name, rtol=1e-11).run() for name in ("compiled", "cvode", "ida")]
    for run in runs:
        assert run.outcome is Outcome.FINISHED
        flips = [switch.t for switch in run.switches if switch.t > 0.0]
        assert len(flips) == 1
        at = np.searchsorted(run.t, flips[0])
        assert abs(run.q[at, 0]) <= 1e-10
        assert run.mode[at, 0] == cases.Mode.CONTACT
        assert np.abs(run.q[-1] - runs[0].q[-1]).max() <= 1e-8


@pytest.mark.parametrize("safe", ["enable", "disable"])
@pytest.mark.parametrize("draw", range(10))
def test_a_bound_has_the_stiffness_and_damping_that_mujoco_gives_it(draw: int, safe: str) -> None:
    """Its own K, B and impedance at a bound that acts; short time constants are lengthened to two steps."""
    rng = np.random.default_rng(draw)
    given = -rng.uniform(10.0, 1e4, 2) if draw % 3 == 0 else (10.0 ** rng.uniform(-4.0, -1.0), rng.uniform(0.3, 2.0))
    d = rng.uniform(0.5, 0.99)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{10.0 ** rng.uniform(-4.0, -2.0)}"><flag refsafe="{safe}"/></option>'
        f"<worldbody><body>"
        f'<joint name="j" type="slide" limited="true" range="0 1" solreflimit="{given[0]} {given[1]}" '
        f'solimplimit="{d} {d} 1"/><geom size=".1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    data.qpos[0] = -0.01
    mujoco.mj_forward(model, data)
    K, B, impedance = np.reshape(data.efc_KBIP, (-1, 4))[0, :3]
    law = scene_of(model).joints[0].law
    assert (law.a0, law.a1) == pytest.approx((K * impedance, B), rel=1e-12)


def test_controls_come_from_a_table(tmp_path: Path) -> None:
    path, table = write(tmp_path), tmp_path / "u.csv"
    table.write_text("t,m1,m2\n0,1,0\n0.1,-1,0.5\n", encoding="utf-8")
    case = cases.load(path, "raised", ctrl=str(table))
    assert case.inputs is not None
    assert case.inputs.values.tolist() == [[1.0, 0.0], [-1.0, 0.5]]
    np.savez(tmp_path / "u.npz", t=case.inputs.times, ctrl=case.inputs.values)
    again = cases.load(path, "raised", ctrl=str(tmp_path / "u.npz"))
    assert again.inputs is not None
    assert np.array_equal(again.inputs.values, case.inputs.values)


@pytest.mark.parametrize(
    ("text", "said"),
    [("t,m1\n0,1\n", "m2"), ("t,m1,m2\n1,0,0\n0,0,0\n", "increasing"),
     ("t,m1,m2\n-1,0,0\n1,0,0\n", "at least 0"), ("t,m1,m2\n0,0,0\n0,1,0\n", "increasing"),
     ("t,m1,m2\n0,nan,0\n", "finite"), ("t,m1,m2\n0,x,0\n", "x"), ("", "columns")],
)  # fmt: skip
def test_wrong_controls_are_refused(tmp_path: Path, text: str, said: str) -> None:
    table = tmp_path / "u.csv"
    table.write_text(text, encoding="utf-8")
    with pytest.raises(InvalidValue, match=said):
        cases.load(write(tmp_path), "raised", ctrl=str(table))


@pytest.mark.parametrize("kind", ["npz", "parquet", "csv"])
def test_damaged_controls_are_refused_in_a_sentence(kind: str, tmp_path: Path) -> None:
    scene, table, rng = write(tmp_path), tmp_path / f"u.{kind}", random.Random(1)
    held = pd.DataFrame({"t": np.arange(20.0), "m1": np.zeros(20), "m2": np.ones(20)})
    match kind:
        case "npz":
            np.savez_compressed(table, t=held["t"], ctrl=held[["m1", "m2"]])
        case "parquet":
            held.to_parquet(table)
        case _:
            held.to_csv(table, index=False)
    whole = table.read_bytes()
    for i in range(60):
        raw = bytearray(whole if i % 2 else whole[: rng.randrange(len(whole))])
        for _ in range(rng.randrange(4) if raw else 0):
            raw[rng.randrange(len(raw))] = rng.randrange(256)
        table.write_bytes(raw)
        with suppress(InvalidValue):
            cases.load(scene, "raised", ctrl=str(table))


def test_controls_that_unfold_to_gigabytes_are_refused(tmp_path: Path) -> None:
    scene, zeros = write(tmp_path), np.zeros((1 << 20, 2))
    with zipfile.ZipFile(tmp_path / "u.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        with file.open("t.npy", "w") as one:
            np.save(one, zeros[:, 0])
        with file.open("ctrl.npy", "w", force_zip64=True) as one:
            one.write(b"\x93NUMPY\x01\x00\x76\x00")
            shape = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({20 << 20}, 2), }}"
            one.write(shape.ljust(0x75).encode() + b"\n")
            for _ in range(20):
                one.write(zeros.tobytes())
    pq.write_table(pa.table({name: pa.nulls(12 << 20, pa.float64()) for name in ("t", "m1", "m2")}),
                   tmp_path / "u.parquet")  # fmt: skip
    assert max((tmp_path / name).stat().st_size for name in ("u.npz", "u.parquet")) < 3_000_000
    for name in ("u.npz", "u.parquet"):
        with pytest.raises(InvalidValue, match="MB in memory"):
            cases.load(scene, "raised", ctrl=str(tmp_path / name))


def test_a_push_moves_every_engine_alike(tmp_path: Path) -> None:
    """Two pushes at once on one body, and one that never ends."""
    path = write(tmp_path)
    pushes = "body2 3 -2 1 .05 .12; body2 -1 0 4 .1 .2; body1 0 0 .5 .15 inf"
    case, plain = (cases.load(path, "raised", t_end=0.3, push=text) for text in (pushes, ""))
    assert case.inputs is not None
    assert case.inputs.names[-3:] == ("push 2 x", "push 2 y", "push 2 z")
    runs = [
        engines.load("reference").prepare(case, "compiled", rtol=1e-11).run(),
        engines.load("mujoco").prepare(case, "matched", dt=1e-4).run(),
        engines.load("pinocchio").prepare(case, "law", rtol=1e-11).run(),
    ]
    still = engines.load("reference").prepare(plain, "compiled", rtol=1e-11).run()
    assert np.abs(runs[0].q[-1] - still.q[-1]).max() > 1e-2
    for run in runs:
        assert run.outcome is Outcome.FINISHED
        assert np.abs(run.q[-1] - runs[0].q[-1]).max() < 1e-8


def test_a_push_gives_a_floating_body_its_momentum(tmp_path: Path) -> None:
    """F dt / m, whatever the body does besides; in the file as it stands too."""
    path = tmp_path / "box.xml"
    path.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body name="box"><freejoint/>'
        '<geom type="box" size=".1 .2 .3" mass="2"/></body></worldbody></mujoco>', encoding="utf-8",
    )  # fmt: skip
    case = cases.load(str(path), t_end=0.5, push="box 1 -2 3 .1 .3")
    for engine, profile in (("reference", "compiled"), ("mujoco", "as_is"), ("pinocchio", "law")):
        run = engines.load(engine).prepare(case, profile).run()
        assert run.outcome is Outcome.FINISHED
        assert np.abs(run.v[-1] - [0.1, -0.2, 0.3, 0.0, 0.0, 0.0]).max() < 1e-9, engine


ROPE = """
<mujoco><option timestep="1e-3" integrator="RK4"/><worldbody>
  <body pos="0 0 1"><joint name="x" type="slide" axis="1 0 0" damping="3" stiffness="20"/>
    <geom type="box" size=".05 .05 .05" contype="0" conaffinity="0"/><site name="cup" pos="0 0 -.1"/></body>
  <body pos="0 0 .7"><freejoint/><geom size=".025" contype="0" conaffinity="0"/><site name="ball" pos=".02 0 0"/></body>
</worldbody><tendon><spatial name="string" limited="true" range="0 .3" solreflimit="-4000 -20" solimplimit="1 1 .001">
<site site="ball"/><site site="cup"/></spatial></tendon><actuator><motor name="a" joint="x"/></actuator>
<keyframe><key name="thrown" qpos="0 .1 .05 .75 1 0 0 0" qvel="0 .6 -.2 .5 1 2 3" ctrl="1.5"/></keyframe></mujoco>
"""


def test_a_string_goes_taut_and_slack_alike_in_three_engines(tmp_path: Path) -> None:
    """Its touches in the reference and Pinocchio; MuJoCo as far as a row that stops pushing is gone for both."""
    path = tmp_path / "rope.xml"
    path.write_text(ROPE, encoding="utf-8")
    case = cases.load(str(path), "thrown", t_end=0.5)  # errors grow some times from touch to touch
    assert case.contacts == ("string low", "string high")
    runs = [
        engines.load("reference").prepare(case, "compiled", rtol=1e-11).run(),
        engines.load("pinocchio").prepare(case, "law", rtol=1e-11).run(),
    ]
    touches = [[event.t for event in run.events if event.contact == 1] for run in runs]
    assert len(touches[0]) >= 2
    assert len(touches[0]) == len(touches[1])
    assert np.abs(np.subtract(*touches)).max() < 1e-9
    assert np.abs(runs[1].q[-1] - runs[0].q[-1]).max() <= 1e-8
    case = cases.load(str(path), "thrown", t_end=0.2)
    run = engines.load("mujoco").prepare(case, "matched", dt=1e-4).run()
    first = engines.load("reference").prepare(case, "compiled").run()
    assert run.outcome is Outcome.FINISHED
    # A step is first order where it meets the end of the string: 1e-4 s of the difference that it makes to speeds.
    assert np.abs(run.q[-1, :4] - first.q[-1, :4]).max() <= 1e-4


WINCH = """
<mujoco><option timestep="1e-3"/><worldbody><site name="hook" pos=".1 0 1.2"/>
<body pos="0 0 1"><joint name="boom" axis="0 1 0" damping=".1" actuatorfrclimited="true" actuatorfrcrange="-3 3"/>
<geom type="capsule" fromto="0 0 0 .5 0 0" size=".03" mass="1" contype="0" conaffinity="0"/>
<site name="tip" pos=".5 0 0"/></body><body pos=".6 .1 .5"><freejoint/>
<geom type="box" size=".05 .08 .1" mass=".8" contype="0" conaffinity="0"/><site name="load" pos="0 0 .1"/></body>
</worldbody><tendon><spatial name="brace" stiffness="40 5 2" damping="1 .2 .1" springlength=".3 .45"><site site="hook"/>
<site site="tip"/></spatial><spatial name="rope" stiffness="60" springlength=".2"><site site="tip"/>
<site site="load"/></spatial></tendon>
<actuator><position name="winch" tendon="rope" kp="30" kv="2" gear="1.5" forcerange="-20 20"/>
<motor name="pull" tendon="brace" gear="-2"/></actuator>
<keyframe><key ctrl=".4 1" qvel="0 .3 .2 0 2 -1 3"/></keyframe></mujoco>
"""


def test_forces_along_tendons_between_points_move_alike_in_every_engine(tmp_path: Path) -> None:
    """A brace with a dead band, a rope with a servo; and the account of energy is closed."""
    path = tmp_path / "winch.xml"
    path.write_text(WINCH, encoding="utf-8")
    moves_as_in_mujoco(model_of(path), scene_of(model_of(path)))
    case = cases.load(str(path), t_end=0.4)
    runs = [
        engines.load(name).prepare(case, profile, **settings).run()
        for name, profile, settings in (
            ("reference", "compiled", {"rtol": 1e-11}), ("reference", "cvode", {"rtol": 1e-11}),
            ("reference", "ida", {"rtol": 1e-10}), ("pinocchio", "law", {"rtol": 1e-11}),
            ("mujoco", "matched", {"dt": 1e-4}),
        )
    ]  # fmt: skip
    for k, run in enumerate(runs):
        assert run.outcome is Outcome.FINISHED
        # A fixed step that meets the end of a range or of a dead band is second order.
        assert np.abs(run.q[-1] - runs[0].q[-1]).max() <= (1e-6 if k == 4 else 1e-8)
        assert np.abs(run.energy[-1].sum() - runs[0].energy[-1].sum()) <= 1e-5
    ledger = runs[0].ledger
    assert ledger is not None
    account = runs[0].total_energy - ledger.input + ledger.dissipated
    assert np.abs(account - account[0]).max() <= 1e-8 * np.abs(runs[0].energy).max()


def test_a_loop_that_couples_the_distance_of_points_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "winch.xml"
    loop = '<equality><tendon name="both" tendon1="rope" tendon2="brace"/></equality>'
    path.write_text(WINCH.replace("<actuator>", f"{loop}<actuator>"), encoding="utf-8")
    with pytest.raises(SceneError, match=r"Tendon '(rope|brace)' runs between two points: no loop \('both'\)"):
        cases.load(str(path))


def test_inertia_of_an_actuator_on_a_tendon_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "winch.xml"
    path.write_text(WINCH.replace("<motor ", '<motor armature=".1" '), encoding="utf-8")
    with pytest.raises(SceneError, match="Actuator 'pull' has armature on a tendon"):
        cases.load(str(path))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("body2 1 2 3 .1", "is not a push"), ("body2 1 2 nan 0 1", "is not a push"),
        ("body2 1 2 3 .2 .1", "is not a push"),
        ("body2 1 2 3 -1 1", "is not a push"), ("leg 1 2 3 0 1", "no body 'leg'; valid: "),
        ("body2 a b c d e", "is not a push"), ("1", "is not a push"),
    ],
)  # fmt: skip
def test_wrong_pushes_are_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InvalidValue, match=said):
        cases.load(write(tmp_path), "raised", push=text)


LOOSE = """<mujoco><worldbody><body name="box"><freejoint name="free"/><geom size=".1 .1 .1" type="box"/>
<body name="arm" pos="0 0 .2"><joint name="left arm"/><geom size=".05" pos=".1 0 0"/></body></body>
</worldbody></mujoco>"""


def test_a_start_is_given_by_the_names_of_coordinates_and_velocities(tmp_path: Path) -> None:
    path = tmp_path / "floating.xml"
    path.write_text(LOOSE)
    case = cases.load(str(path), start="free z .7; left arm -.3", rate="free rx 2; left arm 1e-1; free y -4;")
    assert case.q0.tolist() == [0.0, 0.0, 0.7, 1.0, 0.0, 0.0, 0.0, -0.3]
    assert case.v0.tolist() == [0.0, -4.0, 0.0, 2.0, 0.0, 0.0, 0.1]
    for name, wrong in (
        ("start", "free qw 1"), ("start", "arm 1"), ("start", "left arm"), ("start", "left arm nan"), ("rate", "7"),
    ):  # fmt: skip
        with pytest.raises(InvalidValue, match=f"{name}: .* is not a name and its value; valid: .*left arm"):
            cases.load(str(path), **{name: wrong})


def test_a_urdf_that_starts_elsewhere_swings_alike_in_every_engine(tmp_path: Path) -> None:
    path = tmp_path / "pendulum.urdf"
    path.write_text(
        '<robot name="p"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -.5"/><mass value="1"/>'
        '<inertia ixx=".1" iyy=".1" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="hinge" '
        'type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>'
    )
    case = cases.load(str(path), start="hinge 1.2", rate="hinge -2")
    ends = [engines.load(name).prepare(case, profile).run().q[-1, 0] for name, profile in (
        ("reference", "compiled"), ("mujoco", "matched"), ("pinocchio", "law"))]  # fmt: skip
    assert ends == pytest.approx([ends[0]] * 3, abs=1e-6)
    assert abs(ends[0]) > 0.1


def test_shapes_that_meet_end_the_run(tmp_path: Path) -> None:
    """A contact that no row stands for is told, and can be left out of every engine."""
    wall = '<geom name="wall" type="box" pos=".25 0 -.55" size=".1 .5 .02"/>'
    path = write(tmp_path, more=wall)
    found = engines.load("reference").prepare(cases.load(path, "down", t_end=3.0), "compiled").run()
    assert found.outcome is Outcome.INCONSISTENT
    assert "'wall'" in found.message
    free = cases.load(path, "down", t_end=3.0, without="contacts")
    assert engines.load("reference").prepare(free, "compiled").run().outcome is Outcome.FINISHED
    assert engines.load("mujoco").prepare(free, "as_is").run().outcome is Outcome.FINISHED


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"shoulder": 'actuatorgravcomp="true" actuatorfrclimited="true" actuatorfrcrange="-1 1"'}, "shoulder"),
        ({"integrator": 'RK4" wind="1 0 0'}, "wind.*without=medium"),
        ({"integrator": 'RK4" density="1'}, "density 1.*without=medium"),
        ({"integrator": 'RK4" viscosity="1'}, "viscosity 1.*without=medium"),
        ({"shoulder": "/><<"}, "compiler refuses"),
    ],
)
def test_what_a_scene_does_not_have_is_refused_by_name(tmp_path: Path, fields: dict[str, str], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        cases.load(write(tmp_path, **fields))


def test_a_medium_is_left_out_of_every_engine(tmp_path: Path) -> None:
    thick = write(tmp_path, integrator='RK4" density="1e3" viscosity="1" wind="1 0 0')
    (tmp_path / "thin").mkdir()
    thin = write(tmp_path / "thin", integrator="RK4")
    for engine, profile in (("reference", "compiled"), ("mujoco", "as_is")):
        runs = [
            engines.load(engine).prepare(cases.load(path, without=word), profile).run()
            for path, word in ((thick, "medium"), (thin, ""))
        ]
        assert np.array_equal(runs[0].q, runs[1].q)


def test_positions_of_a_robot_are_measured_by_the_largest_of_their_unit(tmp_path: Path) -> None:
    """A joint that all but rests in the truth divides no error of an engine that moves it."""
    case = cases.load(write(tmp_path, elbow='armature="1e6"'), "raised")
    run = engines.load("reference").prepare(case, "compiled").run()
    scale = scale_of(run, case)
    assert scale == pytest.approx([np.abs(run.q[:, 0]).max(), 1.0]), "rotations of others, up to a radian"
    assert np.ptp(run.q, axis=0).min() < 1e-2 * scale[0], "one rests"


@pytest.mark.parametrize("seed", range(3))
def test_what_is_fixed_to_a_link_weighs_with_it_in_every_engine(seed: int, tmp_path: Path) -> None:
    """MuJoCo's compiler fuses links without joints where it reads a URDF; what the world bears it leaves out."""
    rng = np.random.default_rng(seed)
    parents = [-1, *(int(rng.integers(i)) for i in range(1, 7))]
    fixed = [True, False, *(rng.random(5) < 0.5).tolist()]
    weights = rng.uniform(0.1, 5.0, 7)
    links = "".join(
        f'<link name="l{i}"><inertial><mass value="{m}"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        "</inertial></link>"
        for i, m in enumerate(weights)
    )
    joints = "".join(
        f'<joint name="j{i}" type="{"fixed" if fixed[i] else "continuous"}"><parent link="l{parents[i]}"/>'
        f'<child link="l{i}"/><axis xyz="0 1 0"/></joint>'
        for i in range(1, 7)
    )
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="robot">{links}{joints}</robot>')
    owner = list(range(7))
    for i in range(1, 7):
        owner[i] = owner[parents[i]] if fixed[i] else i
    expected = sorted(sum(weights[k] for k in range(7) if owner[k] == i) for i in set(owner) - {0})
    case = cases.load(str(path))
    for engine, profile in (
        ("reference", "compiled"),
        ("mujoco", "as_is"),
        ("mujoco", "matched"),
        ("pinocchio", "law"),
    ):
        found = engines.load(engine).prepare(case, profile).audit()["masses"]
        assert sorted(found) == pytest.approx(expected, rel=1e-12), (engine, profile)


def test_gravity_that_a_flag_turns_off_is_none_in_every_audit(tmp_path: Path) -> None:
    path = tmp_path / "floats.xml"
    path.write_text("""<mujoco><option gravity="0 0 -9.81"><flag gravity="disable"/></option><worldbody><body><joint/>
        <geom size=".1" pos=".2 0 0"/></body></worldbody></mujoco>""")
    case = cases.load(str(path))
    assert [engines.load(name).prepare(case, profile).audit()["gravity"] for name, profile in (
        ("mujoco", "as_is"), ("mujoco", "matched"), ("pinocchio", "law"))] == [0.0, 0.0, 0.0]  # fmt: skip


def test_contacts_with_a_height_field_are_refused_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "ground.xml"
    path.write_text("""<mujoco><asset><hfield name="hills" nrow="2" ncol="2" size="1 1 1 .1"/></asset><worldbody>
        <geom name="ground" type="hfield" hfield="hills"/><body><joint/><geom name="foot" size=".1"/></body>
        </worldbody></mujoco>""")
    with pytest.raises(SceneError, match=r"'ground' is a height field.*'foot'.*without=contacts"):
        cases.load(str(path))
    assert cases.load(str(path), without="contacts").scene is not None


def test_what_is_left_out_is_a_text(tmp_path: Path) -> None:
    with pytest.raises(InvalidValue, match=r"without is .*valid: a text .*friction"):
        cases.from_file(write(tmp_path), without=["friction"])


def test_friction_is_left_out_when_asked(tmp_path: Path) -> None:
    case = cases.load(write(tmp_path, shoulder='frictionloss=".1"'), without="friction")
    assert case.scene is not None
    assert not any(joint.friction_loss for joint in case.scene.joints)


@pytest.mark.parametrize("word", ["nonsense", "actuator:none", "loop:x", "tendon:"])
def test_nothing_is_left_out_that_is_not_there(tmp_path: Path, word: str) -> None:
    with pytest.raises(InvalidValue, match="without"):
        cases.load(write(tmp_path), without=word)


def test_a_file_that_is_not_there_is_told() -> None:
    with pytest.raises(UnknownName, match=r"none\.xml"):
        cases.load("none.xml")


def test_an_engine_that_would_take_too_long_says_so_before_it_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = cases.from_file(write(tmp_path), "raised")
    monkeypatch.setattr(jobs, "DEAR", 0.0)
    wanted = [next(iter(choice.picks([name]))) for name in ("pinocchio", "pinocchio:law")]
    every, asked = jobs.run_case(case, wanted).entries
    assert every.run is None
    assert "Too expensive: it would take about" in every.skipped
    assert "-e pinocchio:law" in every.skipped
    assert asked.run is not None
    assert asked.run.outcome is Outcome.FINISHED


def test_a_run_that_seemed_cheap_and_is_not_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (jobs, choice):
        monkeypatch.setattr(module, "DEAR", 1e-9)
    monkeypatch.setattr(jobs, "estimated", lambda *_: (0.0, 1))
    case = cases.from_file(write(tmp_path), "raised")
    truth = replace(truth_of(case), witness=("", ""))  # else CVODE is not run again
    ours, *others = jobs.run_case(case, choice.picks(["reference"]), truth=truth).entries
    assert ours.run is not None
    assert ours.run.outcome is Outcome.FINISHED
    assert all("Too expensive: it would take more than" in entry.skipped for entry in others)


@pytest.mark.parametrize("dear", [True, False])
def test_a_dear_run_ends_where_its_truth_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dear: bool) -> None:
    """It is judged up to there, and says why not further; one that is cheap comes to its horizon."""
    case = cases.from_file(write(tmp_path), "raised")
    monkeypatch.setattr(jobs, "BEYOND", 0.0 if dear else 1.0)
    truth = replace(truth_of(case), trusted=0.2 * case.t_end)
    ours, cvode, *_ = jobs.run_case(case, choice.picks(["reference"]), truth=truth).entries
    assert ours.run is not None
    assert cvode.run is not None
    assert ours.run.t[-1] == case.t_end
    assert cvode.run.t[-1] == pytest.approx((0.21 if dear else 1.0) * case.t_end, rel=1e-2)
    first = verdicts(case, cvode, truth, "")[0]
    assert (first.metric, first.verdict, bool(first.why)) == ("finished", Word.WITHIN, dear)
    assert verdicts(case, replace(cvode, until=np.inf), truth, "")[0].verdict == (Word.OUTSIDE if dear else Word.WITHIN)


def test_the_profile_of_a_file_as_it_stands_has_a_name_of_its_own(tmp_path: Path) -> None:
    """`default` is that of shipped cases, and each sentence names the other."""
    engine, case, shipped = engines.load("mujoco"), cases.load(write(tmp_path), "raised"), cases.load("bouncing_ball")
    assert "as_is" in str(engine.why_not(case, "default"))
    assert "default" in str(engine.why_not(shipped, "as_is"))
    for one, profiles in ((case, {"matched", "as_is"}), (shipped, {"matched", "default"})):
        assert {choice.of_case(pick, one).profile for pick in choice.picks(["mujoco"])} == profiles
    asked = choice.picks(["mujoco:default"])[0]
    assert choice.of_case(asked, case).profile == "default"


@pytest.mark.parametrize("name", ["a0", "a1"])
def test_a_file_as_it_stands_follows_no_law_that_was_asked_for(tmp_path: Path, name: str) -> None:
    engine, path = engines.load("mujoco"), write(tmp_path)
    asked = cases.load(path, "raised", **{name: 5.0})
    assert "--law" in str(engine.why_not(asked, "as_is"))
    assert engine.why_not(asked, "matched") is None
    assert engine.why_not(cases.load(path, "raised"), "as_is") is None


SERVO = """
<mujoco><compiler angle="radian"/><worldbody><body><joint name="hinge" axis="0 1 0" damping="2"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass="1.2"/></body></worldbody><actuator>
<position name="servo" joint="hinge" kp="8"/><motor name="lift" joint="hinge"/></actuator>
<keyframe><key ctrl="-.4 -1" qpos="-.3"/></keyframe></mujoco>
"""


def test_an_analysis_trims_at_the_controls_that_are_held(tmp_path: Path) -> None:
    """Of the keyframe, or of the table at that instant; and MuJoCo's linear model there is the same."""
    from crossbody.reports.analysis.counterparts import counterparts
    from crossbody.reports.analysis.places import places

    path, table = tmp_path / "servo.xml", tmp_path / "u.csv"
    path.write_text(SERVO, encoding="utf-8")
    table.write_text("t,servo,lift\n0,.1,-2\n2.5,0,0\n", encoding="utf-8")
    for ctrl, wanted in (("", [-0.4, -1.0]), (str(table), [0.1, -2.0])):
        (place,) = places(cases.load(str(path), t_end=3.0, ctrl=ctrl))
        assert place.trim.outcome is Outcome.FINISHED
        assert place.trim.u.tolist() == wanted
        q = float(place.trim.q[0])
        weight = 1.2 * 9.81 * 0.2 * np.cos(q)
        assert 8.0 * (wanted[0] - q) + wanted[1] + weight == pytest.approx(0.0, abs=1e-12)
        told = counterparts([place])[0]
        assert told.loc[told["engine"] == "mujoco", "slope"].min() <= 1e-7


def test_the_command_takes_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path)
    arguments = ["run", path, "--key", "raised", "--set", "t_end=0.3", "--out", str(tmp_path / "out"), "--json"]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code in (0, 1), result.output
    found: Any = result.output
    assert "mujoco" in found
    assert "pinocchio" in found
    assert (tmp_path / "out" / "index.html").is_file()


URDF = """
<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0 .1 -.2" rpy=".3 -.2 .9"/><mass value="1.3"/>
<inertia ixx=".05" iyy=".04" izz=".02" ixy=".003" ixz="-.002" iyz=".001"/></inertial></link>
<link name="hand"><inertial><mass value=".4"/><inertia ixx=".001" iyy=".2" izz=".001" ixy="0" ixz="0" iyz="0"/>
</inertial></link><link name="empty"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<origin xyz=".1 0 .5" rpy=".1 .2 .3"/><limit lower="-2" upper="2" effort="10" velocity="3"/></joint>
<joint name="wrist" type="continuous"><parent link="upper"/><child link="hand"/><axis xyz="0 1 1"/>
<origin xyz="0 0 -.4"/><dynamics damping=".2"/></joint>
<joint name="tip" type="fixed"><parent link="hand"/><child link="empty"/><origin xyz="0 0 -.1"/></joint></robot>
"""


def test_a_urdf_has_the_inertias_of_its_own(tmp_path: Path) -> None:
    """Against Pinocchio's reader; one inertia is that of no body, one link has no mass: neither is changed."""
    import pinocchio as pin

    from crossbody.cases.files.urdf import findings

    path = tmp_path / "arm.urdf"
    path.write_text(URDF, encoding="utf-8")
    scene = scene_of_file(path, model_of(path))
    table, theirs, rng = tabulate(scene), pin.buildModelFromUrdf(str(path)), np.random.default_rng(3)
    data, M, f = theirs.createData(), np.zeros((2, 2)), np.zeros(2)
    for _ in range(STATES):
        q, v = rng.normal(size=2), rng.normal(size=2)
        mechanism.dynamics(0.0, q, v, np.zeros(0), table.p, M, f, np.zeros(table.scratch))
        turned = np.array([q[0], np.cos(q[1]), np.sin(q[1])])  # a continuous joint has two coordinates there
        upper = np.triu(pin.crba(theirs, data, turned))
        assert np.abs(M - upper - np.triu(upper, 1).T).max() <= SAME
        bias = pin.nonLinearEffects(theirs, data, turned, v) + np.array([0.0, 0.2 * v[1]])
        assert np.abs(f + bias).max() <= SAME * np.abs(bias).max()
    assert [sentence.split("'")[1] for sentence in findings(path)] == ["hand"]


def test_an_inertia_that_no_body_has_is_the_same_in_pinocchio(tmp_path: Path) -> None:
    import pinocchio as pin

    from crossbody.engines.pinocchio._model import tree

    path = tmp_path / "arm.urdf"
    path.write_text(URDF.replace('iyy=".2"', 'iyy="-.01"'), encoding="utf-8")
    scene = scene_of_file(path, model_of(path))
    model, q = tree(scene)[0], np.array([0.3, 0.5])
    upper = np.triu(pin.crba(model, model.createData(), q))
    assert np.abs(dynamics_of(scene)(q, q, np.zeros(0))[0] - upper - np.triu(upper, 1).T).max() <= SAME


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('value="1.3"', 'value="heavy"', "upper.*heavy"),
        ('xyz="0 .1 -.2"', 'xyz="0 .1"', "three numbers"),
        ("</robot>", "", "not XML"),
        ("robot", "model", "<model>|compiler refuses"),
        (
            '<dynamics damping=".2"/>',
            '<mimic joint="elbow"/>',
            "mimics 'elbow', which does not exist; .*: shoulder, tip",
        ),
    ],
)
def test_a_wrong_urdf_is_refused_by_name(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(URDF.replace(old, new), encoding="utf-8")
    with pytest.raises(SceneError, match=said):
        cases.load(str(path))


def test_what_is_strange_in_a_file_is_told(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(URDF, encoding="utf-8")
    arguments = ["run", str(path), "-e", "reference:compiled", "--set", "t_end=0.1", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 0, result.output
    assert "note: arm.urdf: Link 'hand'" in result.stderr


def test_what_is_left_out_of_a_urdf_is_told_once(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Bounds that MuJoCo drops; its own warnings came again at every reading."""
    text = URDF.replace('lower="-2" upper="2"', 'lower="0" upper="0"')
    path = tmp_path / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    case = cases.load(str(path), t_end=0.1)
    told = [one for one in case.findings if "Link" not in one]
    assert told == ["MuJoCo warns: joint 'shoulder' has equal lower and upper limits, limit ignored."]
    assert "WARNING" not in "".join(capfd.readouterr())


def test_a_urdf_runs_in_the_reference_and_in_pinocchio(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(URDF, encoding="utf-8")
    case = cases.load(str(path), t_end=0.5)
    runs = [
        engines.load(e).prepare(case, p, rtol=1e-11).run() for e, p in (("reference", "compiled"), ("pinocchio", "law"))
    ]
    assert all(run.outcome is Outcome.FINISHED for run in runs)
    assert np.abs(runs[0].q[-1] - runs[1].q[-1]).max() <= 1e-8


DROPS = """<mujoco><worldbody><geom name="floor" type="plane" size="2 2 .1" euler="{tilt} 0 0"/>
<body pos="0 0 .5"><joint name="z" type="slide" axis="0 0 1"/>
<geom name="solid" type="{kind}" euler="{euler}" size=".12 .2 .07" mass="1"/></body></worldbody>
<default><geom condim="1" solref="-4000 -10" solimp=".9999 .9999"/></default></mujoco>"""


@pytest.mark.parametrize("kind", ["sphere", "capsule", "cylinder", "ellipsoid", "box"])
@pytest.mark.parametrize("euler", ["20 30 0", "-50 10 40"])
def test_a_solid_that_drops_touches_when_it_has_fallen_its_gap(tmp_path: Path, kind: str, euler: str) -> None:
    """The gap is MuJoCo's own distance; the slide does not turn, so that h = h0 - g t^2/2 until the touch."""
    import mujoco

    path = tmp_path / "drop.xml"
    path.write_text(DROPS.format(kind=kind, euler=euler, tilt=0))
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    height = mujoco.mj_geomDistance(model, data, 0, 1, 10.0, None)
    case = cases.load(path, t_end=0.4)
    run = engines.load("reference").prepare(case, "compiled", rtol=1e-11).run()
    assert run.outcome is Outcome.FINISHED, run.message
    touch = min(event.t for event in run.events)
    assert touch == pytest.approx(np.sqrt(2.0 * height / 9.81), abs=1e-9)


def test_engines_agree_on_what_bounces(tmp_path: Path) -> None:
    path = tmp_path / "drop.xml"
    path.write_text(
        DROPS.format(kind="box", euler="20 30 0", tilt=0).replace('type="slide" axis="0 0 1"', 'type="free"')
    )
    case = cases.load(path, t_end=0.35)
    ends = [
        engines.load(name).prepare(case, profile, **settings).run().q[-1]
        for name, profile, settings in (
            ("reference", "compiled", {"rtol": 1e-10}), ("reference", "cvode", {"rtol": 1e-10}),
            ("pinocchio", "law", {}), ("mujoco", "matched", {"dt": 1e-4}),
        )
    ]  # fmt: skip
    assert np.abs(ends[1] - ends[0]).max() < 1e-7
    assert np.abs(ends[2] - ends[0]).max() < 1e-6
    assert np.abs(ends[3] - ends[0]).max() < 1e-4  # first order in the step where it touches, at a few m/s


@pytest.mark.parametrize(
    ("bounds", "wanted"),
    [('upper="1"', (0.0, 1.0)), ('lower="-1"', (-1.0, 0.0)), ('lower="-1" upper="2"', (-1.0, 2.0)),
     ("", (-np.inf, np.inf))],
)  # fmt: skip
def test_a_bound_of_a_urdf_that_is_left_out_is_0(bounds: str, wanted: tuple[float, float], tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    path.write_text(
        f'<robot name="arm"><link name="base"/><link name="arm">{body}</link><joint name="j" type="revolute">'
        f'<parent link="base"/><child link="arm"/><axis xyz="0 1 0"/><limit {bounds} effort="1" velocity="1"/>'
        "</joint></robot>"
    )
    scene = cases.from_file(path).scene
    assert scene is not None
    assert scene.joints[0].range == pytest.approx(wanted)


EVERYTHING = """
<mujoco><option gravity="0 0 -9.81"/><worldbody><geom type="plane" size="1 1 1"/><body name="arm" pos="0 0 1">
<joint name="shoulder" axis="0 1 0" range="-1 1" limited="true" damping="1" stiffness="2" armature=".1" springref=".1"/>
<inertial pos="0 0 .5" mass="1" diaginertia=".1 .1 .01"/><geom type="capsule" size=".1 .2" pos="0 0 .3" friction="1"/>
<body name="two" pos="0 0 .5"><joint name="elbow" axis="0 1 0"/><geom type="box" size=".1 .1 .2" mass="1"/></body>
</body></worldbody><tendon><fixed name="rope" range="-1 1" limited="true"><joint joint="shoulder" coef="1"/>
<joint joint="elbow" coef="2"/></fixed></tendon><actuator><motor joint="shoulder" gear="2"/>
<general joint="elbow" gainprm="1 2 3" biasprm="1 2 3" gear="1" armature="1" damping="1"/>
<position tendon="rope" kp="30" kv="2" gear="1.5" forcerange="-20 20"/></actuator>
<keyframe><key name="home" qpos=".1 .2" qvel="1 2" ctrl="1 2 3"/></keyframe></mujoco>
"""


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("number", ["1e308", "-1e308", "1e155", "1e-308", "5e-324"])
def test_a_number_at_an_end_of_double_precision_is_read_or_refused_in_a_sentence(number: str, tmp_path: Path) -> None:
    """Each attribute of a file in turn: what is made of it, or its square, may have no such number."""
    path, whole = tmp_path / "far.xml", list(ET.fromstring(EVERYTHING).iter())
    found = [(i, name) for i, one in enumerate(whole) for name, text in one.items() if re.fullmatch(r"[-\d. ]+", text)]
    assert len(found) > 30
    for i, name in found:
        root = ET.fromstring(EVERYTHING)
        element = list(root.iter())[i]
        element.set(name, " ".join([*element.get(name, "").split()[:-1], number]))
        path.write_text(ET.tostring(root, encoding="unicode"))
        with suppress(CrossbodyError):
            engines.load("reference").prepare(cases.load(str(path), t_end=0.01))


def test_a_gear_without_a_square_is_told_by_its_actuator() -> None:
    with pytest.raises(SceneError, match=r"^Actuator 'm': gear is \(1e\+308,\); valid: numbers whose squares are fin"):
        Actuator(name="m", joint="j", gear=(1e308,))


def test_a_parameter_of_a_file_is_told_with_the_files_name(tmp_path: Path) -> None:
    name = write(tmp_path)
    with pytest.raises(InvalidValue, match=r"^arm\.xml:raised: t_end is -1; valid: \(0, inf\) s\.$"):
        cases.load(name, "raised", t_end=-1.0)
    with pytest.raises(UnknownName, match=r"variant .* of arm\.xml"):
        cases.load(name, "none")


HUNG = """<robot name="hung"><link name="world"/>
  <link name="mount"/><link name="drone"><inertial><mass value="1.3"/><origin xyz=".01 .02 .03"/>
    <inertia ixx=".01" iyy=".02" izz=".025" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="fixed" type="fixed"><parent link="world"/><child link="mount"/><origin xyz="{a}" rpy="{b}"/></joint>
  <joint name="free" type="floating"><parent link="mount"/><child link="drone"/><origin xyz="{c}" rpy="{d}"/></joint>
</robot>"""


@pytest.mark.parametrize("seed", range(10))
def test_a_body_that_floats_on_a_fixed_mount_begins_where_its_file_says(seed: int, tmp_path: Path) -> None:
    """Pinocchio reads the file by itself."""
    pin = pytest.importorskip("pinocchio")
    rng = np.random.default_rng(seed)
    path = tmp_path / "hung.urdf"
    numbers = {name: " ".join(f"{x:.6f}" for x in rng.normal(size=3)) for name in "abcd"}
    path.write_text(HUNG.format(**numbers))
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    place = data.oMi[model.getJointId("free")]
    q0 = np.array(cases.from_file(str(path)).q0)
    np.testing.assert_allclose(q0[:3], place.translation, atol=1e-9)
    np.testing.assert_allclose(matrices(q0[3:7]), place.rotation, atol=1e-9)


MAST = """<robot name="mast"><link name="ground"/>
<link name="mast">{mass}<collision><origin xyz="0 0 -1"/><geometry><box size="4 4 .2"/></geometry></collision></link>
<joint name="stands" type="fixed"><parent link="ground"/><child link="mast"/><origin xyz="0 0 {z}"/></joint>
<link name="arm">{mass}</link>
<joint name="lift" type="{lift}"><parent link="mast"/><child link="arm"/><origin xyz="0 0 -.2"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="1" effort="1" velocity="1"/></joint>
<link name="foot">{mass}<collision><geometry><sphere radius=".1"/></geometry></collision></link>
<joint name="ankle" type="fixed"><parent link="arm"/><child link="foot"/><origin xyz="0 0 -.3" rpy=".4 0 0"/></joint>
</robot>
"""


@pytest.mark.parametrize("lift", ["prismatic", "floating"])
def test_what_the_world_bears_has_its_mass_and_its_shapes_in_every_engine(lift: str, tmp_path: Path) -> None:
    """MuJoCo's compiler merges it with the world: then bodies have other numbers, and the energy lacks its share."""
    path = tmp_path / "mast.urdf"
    mass = '<inertial><mass value="1.5"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
    path.write_text(MAST.format(mass=mass, z=1.7, lift=lift))
    case = cases.load(str(path), t_end=0.02, friction=1)
    for engine, profile in (("reference", "compiled"), ("mujoco", "as_is")):
        run = engines.load(engine).prepare(case, profile).run()
        assert np.abs(run.gap[0] - (1.2 - 0.1 - 0.8)).min() <= 1e-12
        assert run.energy[0, 1] == pytest.approx(1.5 * 9.81 * (1.7 + 1.5 + 1.2), rel=1e-12)
