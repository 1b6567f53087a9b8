"""Files that are written so that more readers agree: they mean the same, and those that can agree on them do."""

from __future__ import annotations

import base64
from pathlib import Path

import mujoco
import numpy as np
import pytest
from places import ROBOTS

from crossbody.cases import OutputError, SceneError
from crossbody.cases.files.conformance import FEATURES, TETRAHEDRON, Feature
from crossbody.reports.cli import main
from crossbody.reports.importers.audit import audited, opened
from crossbody.reports.importers.compare import NONE, OK, WRONG, rows
from crossbody.reports.importers.conformance import audit_of, written
from crossbody.reports.importers.fix import SAME, fixed

MENTIONED = ("softness", "surfaces", "effort", "keyframes")
"""What a scene that was written by hand says only where the feature is about it."""
MOTION = ("coordinates", "inertia", "M", "gravity", "bias", "energy", "frames")


@pytest.mark.parametrize("feature", FEATURES, ids=lambda feature: feature.name)
def test_what_a_file_means_is_what_it_meant(feature: Feature, tmp_path: Path) -> None:
    """By the scene that was written by hand: neither the old file nor a reader is asked."""
    path = written(feature, tmp_path)
    out = tmp_path / f"fixed{path.suffix}"
    if feature.heavier:
        with pytest.raises(SceneError, match="armature"):
            fixed(path, out)
        return
    fixed(path, out)
    wanted = audit_of(feature, out)
    told = rows("fixed", opened(out).wanted, wanted.wanted, wanted.job["joints"])
    held = [row for row in told if row.quantity in SAME and row.quantity not in set(MENTIONED) - set(feature.about)]
    off = [row for row in held if row.verdict == WRONG and (row.difference or 1.0) > 1e-8]
    assert not off, off


@pytest.mark.parametrize("path", sorted(ROBOTS.glob("*/*.xml")), ids=lambda path: path.stem)
def test_a_published_robot_is_one_robot_behind_it(path: Path, tmp_path: Path) -> None:
    """MuJoCo's and Pinocchio's readers make the same mechanism of the new file, which of two old ones they do not."""
    out = tmp_path / path.name
    fixed(path, out)
    for _, engine, found in audited(out, ["mujoco", "pinocchio"], seconds=60.0):
        told = {row.quantity: row.verdict for row in found if row.quantity in (*MOTION, "armature")}
        assert len(told) == len(MOTION) + 1, engine
        assert set(told.values()) <= {OK, NONE}, (engine, told)


def test_what_is_not_rewritten_is_a_sentence_and_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "many.xml"
    body = '<body><joint/><geom size=".1"/></body>'
    path.write_text(f'<mujoco><worldbody><replicate count="2" offset="1 0 0">{body}</replicate></worldbody></mujoco>')
    with pytest.raises(SceneError, match="has <replicate>, which is not rewritten"):
        fixed(path, tmp_path / "out.xml")
    assert [one.name for one in tmp_path.iterdir()] == ["many.xml"]
    with pytest.raises(SystemExit) as end:
        main(["audit", str(path), "-e", "mujoco", "--fix", str(path)])
    assert end.value.code == 2
    assert "it must differ from" in capsys.readouterr().err


PARTIAL = """<mujoco><default><geom contype="4" friction=".3 .01 .001" size=".1 .2 .3"/></default>
<default><joint damping="2"/></default><worldbody><body><joint/><geom type="capsule" friction=".9" size=".5" mass="1"/>
</body></worldbody></mujoco>"""


def test_contacts_of_a_fixed_file_are_those_of_the_old_one(tmp_path: Path) -> None:
    """What is said in parts is completed by its class, which may be told in several places."""
    path, out = tmp_path / "parts.xml", tmp_path / "plain.xml"
    path.write_text(PARTIAL)
    fixed(path, out)
    old, new = (mujoco.MjModel.from_xml_path(str(one)) for one in (path, out))
    for name in ("geom_friction", "geom_size", "geom_contype", "dof_damping"):
        assert np.array_equal(getattr(old, name), getattr(new, name)), name


def test_what_a_rewriting_would_lose_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, out = tmp_path / "parts.xml", tmp_path / "plain.xml"
    path.write_text(PARTIAL)
    monkeypatch.setattr("crossbody.reports.importers.plain_mjcf._completed", lambda own, _above: own)
    path.write_text(PARTIAL.replace('size=".5" ', ""))
    with pytest.raises(SceneError, match="geom_friction of its compiled model would differ"):
        fixed(path, out)
    assert not out.exists()


