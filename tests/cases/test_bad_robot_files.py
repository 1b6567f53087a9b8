"""Robot files that come from anywhere: what is wrong in them is one sentence, at once, and nothing is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from crossbody import cases, engines
from crossbody.cases import InvalidValue, SceneError
from crossbody.cases.scene import LARGEST

BALL = '<geom type="sphere" size=".1" mass="{mass}" contype="0" conaffinity="0"/>'
BODY = '<body name="{name}"><joint name="{name}" type="hinge" axis="0 1 0"/>' + BALL + "</body>"


def written(path: Path, bodies: str, more: str = "") -> str:
    path.write_text(f"<mujoco><worldbody>{bodies}</worldbody>{more}</mujoco>")
    return str(path)


@pytest.fixture(autouse=True)
def nothing_else_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_number_that_is_none_is_not_taken_as_not_given(tmp_path: Path) -> None:
    path = written(tmp_path / "arm.xml", BODY.format(name="a", mass="nan"))
    with pytest.raises(SceneError, match="an entry is NaN; valid: numbers"):
        cases.load(path)
    assert [one.name for one in tmp_path.iterdir()] == ["arm.xml"]  # MuJoCo's own log is not begun


@pytest.mark.parametrize("count", [LARGEST + 1, 10 * LARGEST])
def test_more_bodies_than_a_scene_may_have_are_counted_before_they_are_compiled(count: int, tmp_path: Path) -> None:
    path = written(tmp_path / "many.xml", "".join(BODY.format(name=f"b{i}", mass=1) for i in range(count)))
    with pytest.raises(SceneError, match=f"more than {LARGEST} bodies"):
        cases.load(path)


def test_bodies_that_are_replicated_count(tmp_path: Path) -> None:
    many = '<replicate count="500">' * 3 + BODY.format(name="a", mass=1) + "</replicate>" * 3
    with pytest.raises(SceneError, match=f"more than {LARGEST} bodies"):
        cases.load(written(tmp_path / "many.xml", many))
    few = '<replicate count="3" offset="1 0 0">' + BODY.format(name="a", mass=1) + "</replicate>"
    scene = cases.load(written(tmp_path / "few.xml", few)).scene
    assert scene is not None
    assert len(scene.bodies) == 3


@pytest.mark.parametrize("name", ["../other.xml", "/etc/hostname", "inner/../../other.xml"])
def test_a_file_includes_nothing_from_outside_its_folder(name: str, tmp_path: Path) -> None:
    (tmp_path / "robot" / "inner").mkdir(parents=True)
    (tmp_path / "other.xml").write_text("<mujoco/>")
    path = written(tmp_path / "robot" / "arm.xml", BODY.format(name="a", mass=1), f'<include file="{name}"/>')
    with pytest.raises(SceneError, match="from outside its folder"):
        cases.load(path)


def test_what_is_included_from_inside_counts_once_and_may_include_itself(tmp_path: Path) -> None:
    part = "<mujocoinclude>" + BODY.format(name="part", mass=1) + "</mujocoinclude>"
    (tmp_path / "part.xml").write_text(part)
    scene = cases.load(written(tmp_path / "arm.xml", '<include file="part.xml"/>')).scene
    assert scene is not None
    assert [body.name for body in scene.bodies] == ["part"]
    (tmp_path / "part.xml").write_text('<mujoco><include file="part.xml"/></mujoco>')
    with pytest.raises(SceneError, match="MuJoCo's compiler refuses it"):
        cases.load(str(tmp_path / "arm.xml"))


CRANK = '<body name="{name}" pos="{x} 0 0"><joint name="{name}" type="hinge" axis="0 1 0"/>' + BALL + "{inner}</body>"


def four_bar(path: Path, qvel: str) -> str:
    rocker = CRANK.format(name="rocker", x=0.5, mass=1, inner="")
    inner = CRANK.format(name="coupler", x=0.3, mass=1, inner=rocker)
    bodies = CRANK.format(name="crank", x=0.0, mass=1, inner=inner)
    loop = '<equality><connect name="pin" body1="rocker" anchor=".2 0 .4"/></equality>'
    return written(path, bodies, f'{loop}<keyframe><key name="k" qpos="-.9 1.2 1.1" qvel="{qvel}"/></keyframe>')


def test_a_start_off_its_loops_says_what_to_type(tmp_path: Path) -> None:
    """And what is typed starts on them, its velocities too."""
    path = four_bar(tmp_path / "bar.xml", "1 2 3")
    with pytest.raises(SceneError, match=r"the start is off 'pin [xz]'.*--set assemble=1 starts in every engine at"):
        engines.load("reference").prepare(cases.load(path, t_end=0.1))
    case = cases.load(path, t_end=0.1, assemble=True)
    assert np.abs(case.v0).max() > 0.1
    run = engines.load("reference").prepare(case).run()
    assert run.outcome.ok, run.message
    assert np.nanmax(np.abs(run.gap)) < 1e-9


@pytest.mark.parametrize("kind", ["csv", "parquet", "npz"])
def test_controls_of_another_width_are_refused(kind: str, tmp_path: Path) -> None:
    arm = written(
        tmp_path / "arm.xml", BODY.format(name="a", mass=1), '<actuator><motor name="m" joint="a"/></actuator>'
    )
    table, path = pd.DataFrame({"t": [0.0, 1.0], "m": [1.0, 2.0], "other": 0.0}), tmp_path / f"u.{kind}"
    if kind == "npz":
        np.savez(path, t=table["t"], ctrl=table[["m", "other"]])
    else:
        (table.to_csv if kind == "csv" else table.to_parquet)(path, index=False)
    with pytest.raises(
        InvalidValue, match=r"does not belong to an actuator; valid: a table with the columns t, m\.|valid: \(2, 1\)\."
    ):
        cases.load(arm, ctrl=str(path))


def test_a_link_without_mass_behind_a_coupled_joint_is_named(tmp_path: Path) -> None:
    """Rows of loops are ranked by the mass matrix, before anything else looks at it."""
    links = "".join(f'<link name="{name}">{inertial}</link>' for name, inertial in (
        ("base", ""), ("arm", '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
                              "</inertial>"), ("tip", "")))  # fmt: skip
    joint = '<joint name="{}" type="continuous"><parent link="{}"/><child link="{}"/><axis xyz="0 1 0"/>{}</joint>'
    joints = joint.format("a", "base", "arm", "") + joint.format("b", "arm", "tip", '<mimic joint="a"/>')
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="r">{links}{joints}</robot>', encoding="utf-8")
    with pytest.raises(SceneError, match=r"not positive definite at the start: .* is above all velocity 1"):
        engines.load("reference").prepare(cases.load(str(path), t_end=0.1))
