"""Whatever a file says is compared: a reader that makes something else of it is told, and excused for nothing else."""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from robot_readers import ARM, HEAD, rows_of, run

from crossbody.cases import CrossbodyError, installed
from crossbody.cases.files.conformance import FEATURES
from crossbody.engines import importers
from crossbody.engines.importers.beside.conventions import rotation
from crossbody.engines.importers.beside.process import tried
from crossbody.engines.importers.beside.solids import bounds
from crossbody.reports.importers.audit import _answered, audited, opened
from crossbody.reports.importers.causes import advice, explained, parts, uses
from crossbody.reports.importers.compare import FAILED, NONE, OK, UNSEEN, UNSUPPORTED, WORDS, WRONG, Said, rows
from crossbody.reports.importers.declared import excused
from crossbody.reports.importers.forms import Forms
from crossbody.reports.importers.motion import inertia
from crossbody.reports.importers.told import sarif, sentence

PARTS = """<mujoco><compiler autolimits="true"/><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<site name="s0" pos="0 0 2"/><body name="b1" pos="0 0 1"><joint name="j1" range="-99 99" axis="0 1 0" damping="1 .2 .3"
 stiffness="4 .5 .6"/><geom name="g1" type="capsule" size=".05 .2" mass="1" friction="1.6 .01 .001"
 solref=".03 .8"/>
<body name="b2" pos="0 .1 .5" euler="10 20 30"><joint name="j2" type="ball" damping=".4" stiffness="2"/>
<geom name="g2" type="box" size=".1 .2 .3" euler="15 0 0" mass="1"/><body name="b3" pos=".1 0 .4"><joint name="j3"
 actuatorfrcrange="-3 4"/>
<geom name="g3" type="cylinder" size=".1 .2" mass="1"/><geom name="g4" type="ellipsoid" size=".1 .2 .3" pos="0 0 .1"/>
<site name="s1" pos="0 0 .1"/></body></body></body></worldbody>
<contact><exclude body1="b1" body2="b3"/></contact>
<tendon><fixed name="t1" stiffness="3"><joint joint="j1" coef="2"/><joint joint="j3" coef="1"/></fixed>
<spatial name="t2" range="0 9" damping="2" springlength=".1"><site site="s0"/><site site="s1"/></spatial></tendon>
<equality><connect name="e1" body1="b3" body2="b1" anchor="0 0 .1"/><weld name="e2" body1="b3" relpose="0 0 1 1 0 0 0"/>
<joint name="e3" joint1="j1" joint2="j3" polycoef=".1 2 0 0 0"/></equality>
<actuator><motor name="m1" joint="j1" gear="3"/><motor name="m2" joint="j2" gear="1 2 3"/>
<position name="m3" joint="j3" kp="10" kv="1"/><motor name="m4" tendon="t2" gear="2"/></actuator>
<keyframe><key name="k" qpos=".1 1 0 0 0 .2"/>
<key qpos=".2 0 1 0 0 .3"/></keyframe></mujoco>"""
CHANGES = [
    ("damping", '"1 .2 .3"', '"1 .21 .3"'), ("damping", '"1 .2 .3"', '"1 .2 .31"'),
    ("springs", '"4 .5 .6"', '"4 .5 .7"'),
    ("damping", 'damping=".4"', 'damping=".5"'), ("springs", 'stiffness="2"', 'stiffness="2.1"'),
    ("tendons", 'coef="2"', 'coef="2.5"'), ("tendons", 'springlength=".1"', 'springlength=".11"'),
    ("tendons", 'name="s1" pos="0 0 .1"', 'name="s1" pos="0 0 .2"'), ("loops", 'anchor="0 0 .1"', 'anchor="0 0 .2"'),
    ("loops", '"0 0 1 1 0 0 0"', '"0 .1 1 1 0 0 0"'), ("loops", '"0 0 1 1 0 0 0"', '"0 0 1 1 .1 0 0"'),
    ("loops", '".1 2 0 0 0"', '".1 2.1 0 0 0"'), ("loops", 'joint1="j1" joint2="j3"', 'joint1="j3" joint2="j1"'),
    ("loops", 'body2="b1" anchor', 'body2="b2" anchor'), ("actuators", 'gear="3"', 'gear="-3"'),
    ("actuators", 'gear="1 2 3"', 'gear="1 2 4"'), ("actuators", 'kp="10"', 'kp="11"'),
    ("actuators", 'kv="1"', 'kv="2"'),
    ("actuators", 'tendon="t2"', 'tendon="t1"'), ("shapes", '".1 .2 .3" euler', '".2 .1 .3" euler'),
    ("shapes", 'euler="15 0 0"', 'euler="-15 0 0"'), ("shapes", 'type="ellipsoid"', 'type="box"'),
    ("shapes", 'pos="0 0 .1"/>\n', 'pos="0 0 .2"/>\n'),
    ("shapes", '<geom name="g4"', '<geom name="g4" contype="0" conaffinity="0"'),
    ("contacts", '<exclude body1="b1" body2="b3"/>', ""),
    ("contacts", "<contact>", '<contact><pair geom1="g1" geom2="g2"/>'),
    ("contacts", 'name="g1"', 'name="g1" contype="2" conaffinity="2"'),
    ("effort", '"-3 4"', '"-3 5"'), ("surfaces", "1.6 .01", "1.7 .01"),
    ("surfaces", 'name="g1"', 'name="g1" condim="6"'),
    ("surfaces", 'name="g4"', 'name="g4" margin=".01"'), ("softness", '".03 .8"', '".03 .9"'),
    ("softness", 'name="j1" range', 'name="j1" solreflimit=".03 1" range'),
    ("softness", 'name="t2"', 'name="t2" solreflimit=".03 1"'),
    ("softness", 'name="floor"', 'name="floor" solmix="2"'), ("softness", 'name="e3"', 'name="e3" solref=".03 1"'),
    ("softness", "<worldbody>", '<option timestep=".02"/><worldbody>'), ("keyframes", 'qpos=".1', 'qpos=".11'),
    ("keyframes", '".2 0 1 0 0 .3"', '".2 0 0 1 0 .3"'),
]  # fmt: skip
"""Quantity, what a file says, and what a reader might take it for."""


