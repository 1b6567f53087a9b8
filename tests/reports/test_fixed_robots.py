"""Files that are written so that more readers agree: they mean the same, and those that can agree on them do."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from places import ROBOTS

from crossbody.cases import SceneError
from crossbody.cases.files.conformance import FEATURES, Feature
from crossbody.reports.cli import main
from crossbody.reports.importers.audit import audited, of_scene, opened
from crossbody.reports.importers.compare import NONE, OK, WRONG, rows
from crossbody.reports.importers.conformance import written
from crossbody.reports.importers.fix import SAME, fixed

MOTION = ("coordinates", "inertia", "M", "gravity", "bias", "energy", "frames")
KEPT = tuple(feature for feature in FEATURES if feature.name not in ("URDF: floating joint",))


@pytest.mark.parametrize("feature", KEPT, ids=lambda feature: feature.name)
def test_what_a_file_means_is_what_it_meant(feature: Feature, tmp_path: Path) -> None:
    """By the scene that was written by hand: neither the old file nor a reader is asked."""
    path = written(feature, tmp_path)
    out = tmp_path / f"fixed{path.suffix}"
    fixed(path, out)
    wanted = of_scene(out, feature.scene)
    told = rows("fixed", opened(out).wanted, wanted.wanted, wanted.job["joints"])
    off = [row for row in told if row.quantity in SAME and row.verdict == WRONG and (row.difference or 1.0) > 1e-8]
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
    assert "must be another file" in capsys.readouterr().err


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
    monkeypatch.setattr("crossbody.reports.importers.fix._completed", lambda own, _above: own)
    path.write_text(PARTIAL.replace('size=".5" ', ""))
    with pytest.raises(SceneError, match="geom_friction of its compiled model would differ"):
        fixed(path, out)
    assert not out.exists()
