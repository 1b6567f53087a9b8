"""Shapes that meet without a row: found between the steps of a run, located, and told in one sentence."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crossbody import cases, engines
from crossbody.cases import CaseUnsupported, Outcome
from crossbody.cases.files.contacts import _why
from crossbody.cases.scene_contacts import unknown
from crossbody.engines.equations import system_of
from crossbody.reference import simulate
from crossbody.reports.commands.analyse import analyse
from crossbody.reports.runs import choice, jobs

GATE = """<mujoco><option gravity="0 0 {gravity}"/><worldbody>
  <geom name="wall" type="box" condim="4" pos="{wall} 0 0" size="{half} 1 1"/>
  <body name="ball" pos="{start} 0 0"><joint type="slide" axis="{axis}"/>
    <joint type="hinge" axis="0 0 1"/><geom name="ball" size="{radius}" mass="1"/></body>
  </worldbody><keyframe><key name="thrown" qvel="{speed} 0"/></keyframe></mujoco>"""


def gate(folder: Path, **numbers: float | str) -> str:
    """Return a file of a ball that moves along x towards a wall whose friction, which spins, no row stands for."""
    given = {"gravity": 0.0, "wall": 0.0, "half": 1e-3, "start": -1.0, "axis": "1 0 0", "radius": 1e-3, "speed": 0.0}
    path = folder / "gate.xml"
    path.write_text(GATE.format(**(given | numbers)), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("profile", ["compiled", "cvode"])
@pytest.mark.parametrize("seed", range(3))
def test_a_meeting_between_two_steps_is_found_where_it_is(profile: str, seed: int, tmp_path: Path) -> None:
    """A steady motion takes a step or two: it passes a thin wall inside one, as fast as it likes."""
    rng = np.random.default_rng(seed)
    speed, half, radius = 10.0 ** rng.uniform(0.5, 1.0), rng.uniform(2e-3, 1e-2), rng.uniform(2e-3, 1e-2)
    case = cases.load(gate(tmp_path, speed=speed, half=half, radius=radius))
    run = engines.load("reference").prepare(case, profile).run()
    assert run.outcome is Outcome.INCONSISTENT
    told = re.search(r"come within reach at t = (\S+) s", run.message)
    assert told is not None
    assert float(told[1]) == pytest.approx((1.0 - half - radius) / speed, rel=1e-5)
    assert "'wall' and 'ball'" in run.message or "'ball' and 'wall'" in run.message


def test_a_run_that_ends_early_behind_it_is_inconsistent_too(tmp_path: Path) -> None:
    case = cases.load(gate(tmp_path, speed=5.0))
    before, behind = (engines.load("reference").prepare(case, "compiled", max_steps=steps).run() for steps in (4, 5))
    assert before.outcome is Outcome.STEP_LIMIT
    assert before.t[-1] < 0.1996 < behind.t[-1] < case.t_end
    assert behind.outcome is Outcome.INCONSISTENT
    assert "come within reach at t = 0.1996 s" in behind.message


def test_nothing_is_judged_behind_it(tmp_path: Path) -> None:
    case = cases.load(gate(tmp_path, speed=5.0))
    with pytest.raises(CaseUnsupported, match=r"gate.xml:thrown: Shapes .* come within reach at t = 0\.1996 s"):
        jobs.run_case(case, [choice.Pick(engine="reference", profile="compiled")])


def test_a_motion_that_passes_beside_it_runs(tmp_path: Path) -> None:
    case = cases.load(gate(tmp_path, speed=5.0, wall=-3.0))
    assert engines.load("reference").prepare(case, "compiled").run().outcome is Outcome.FINISHED


@pytest.mark.parametrize("seed", range(20))
def test_friction_is_a_reason_where_the_contact_has_it(seed: int, tmp_path: Path) -> None:
    """By MuJoCo's own contacts, whatever the shapes' priorities."""
    rng = np.random.default_rng(seed)
    dims, priorities = rng.choice([1, 1, 3, 4, 6], 2), rng.integers(0, 2, 2)
    balls = "".join(
        f'<body pos="{0.15 * k} 0 0"><freejoint/><geom size="0.1" condim="{dim}" priority="{first}"/></body>'
        for k, (dim, first) in enumerate(zip(dims, priorities, strict=True))
    )
    path = tmp_path / "balls.xml"
    path.write_text(f"<mujoco><worldbody>{balls}</worldbody></mujoco>")
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    dim = int(data.contact.dim[0])
    rolls = "torsional and rolling" if dim > 3 else ""
    for friction, told in ((0, rolls or ("friction is left out" if dim > 1 else "")), (1, rolls)):
        scene = cases.from_file(str(path), friction=friction).scene
        assert scene is not None
        assert told in _why(model, (0, 1), unknown(scene))
        assert bool(told) == bool(unknown(scene))


def test_a_hull_without_friction_has_too_many_corners() -> None:
    points = " ".join(f"{x:.6f}" for x in Rotation.random(300, rng=0).apply([0.0, 0.0, 1.0]).ravel())
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="ball" vertex="{points}"/></asset><worldbody><geom type="plane" size="1 1 1" '
        'condim="1"/><body><freejoint/><geom type="mesh" mesh="ball" condim="1"/></body></worldbody></mujoco>'
    )
    assert _why(model, (0, 1), {}).startswith("the hull has more than 256 corners")


BOX = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
  <body name="box" pos="0 0 {height}"><freejoint/><geom name="box" type="box" size=".1 .1 .1" mass="1"
  condim="{condim}"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(("condim", "friction", "reason"), [(3, -1, "friction=1 has it"), (4, 1, "torsional")])
def test_equations_of_a_file_say_whose_contacts_they_leave_out(
    condim: int, friction: int, reason: str, tmp_path: Path
) -> None:
    path = tmp_path / "box.xml"
    path.write_text(BOX.format(height=0.2, condim=condim), encoding="utf-8")
    case = cases.load(str(path), friction=friction)
    run = simulate(system_of(case), case.q0, case.v0, 0.5)
    assert run.q[-1, 2] < 0.0  # through the floor
    assert "'box' and 'floor' have no rows and pass through each other" in run.message
    assert reason in run.message


def test_an_equilibrium_of_a_file_rests_on_contacts_that_slide(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "box.xml"
    path.write_text(BOX.format(height=0.1, condim=3), encoding="utf-8")
    analyse(str(path), None, [], [], bode=False, locus=None, mapped=False, out=None, command="")
    told = capsys.readouterr()
    assert "held by floor:box" in told.out
    assert "no rows" not in told.err
    path.write_text(BOX.format(height=0.1, condim=4), encoding="utf-8")
    analyse(str(path), None, [], [], bode=False, locus=None, mapped=False, out=None, command="")
    assert "have no rows" in " ".join(capsys.readouterr().err.split())


HULL = """<mujoco><asset><mesh name="m" vertex="-.1 -.1 -.1 .1 -.1 -.1 0 .1 -.1 0 0 .1"/></asset><worldbody>
  <geom name="floor" type="plane" size="1 1 1"/>
  <body pos="0 0 .1"><geom name="table" type="box" size=".5 .5 .1"/></body>
  <body pos="0 0 .32"><freejoint/><geom name="hull" type="mesh" mesh="m"/></body></worldbody></mujoco>"""


def test_an_equilibrium_is_not_silent_on_shapes_whose_gap_nobody_knows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It lies inside of the table."""
    path = tmp_path / "hull.xml"
    path.write_text(HULL, encoding="utf-8")
    analyse(str(path), None, [], [], bode=False, locus=None, mapped=False, out=None, command="")
    told = " ".join(capsys.readouterr().err.split())
    assert "'hull' and 'table' have no rows and pass through each other" in told
    assert "the gap between a box and a hull is not implemented" in told