@pytest.mark.parametrize(("quantity", "here", "there"), CHANGES)
def test_what_a_reader_might_mistake_is_a_difference(quantity: str, here: str, there: str, tmp_path: Path) -> None:
    assert here in PARTS
    assert rows_of(tmp_path / "parts.xml", "mujoco", PARTS, PARTS.replace(here, there, 1))[quantity] == WRONG


def test_our_tree_and_mujoco_agree_on_everything_that_is_compared(tmp_path: Path) -> None:
    """Forces of actuators, lengths of tendons, ends of loops, boxes of shapes and pairs: computed by either alone."""
    told = rows_of(tmp_path / "parts.xml", "mujoco", PARTS, PARTS)
    assert set(told.values()) <= {OK, NONE}, told
    assert {key for key, verdict in told.items() if verdict == NONE} == {"armature", "friction"}


@pytest.mark.parametrize(
    "without",
    ["friction", "contacts", "limits", "actuators", "loops", "tendons", "tendon:t1", "actuator:m3", "loop:e1"],
)
def test_what_is_left_out_is_held_against_nobody(without: str, tmp_path: Path) -> None:
    """MuJoCo reads the whole file all the same, and nothing of it is called wrong."""
    path, armature = tmp_path / "parts.xml", "tendon" in without
    more = 'name="t1" frictionloss=".2"' + ' armature=".1"' * armature
    path.write_text(PARTS.replace('name="t1"', more))
    [(_, _, found)] = audited(path, ["mujoco"], without, seconds=60.0)
    assert {row.verdict for row in found} <= {OK, NONE}, found
    assert {"M", "energy"}.isdisjoint(row.quantity for row in found) == armature


