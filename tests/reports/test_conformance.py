"""The table of features of robot files: what each means, by two readers that share nothing; what is known of others."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from crossbody.cases import SceneError
from crossbody.cases.files.conformance import FEATURES, Feature
from crossbody.engines.importers import mujoco as own
from crossbody.engines.importers.beside.robot import measured
from crossbody.reports.cli import main
from crossbody.reports.importers.audit import of_scene, opened
from crossbody.reports.importers.compare import FAILED, NONE, OK, UNSEEN, UNSUPPORTED, WRONG, Row, rows
from crossbody.reports.importers.conformance import _told, audit_of, judged, misread, written

BY_NAME = {feature.name: feature for feature in FEATURES}


def each(features: tuple[Feature, ...]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("feature", features, ids=lambda feature: feature.name)


def test_there_are_many_features_and_each_has_a_name() -> None:
    assert len(BY_NAME) == len(FEATURES) >= 60


FAULTS_OF_MUJOCO = (
    "URDF: mesh of a package", "URDF: shape of a link without mass", "URDF: largest force of 0",
    "gravity compensation by actuators, of which there are none", "armature of a tendon across branches",
)  # fmt: skip
"""It asks for packages nobody, gives such a link the mass of its shapes, takes such a force for none, lets weight act
that no actuator is there to take off, and keeps of a tendon's armature what joints of one branch have of each
other."""


@pytest.mark.parametrize("name", FAULTS_OF_MUJOCO)
def test_what_mujoco_does_otherwise_is_seen(name: str) -> None:
    """A version of it that does better ends this test."""
    row = judged(BY_NAME[name], "mujoco")
    assert isinstance(row, Row)
    assert row.verdict in (WRONG, FAILED), row


@each(tuple(feature for feature in FEATURES if feature.name not in FAULTS_OF_MUJOCO))
def test_mujoco_reads_what_the_format_means(feature: Feature, tmp_path: Path) -> None:
    """The scene was written by hand, in another language than the file, and knows nothing of MuJoCo."""
    path = written(feature, tmp_path)
    audit = audit_of(feature, path)
    answer = measured(own.open_robot(str(path), urdf=False), audit.job) | {"told": []}
    told = [row for row in rows("mujoco", answer, audit.wanted, audit.job["joints"]) if row.quantity in feature.about]
    assert {row.verdict for row in told} <= {OK, NONE}, told


@each(FEATURES)
def test_our_own_reading_is_what_the_format_means(feature: Feature, tmp_path: Path) -> None:
    """What `crossbody audit` holds readers to on a user's file is right on every feature."""
    path = written(feature, tmp_path)
    audit = audit_of(feature, path)
    if feature.heavier:
        with pytest.raises(SceneError, match="armature"):
            opened(path)
        return
    mine = opened(path)
    told = [
        row for row in rows("ours", mine.wanted, audit.wanted, audit.job["joints"]) if row.quantity in feature.about
    ]
    assert mine.job == audit.job
    assert {row.verdict for row in told} <= {OK, NONE}, told


@pytest.mark.parametrize("name", ["two frames", "energy"])
def test_a_feature_is_judged_by_what_follows_from_nothing_else(name: str) -> None:
    """A reader that shows no energy is judged by M, weight and places; one that shows no loops is not ok on a loop."""
    hidden = {"energy": ""} if name == "energy" else {"loops": ""}
    feature = BY_NAME["two frames" if name == "two frames" else "arm"]
    audit = of_scene(Path("none.xml"), feature.scene)
    row = _told(feature, "e", audit, audit.wanted | {"unseen": hidden})
    assert isinstance(row, Row)
    assert row.verdict == (OK if name == "energy" else UNSEEN)


@pytest.mark.parametrize(("name", "verdict", "quantity"), [
    ("joint position of a class", WRONG, "M"),
    ("fixed body with a pose under the world", WRONG, "gravity"),
    ("frame", WRONG, "coordinates"),
    ("gravity", WRONG, "gravity"),
    ("spring", UNSUPPORTED, "springs"),
    ("euler sequence of moving axes", OK, "reading"),
])  # fmt: skip
def test_what_is_known_of_pinocchio(name: str, verdict: str, quantity: str) -> None:
    """A version of it that reads better ends this test, and the sentence in the changelog."""
    row = judged(BY_NAME[name], "pinocchio")
    assert isinstance(row, Row)
    assert (row.verdict, row.quantity) == (verdict, quantity), row


def test_a_page_and_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["conformance", "--feature", "gravity", "-e", "mujoco", "-e", "pinocchio", "--out", str(tmp_path / "out")])
    assert end.value.code == 0
    assert "mujoco 4" in capsys.readouterr().out
    found = json.loads((tmp_path / "out" / "conformance.json").read_text())["rows"]
    assert {(row["engine"], row["feature"], row["verdict"]) for row in found} >= {
        ("mujoco", "gravity", OK), ("mujoco", "gravity switched off", OK),
        ("pinocchio", "gravity", WRONG), ("pinocchio", "gravity switched off", WRONG),
    }  # fmt: skip
    page = (tmp_path / "out" / "index.html").read_text()
    assert "Readers of robot files" in page
    assert "gravity switched off" in page


def test_a_feature_that_there_is_not_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["conformance", "--feature", "warp drive", "--out", str(tmp_path / "out")])
    assert end.value.code == 2
    assert "warp drive" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("seed", range(20))
def test_which_reader_is_wrong_about_what_is_said_first(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = [
        {"feature": f"f{k}", "engine": engine, "verdict": str(rng.choice([OK, WRONG, FAILED, UNSEEN]))}
        for k in range(12) for engine in ("one", "two")
    ]  # fmt: skip
    first, *lines = misread(rows)
    good = sum(all(row["verdict"] == OK for row in rows if row["feature"] == f"f{k}") for k in range(12))
    assert first == f"{good} of 12 features are read by all engines as the format says."
    for engine in ("one", "two"):
        for word in (WRONG, FAILED):
            names = [row["feature"] for row in rows if (row["engine"], row["verdict"]) == (engine, word)]
            told = [line for line in lines if line.startswith(f"{engine} {word}: ")]
            assert len(told) == bool(names)
            if names:
                assert all(re.search(rf"\b{name}\b", told[0]) for name in names[:6])
                assert (f"and {len(names) - 6} more" in told[0]) == (len(names) > 6)