PIXEL = base64.b64decode("iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElFTkSuQmCC")
ARM = """<mujoco><compiler angle="degree"/><worldbody>
<body name="stand" pos="0 0 1" euler="0 30 0">{on_stand}
 <body name="arm" pos=".2 0 0"><joint axis="0 1 0"/><geom size=".1" pos="0 0 -.5"/>
  <inertial mass="1" pos="0 .1 -.3" diaginertia=".1 .2 .15"/>{on_arm}</body></body>
</worldbody>{sensor}</mujoco>"""


@pytest.mark.parametrize(
    ("parts", "differs"),
    [
        ({"on_stand": '<geom type="box" fromto="0 0 0 .1 .2 .6" size=".1"/>'}, "where shapes are"),
        ({"on_stand": '<camera pos="1 1 1" mode="targetbody" target="stand"/>'}, "where cameras are"),
        ({"sensor": '<sensor><framequat objtype="body" objname="arm"/></sensor>'}, "what sensors say"),
    ],
)
def test_what_would_stand_or_be_felt_elsewhere_is_refused(
    parts: dict[str, str], differs: str, tmp_path: Path
) -> None:  # fmt: skip
    """Where it stays, the file is written; a capsule may be turned about its axis."""
    path, out = tmp_path / "arm.xml", tmp_path / "out.xml"
    nothing = dict.fromkeys(("on_stand", "on_arm", "sensor"), "")
    path.write_text(ARM.format(**nothing | {"on_stand": '<geom type="capsule" fromto="0 0 0 .1 .2 .6" size=".1"/>'}))
    fixed(path, out)
    out.unlink()
    path.write_text(ARM.format(**nothing | parts))
    with pytest.raises(SceneError, match=differs):
        fixed(path, out)
    assert [one.name for one in tmp_path.iterdir()] == ["arm.xml"]


def test_files_of_the_user_with_names_of_trials_stay(tmp_path: Path) -> None:
    """Causes are tried beside links to all files of the folder; a new form is written beside the user's."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(on_stand="", on_arm="", sensor="").replace("degree", 'degree" settotalmass="3'))
    mine = {f"{i}-arm.xml": "mine" for i in range(4)} | {".out.half.xml": "mine"}
    for name, text in mine.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(SystemExit):
        main(["audit", str(path), "-e", "pinocchio", "--explain", "--fix", str(tmp_path / "out.xml"), "--quiet"])
    assert {name: (tmp_path / name).read_text() for name in mine} == mine
    assert {one.name for one in tmp_path.iterdir()} <= {*mine, "arm.xml", "out.xml"}


def test_a_name_that_is_no_robot_files_is_told(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(on_stand="", on_arm="", sensor=""))
    with pytest.raises(OutputError, match=r"ends in \.xml or \.urdf"):
        fixed(path, tmp_path / "notes.txt")


MESHES = {
    "arm.xml": """<mujoco><compiler {0}/><asset><mesh name="m" file="part.obj"/>
<texture name="t" type="2d" file="t.png"/></asset><worldbody><body><joint axis="0 1 0"/>
<geom type="mesh" mesh="m"/></body></worldbody></mujoco>""",
    "arm.urdf": next(one.text for one in FEATURES if one.name == "URDF: mesh of a package"),
}


@pytest.mark.parametrize(
    ("name", "said", "folder"),
    [
        ("arm.xml", 'assetdir="parts"', "parts"),
        ("arm.xml", 'assetdir="none" meshdir="parts" texturedir="parts"', "parts"), ("arm.xml", "", "."),
        ("arm.urdf", "package://conformance/", "."), ("arm.urdf", "", "."), ("arm.urdf", "parts/", "parts"),
    ],
)  # fmt: skip
def test_a_file_in_another_folder_has_the_meshes_of_the_old_one(
    name: str, said: str, folder: str, tmp_path: Path
) -> None:
    """Readers that were told of no package find them too."""
    home, out = tmp_path / "conformance", tmp_path / "far" / "away" / name
    for made in (home / folder, out.parent):
        made.mkdir(parents=True)
    path = home / name
    path.write_text(MESHES[name].format(said).replace("package://conformance/", said))
    (home / folder / "part.obj").write_text(TETRAHEDRON)
    (home / folder / "t.png").write_bytes(PIXEL)
    fixed(path, out)
    [(_, _, found)] = audited(out, ["mujoco"], seconds=60.0)
    assert [row.verdict for row in found if row.quantity in ("reading", "shapes")] == [OK] * 2