@given(
    st.sampled_from(["sphere", "capsule", "cylinder", "box", "ellipsoid"]),
    st.lists(st.floats(0.01, 2.0), min_size=3, max_size=3), st.lists(st.floats(-1.0, 1.0), min_size=7, max_size=7),
)  # fmt: skip
def test_bounds_of_a_shape_touch_it_from_all_sides(kind: str, size: list[float], place: list[float]) -> None:
    """A plane 1 m beyond each bound is 1 m from the shape, as another library measures it.

    That one is off by 3 cm for a cylinder that is tilted by 6e-15 rad.
    """
    turn = np.round([place[3] + 1.5, *place[4:]], 3).tolist()
    found = np.array(bounds(kind, size, (), place[:3], rotation(turn)))
    for axis, (low, high) in enumerate(zip(found[:3], found[3:], strict=True)):
        for sign, edge in ((1.0, high), (-1.0, low)):
            point, normal = np.array(place[:3]), -sign * np.eye(3)[axis]
            point[axis] = edge + sign
            said = (" ".join(f"{x:.17g}" for x in part) for part in (size, place[:3], turn, point, normal))
            text = "<geom type='{}' size='{}' pos='{}' quat='{}'/><geom type='plane' size='9 9 9' pos='{}' zaxis='{}'/>"
            body = text.format(kind, *said)
            model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
            data = mujoco.MjData(model)
            mujoco.mj_forward(model, data)
            assert mujoco.mj_geomDistance(model, data, 1, 0, 10.0, None) == pytest.approx(1.0, abs=1e-5)


BALL = """<mujoco><compiler angle="radian"/><worldbody><body name="a">
<joint name="j1" type="ball" range="0 1"/>{0}<body name="b" pos="0 0 1">
<joint name="j2" axis="0 1 0" range="-1 1"/>{0}</body></body></worldbody></mujoco>""".format(
    '<inertial pos="0 0 .5" mass="1" diaginertia=".1 .1 .1"/>'
)


@pytest.mark.parametrize(
    ("line", "excuses"),
    [
        ("a.xml:2: warning: The attribute 'range' found in a 'joint' tag is unsupported and will be ignored.", {"j1"}),
        ("warning: range of joint 'j2' is ignored.", {"j2"}), ("warning: ranges are ignored.", {"j1", "j2"}),
        ("a.xml:2: The tag 'limit' found as a child of 'joint' is currently unsupported.", {"j1", "j2"}),
    ],
)  # fmt: skip
def test_a_warning_excuses_what_it_names(line: str, excuses: set[str], tmp_path: Path) -> None:
    """A hinge that is read wrongly is wrong, whatever is said of the ball joint; and so is it behind a larger one."""
    path = tmp_path / "a.xml"
    path.write_text(BALL)
    audit = opened(path)
    for name in ("j1", "j2"):
        answer = json.loads(json.dumps(audit.wanted)) | {"version": "1", "told": [line]}
        answer["numbers"]["upper"][name] = [0.5]
        told = {row.quantity: row.verdict for row in rows("e", answer, audit.wanted, audit.job["joints"], audit.named)}
        assert (told["limits"] != WRONG) == (name in excuses), name
    answer["numbers"]["upper"]["j1"] = [1e3]
    told = {row.quantity: row.verdict for row in rows("e", answer, audit.wanted, audit.job["joints"], audit.named)}
    assert (told["limits"] != WRONG) == (excuses == {"j1", "j2"})


def test_a_body_that_a_reader_does_not_have_is_a_row(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    path.write_text(BALL)
    audit = opened(path)
    answer = json.loads(json.dumps(audit.wanted)) | {"version": "1"}
    del answer["states"][0]["frames"]["b"]
    [row] = [row for row in rows("e", answer, audit.wanted, audit.job["joints"]) if row.verdict == WRONG]
    assert sentence(row) == "e: bodies: b is missing: 1 of them, and 2 in the file."


def test_what_no_engine_shows_is_never_ok(tmp_path: Path) -> None:
    path = tmp_path / "parts.xml"
    path.write_text(PARTS.replace('"1 .2 .3"', '"1"').replace('"4 .5 .6"', '"4"'))
    [(_, _, found)] = audited(path, ["pinocchio"], seconds=60.0)
    told = {row.quantity: row for row in found}
    assert told["contacts"].verdict == UNSEEN
    assert "contacts not shown: " in sentence(told["contacts"])


LINK = """<inertial><origin xyz="0 0 .1"/><mass value="1"/>
<inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>"""
URDF = f"""<robot name="r"><link name="base"/><link name="a">{LINK}</link><joint name="j" type="revolute">
<parent link="base"/><child link="a"/><axis xyz="0 1 0"/><limit %s effort="1" velocity="1"/></joint></robot>"""


@pytest.mark.parametrize(
    ("limit", "bounds_"), [("", (0.0, 0.0)), ('lower=".5" upper=".5"', (0.5, 0.5)), ('upper="1"', (0.0, 1.0))]
)
def test_bounds_of_a_urdf_are_what_its_format_says(limit: str, bounds_: tuple[float, float], tmp_path: Path) -> None:
    """Its compiler takes bounds that are alike, and those that are not given, for none: the audit does not."""
    path = tmp_path / "arm.urdf"
    path.write_text(URDF % limit)
    wanted = opened(path).wanted["numbers"]
    assert (wanted["lower"]["j"], wanted["upper"]["j"]) == ([bounds_[0]], [bounds_[1]])
    assert (wanted["least force"]["j"], wanted["most force"]["j"]) == ([-1.0], [1.0])


def test_a_largest_force_of_0_is_a_bound(tmp_path: Path) -> None:
    """MuJoCo's compiler takes it for none."""
    path = tmp_path / "arm.urdf"
    path.write_text((URDF % 'lower="-1" upper="1"').replace('effort="1"', 'effort="0"'))
    told = {engine: {row.quantity: row.verdict for row in own} for _, engine, own in audited(
        path, ["mujoco", "pinocchio"], seconds=60.0)}  # fmt: skip
    assert (told["mujoco"]["effort"], told["pinocchio"]["effort"]) == (WRONG, OK)


FLOATING = """<robot name="r"><link name="base"/><link name="post"/><link name="top"/><link name="a">{0}</link>
<joint name="one" type="{1}"><parent link="base"/><child link="post"/><origin xyz="{2}" rpy="{3}"/></joint>
<joint name="two" type="fixed"><parent link="post"/><child link="top"/><origin xyz="{4}" rpy="{5}"/></joint>
<joint name="j" type="floating"><parent link="top"/><child link="a"/><origin xyz="{6}" rpy="{7}"/></joint></robot>"""


@pytest.mark.parametrize("seed", range(3))
def test_what_floats_on_links_that_are_fixed_is_free_in_the_world(seed: int, tmp_path: Path) -> None:
    """Every reader has it so, each counting from where its joint stands; pitch of 90 degrees is no other matter."""
    draw, path = np.random.default_rng(seed), tmp_path / "arm.urdf"
    turns = [draw.uniform(-3.0, 3.0, 3) for _ in range(6)]
    turns[1::2] = turns[1::2] if seed else [np.array([0.3, np.pi / 2, 0.2]), np.zeros(3), np.array([0.4, 0.0, 0.0])]
    path.write_text(FLOATING.format(LINK, "fixed", *(" ".join(map(repr, one.tolist())) for one in turns)))
    for _, engine, found in audited(path, ("mujoco", "pinocchio", "dart", "drake", "newton"), seconds=60.0):
        off = [row for row in found if row.verdict not in (OK, NONE) and row.quantity != "energy"]
        assert {row.quantity for row in off} <= ({"bodies"} if engine == "mujoco" else set()), off


def test_what_floats_on_a_link_that_moves_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(FLOATING.format(LINK, "continuous", *["0 0 0"] * 6))
    with pytest.raises(CrossbodyError, match=r"'j' floats on 'top', which joint 'one' moves; valid: a floating joint"):
        opened(path)


def test_a_planar_joint_is_called_by_its_own_name(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text((URDF % "").replace("revolute", "planar"))
    [(_, _, found)] = audited(path, ["pinocchio"], seconds=60.0)
    told = {row.quantity: row for row in found}
    assert (told["coordinates"].verdict, told["coordinates"].why[:12]) == (UNSEEN, "j is planar:")


def test_nothing_is_written_over_what_is_read_or_is_somebody_elses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, part, other = tmp_path / "arm.xml", tmp_path / "part.xml", tmp_path / "other.xml"
    joint = '<joint name="arm" axis="0 1 0"/>'
    path.write_text(ARM.replace(joint, '<include file="part.xml"/>'))
    part.write_text(f"<mujocoinclude>{joint}</mujocoinclude>")
    other.write_text("mine")
    for words in (
        ["--fix", "part.xml", "--force"],
        ["--sarif", "part.xml"],
        ["--markdown", "arm.xml"],
        ["--fix", "other.xml"],
        ["--sarif", "other.xml"],
        ["--markdown", "other.xml"],
    ):
        words[1] = str(tmp_path / words[1])
        before = Path(words[1]).read_text()
        assert run(["audit", str(path), "-e", "mujoco", *words], capsys)[0] == 2, words
        assert Path(words[1]).read_text() == before
    for option in ("--fix", "--sarif", "--markdown"):
        other.write_text("mine")
        for words in (["--force"], []):  # what it has written it may write again
            assert run(["audit", str(path), "-e", "mujoco", option, str(other), *words], capsys)[0] == 0
        assert "mine" not in other.read_text()
    both = ["--sarif", str(tmp_path / "a"), "--markdown", str(tmp_path / "a")]
    assert run(["audit", str(path), "-e", "mujoco", *both], capsys)[0] == 2


def test_what_is_no_file_or_nobody_reads_is_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    code, _, err = run(["audit", str(tmp_path)], capsys)
    assert (code, "is a folder" in err) == (2, True)
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    monkeypatch.setattr(installed, "_FILES", {})
    reader = tmp_path / "urdf_only.py"
    reader.write_text(HEAD.replace('("mjcf", "urdf")', '("urdf",)') + "    return None\n")
    installed.use([reader])
    code, _, err = run(["audit", str(path), "-e", "urdf_only"], capsys)
    assert (code, "reads no files of this format; valid: urdf" in err) == (2, True)
    reader.write_text(reader.read_text().replace('"numpy", "numpy"', '"nopackage", "nopackage"'))
    installed.use([reader])
    code, _, err = run(["audit", str(path), "-e", "urdf_only"], capsys)
    assert code == 2
    code, _, err = run(["audit", str(path), "-e", "exudyn"], capsys)
    assert (code, "no reader of robot files of its own" in err) == (2, True)


def test_a_version_that_was_not_tried_is_told() -> None:
    class Module:
        PACKAGE, TRIED = "numpy", ("0.1", "0.2")

    assert "was tested with 0.1 to 0.2" in tried(Module)
    Module.TRIED = ("0.1", "99.0")
    assert tried(Module) == ""


def test_what_is_to_be_said_of_a_readers_version_is_kept_beside_its_rows(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    found = opened(path)
    answer = found.wanted | {"told": [], "strange": "It was tried with others."}
    with Forms(path, lambda form: opened(form, "", found.job)) as forms:
        reading: Any = SimpleNamespace(name="fake", answer=lambda job: answer)
        [(_, _, told)] = _answered(found, [reading], set(), forms)
    assert {row.verdict for row in told} <= {OK, NONE}
    assert found.strange == {"fake": "It was tried with others."}


def test_a_file_with_a_strange_name_is_told_in_print(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / ("arm " + "long" * 30 + "\x1b[31m.xml")
    path.write_text(ARM)
    code, out, _ = run(["audit", str(path), "-e", "mujoco"], capsys)
    assert (code, "\x1b" in out, max(map(len, out.splitlines())) <= 80) == (0, False, True)
    [(_, _, found)] = audited(path, ["mujoco"])
    off = [row for row in found if row.quantity == "M"]
    uri = json.loads(sarif(path, [type(off[0])(engine="e", quantity="M", verdict=WRONG)]))
    place = uri["runs"][0]["results"][0]["locations"][0]["physicalLocation"]
    assert "arm%20long" in place["artifactLocation"]["uri"]
    assert "%1B" in place["artifactLocation"]["uri"]


def test_a_cause_is_one_without_which_the_reader_agrees(tmp_path: Path) -> None:
    """Two things that Pinocchio reads wrongly: each quantity has its own, on its line."""
    path = tmp_path / "arm.xml"
    text = ARM.replace("<worldbody>", '<option gravity="0 0 -3"/>\n<worldbody>\n<body name="base" pos="1 0 0">')
    path.write_text(text.replace("</worldbody>", "</body></worldbody>"))
    found = [row for _, _, own in audited(path, ["pinocchio"], seconds=60.0) for row in own]
    told = {row.quantity: row for row in explained(path, urdf=False, rows=found, seconds=60.0) if row.verdict == WRONG}
    assert {key: (row.cause, row.doubt, row.line) for key, row in told.items()} == {
        **dict.fromkeys(("gravity", "bias", "energy"), ("gravity", "", 1)),
        "frames": ("fixed body with a pose under the world", "", 3),
    }


def test_a_feature_stands_in_the_file_that_is_included(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.replace("<worldbody>", '<include file="part.xml"/>\n<worldbody>'))
    (tmp_path / "part.xml").write_text('<mujocoinclude>\n\n<option gravity="0 0 -3"/></mujocoinclude>')
    told = {use.feature.name: [(file.name, line) for file, line in use.places] for use in uses(path, urdf=False)}
    assert (told["gravity"], told["included file"]) == ([("part.xml", 3)], [("arm.xml", 1)])


def test_words_of_a_warning_are_whole(tmp_path: Path) -> None:
    assert not Said(["the inertiagrouprange is ignored"], {}, set()).excuse(WORDS["limits"], {"j"})


def test_every_importer_says_what_it_was_tried_with() -> None:
    assert all(len(importers.REGISTRY.load(name).TRIED) == 2 for name in importers.names())


PLAIN = [
    feature for feature in FEATURES
    if feature.format == "mjcf" and not feature.files and {j.type for j in feature.scene.joints} <= {"hinge", "slide"}
    and "compensation by actuators" not in feature.name
]  # fmt: skip


def of_mujoco(path: Path) -> Any:
    """What gives M and forces at a state by MuJoCo alone, and the names of its joints."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, motors = mujoco.MjData(model), np.zeros(model.nv)
    on_joints = model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)
    of = model.jnt_dofadr[model.actuator_trnid[on_joints, 0]]
    np.add.at(motors, of, (model.actuator_gear[:, 0] ** 2 * model.actuator_armature)[on_joints])

    def at(q: Any, v: Any) -> tuple[Any, Any]:
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        return M - np.diag(model.dof_armature + motors), data.qfrc_bias - data.qfrc_gravcomp

    return at, [model.joint(i).name for i in range(model.njnt)], model.qpos0


def of_pinocchio(path: Path, names: list[str]) -> Any:
    """The same by Pinocchio alone; nothing where it has other joints."""
    import pinocchio

    model = pinocchio.buildModelAndConstraintsFromMJCF(str(path))[0]
    data = model.createData()
    if list(model.names)[1:] != names or model.nv != len(names):
        return None

    def at(q: Any, v: Any) -> tuple[Any, Any]:
        M = np.triu(pinocchio.crba(model, data, q))
        return M + np.triu(M, 1).T - np.diag(model.armature), pinocchio.nonLinearEffects(model, data, q, v)

    return at


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_verdicts_are_what_two_libraries_say_of_a_changed_file(seed: int, tmp_path: Path) -> None:
    """A number of a feature's file is changed, 20 a seed: M, weight and bias differ by the audit where they do."""
    draw, seen = np.random.default_rng(seed), 0
    for k in range(20):
        feature = PLAIN[draw.integers(len(PLAIN))]
        found = list(re.finditer(r'(?<=[" ])-?\d*\.?\d+(?=[" ])', feature.text))
        one, path = found[draw.integers(len(found))], tmp_path / f"{k}.xml"
        new = float(one.group()) * draw.choice([1.0001, -1.0, 2.0, 0.0]) + draw.choice([0.0, 0.3])
        path.write_text(feature.text[: one.start()] + repr(float(new)) + feature.text[one.end() :])
        try:
            truth, names, home = of_mujoco(path)
            told = {engine: own for _, engine, own in audited(path, ["mujoco", "pinocchio"], seconds=60.0)}
        except (ValueError, CrossbodyError):
            continue
        if "gravcomp" in feature.text and new < 0.0:  # MuJoCo 4.0 leaves it out where no body has a positive one
            continue
        assert {row.verdict for row in told["mujoco"]} <= {OK, NONE}, (feature.name, one.group(), new)
        other = of_pinocchio(path, names) if told["pinocchio"][0].verdict == OK else None
        if other is None:
            continue
        seen += 1
        off = dict.fromkeys(("M", "gravity", "bias"), 0.0)
        for _ in range(4):
            q, v = home + draw.uniform(-1.0, 1.0, len(home)), draw.normal(size=len(home))
            for quantity, i, rate in (("M", 0, v), ("gravity", 1, 0.0 * v), ("bias", 1, v)):
                mine, theirs = truth(q, rate), other(q, rate)
                size = np.abs(mine[i]).max() + np.abs(mine[0]).max()
                off[quantity] = max(off[quantity], float(np.abs(mine[i] - theirs[i]).max() / size))
        for row in told["pinocchio"]:
            if row.quantity in off and not 1e-12 < off[row.quantity] < 1e-6:
                assert (row.verdict == OK) == (off[row.quantity] < 1e-9), (feature.name, new, row, off)
    assert seen >= 3


def test_a_joint_that_mimics_in_dart_is_not_said_to_be_missing(tmp_path: Path) -> None:
    """Its Python tells that there is one, and not of which joint."""
    path = tmp_path / "arm.urdf"
    path.write_text(next(feature.text for feature in FEATURES if feature.name == "URDF: mimic"))
    [(_, _, found)] = audited(path, ["dart"], seconds=60.0)
    assert {row.quantity: row.verdict for row in found}["loops"] == UNSEEN


@pytest.mark.parametrize("seed", range(6))
def test_rounding_of_weights_far_out_is_no_difference(seed: int, tmp_path: Path) -> None:
    """A balanced wheel on a post with mass: its gravity is 0, of sums that are not."""
    rng = np.random.default_rng(seed)
    place, turn = rng.uniform(-0.6, 0.6, 3), rng.uniform(-180.0, 180.0, 3)
    path = tmp_path / "wheel.xml"
    path.write_text(
        f'''<mujoco><worldbody><body euler="{turn[0]} {turn[1]} {turn[2]}"><geom type="box" size=".1 .1 .3"/>
        <body pos="{place[0]} {place[1]} {place[2]}"><joint name="s" axis="0 0 1"/>
        <geom type="cylinder" size=".02 .01"/></body></body></worldbody></mujoco>'''
    )
    found = {row.quantity: row for _, _, rows in audited(path, ["mujoco", "pinocchio"]) for row in rows}
    assert not [row for row in found.values() if row.verdict == WRONG and row.quantity in ("gravity", "bias")]


DECLARED = [
    ("gravity compensation", "a.xml:{}: The attribute 'gravcomp' found in a 'body' tag is unsupported.",
     {"gravity", "bias"}),
    ("gravity switched off", "a.xml:{}: The tag 'flag' found as a child of 'option' is currently unsupported.",
     {"gravity", "bias", "energy"}),
    ("total mass", "The attribute 'settotalmass' found in a 'compiler' tag will be ignored.",
     {"inertia", "M", "gravity", "bias", "energy"}),
    ("density of a geom", "a.xml:{}: The attribute 'density' found in a 'geom' tag will be ignored.",
     {"inertia", "M", "gravity", "bias", "energy"}),
    ("frame", "The tag 'frame' found as a child of 'body' is unsupported.", {"coordinates"}),
]  # fmt: skip


@pytest.mark.parametrize(("name", "line", "excuses"), DECLARED, ids=lambda one: one if isinstance(one, str) else "")
def test_all_that_follows_from_what_is_declared_is_unsupported_and_nothing_else(
    name: str, line: str, excuses: set[str], tmp_path: Path
) -> None:
    """The answer is that of a reader without fault to whom the file was given without it; then with a fault too."""
    path, bare = tmp_path / "a.xml", tmp_path / "bare.xml"
    text = next(feature.text for feature in FEATURES if feature.name == name)
    path.write_text(text)
    key = re.findall(r"'(\w+)'", line)[0]
    without = re.sub(rf"<(frame|option><flag)[^>]*>(</option>)?|</frame>| {key}=\"[^\"]*\"", "", text)
    number = 1 + next(k for k, one in enumerate(text.splitlines()) if key in one)
    bare.write_text(re.sub(r'<body name="lower".*?</body>', "", without, flags=re.S) if key == "frame" else without)
    for fault in ("", ' pos=".1 0 0"'):
        bare.write_text(bare.read_text().replace('<joint name="shoulder"', f'<joint name="shoulder"{fault}'))
        audit = opened(path)
        answer = opened(bare, job=audit.job).wanted
        lost = [name for name, *_ in audit.job["joints"] if name not in answer["numbers"]["armature"]]
        answer = answer | {"version": "1", "told": [line.format(number)], "missing": lost}
        with Forms(path, partial(opened, job=audit.job)) as forms:
            told = excused(rows("e", answer, audit.wanted, audit.job["joints"], audit.named), answer, audit, forms)
        off = {row.quantity: row.verdict for row in told if row.verdict not in (OK, NONE)}
        if not fault or lost:
            assert off == dict.fromkeys(excuses, UNSUPPORTED)
        else:
            assert off["M"] == off["frames"] == off["gravity"] == WRONG


def test_two_features_that_act_together_are_named_together(tmp_path: Path) -> None:
    """Weight is wrong by a mass and by gravity: without either it is wrong by the other."""
    path = tmp_path / "arm.xml"
    head = '<option gravity="0 0 -3"/><compiler settotalmass="3"/><worldbody>'
    path.write_text(ARM.replace("<worldbody>", head))
    found = [row for _, _, own in audited(path, ["pinocchio"], seconds=60.0) for row in own]
    told = {row.quantity: row for row in explained(path, urdf=False, rows=found, seconds=60.0) if row.verdict == WRONG}
    assert {told[key].cause for key in ("inertia", "M")} == {"total mass"}
    both = told["gravity"]
    assert (set(parts(both.cause)), both.doubt) == ({"total mass", "gravity"}, "")
    assert all(advice(one) in advice(both.cause) for one in parts(both.cause))


@pytest.mark.parametrize("columns", [40, 60, 80, 200])
def test_a_table_keeps_to_the_columns_that_there_are(
    columns: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    path = tmp_path / "arm.xml"
    path.write_text(PARTS)
    engines = ["mujoco", "pinocchio", "dart"]
    _, out, _ = run(["audit", str(path), *(word for name in engines for word in ("-e", name))], capsys)
    assert max(map(len, out.splitlines())) <= min(columns, 80)
    assert len(re.findall("^reading ", out, re.M)) == -(-len(engines) // ((min(columns, 80) - 13) // 11))


def test_a_reader_that_had_no_luck_once_is_not_explained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It fails the first time alone, as one that compiles itself does: no feature of the file is to blame."""
    monkeypatch.setattr(installed, "_FILES", {})
    reader, path = tmp_path / "slow.py", tmp_path / "arm.xml"
    body = f"""    from pathlib import Path
    mark = Path({str(tmp_path / "mark")!r})
    if not mark.exists():
        mark.touch()
        raise RuntimeError("not yet")
    from importlib.util import module_from_spec, spec_from_file_location
    spec = spec_from_file_location("own", {importers.REGISTRY.load("mujoco").__file__!r})
    own = module_from_spec(spec)
    spec.loader.exec_module(own)
    return own.open_robot(path, urdf)
"""
    reader.write_text(HEAD + body)
    installed.use([reader])
    path.write_text(ARM.replace("<worldbody>", '<option gravity="0 0 -3"/><worldbody>'))
    found = [row for _, _, own in audited(path, ["slow"], seconds=60.0) for row in own]
    assert [row.verdict for row in found] == [FAILED]
    assert [row.cause for row in explained(path, urdf=False, rows=found, seconds=60.0)] == [""]


@pytest.mark.parametrize("far", [1.0, 1e4, 1e9])
def test_a_robot_far_away_is_no_other_robot(far: float, tmp_path: Path) -> None:
    """Centres are rounded as the places they are measured at; one that is another is another as far as that."""
    text = PARTS.replace('pos="0 0 1"', f'pos="{far!r} 0 1"', 1)
    text = re.sub(r"<equality>.*?</equality>", "", text, flags=re.S)
    told = rows_of(tmp_path / "far.xml", "mujoco", text, text)
    assert told["inertia"] == OK
    other = text.replace('size=".1 .2" mass="1"', 'size=".1 .2" mass="1.001"')
    assert rows_of(tmp_path / "far.xml", "mujoco", text, other)["inertia"] == WRONG


@pytest.mark.parametrize("seed", range(10))
def test_how_far_inertias_are_apart_depends_on_no_unit(seed: int) -> None:
    """In other units of length and mass every number is another, and all gaps are the same."""
    rng = np.random.default_rng(seed)
    mine, theirs = (
        {name: np.append(rng.uniform(0.5, 2.0, 4), rng.uniform(1.0, 2.0, 6)) for name in "ab"} for _ in "12"
    )
    for length, mass in ((1.0, 1000.0), (1e3, 1.0), (1e-2, 7.0)):
        units = mass * np.repeat([1.0, length / mass, length**2], (1, 3, 6))
        other = [{name: numbers * units for name, numbers in side.items()} for side in (mine, theirs)]
        for one, scaled in zip(inertia(mine, theirs, 0.0), inertia(*other, 0.0), strict=True):
            assert (scaled.where, scaled.size) == (one.where, pytest.approx(one.size, rel=1e-9))
