"""Engines' own readers in processes of their own: maps of their coordinates, and what becomes of those that fail."""

from __future__ import annotations

import re
from pathlib import Path
from time import monotonic

import pytest
from robot_readers import BAD, importer

from crossbody.cases import installed
from crossbody.engines import importers
from crossbody.engines.importers import Reading
from crossbody.engines.importers.beside.robot import matched
from crossbody.reports.importers.audit import audited
from crossbody.reports.importers.compare import FAILED, UNSUPPORTED, WRONG

KINDS = """<mujoco model="robot"><compiler autolimits="true"/><worldbody>
  <body name="base" pos=".1 .2 1"><freejoint name="base"/>
    <inertial pos=".01 .02 .03" mass="2" fullinertia=".2 .3 .25 .01 .02 .03"/>
    <body name="arm" pos=".3 0 0"><joint name="arm" type="hinge" axis="0 1 0" pos=".1 0 0"/>
      <inertial pos=".1 0 .05" mass="1" diaginertia=".1 .2 .15"/>
      <body name="wrist" pos="0 .2 0"><joint name="wrist" type="ball"/>
        <inertial pos="0 .1 .05" mass=".5" diaginertia=".01 .02 .015"/>
        <body name="hand" pos="0 0 .1"><joint name="hand" type="slide" axis="1 0 0"/>
          <inertial pos="0 .1 .05" mass=".2" diaginertia=".01 .02 .015"/></body></body></body></body>
</worldbody></mujoco>"""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    path = tmp_path / "robot.xml"
    path.write_text(KINDS)
    return path


def as_dart_reads_it(text: str) -> str:
    """Return the file with the only inertias and the only form of a free joint that DART 6.20's reader knows."""
    text = re.sub(r"<inertial[^>]*>", '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>', text)
    return text.replace('1"><freejoint name="base"/>', '1" quat="1 .2 .3 .4"><joint name="base" type="free"/>')


@pytest.mark.parametrize("engine", importers.names())
def test_every_kind_of_joint_is_mapped_as_the_engine_has_it(engine: str, robot: Path) -> None:
    """M and bias are ours at random states with all rates nonzero, which a wrong map of velocities would not leave."""
    if engine == "dart":
        robot.write_text(as_dart_reads_it(KINDS))
    for found, _, rows in audited(robot, [engine], seconds=60.0):
        kept = {row.quantity: row for row in rows if row.quantity in ("inertia", "M", "gravity", "bias", "frames")}
        wrong = [row for row in kept.values() if row.verdict == WRONG]
        assert not wrong, (wrong, found.told[engine])
        assert rows[0].verdict != FAILED, rows[0]


@pytest.mark.parametrize("name", BAD)
def test_what_an_importer_does_to_its_process_is_a_row(
    name: str, robot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(installed, "_FILES", {})
    installed.use([importer(tmp_path, name, BAD[name])])
    began = monotonic()
    rows = {engine: own for _, engine, own in audited(robot, [name, "mujoco"], seconds=4.0)}
    assert monotonic() - began < 30.0
    assert [row.verdict for row in rows[name]] == [UNSUPPORTED if name == "refuses" else FAILED]
    said = {
        "aborts": "SIGABRT",
        "hangs": "within 4 s",
        "spins": "within 4 s",
        "swells": "MiB",
        "raises": "no such luck",
    }
    assert said.get(name, "") in rows[name][0].why
    assert all(row.verdict != WRONG for row in rows["mujoco"])


def test_an_interpreter_that_is_not_there_is_a_sentence(robot: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CROSSBODY_PYTHON_MUJOCO", "/nowhere/python")
    answer = Reading("mujoco", robot, urdf=False).answer({})
    assert answer["status"] == "failed"  # it was named: to say nothing would pass for an engine that was asked
    assert "/nowhere/python cannot be started" in answer["why"]


def test_joints_are_matched_by_name_then_in_order_on_their_body() -> None:
    ours = [["a", "one", "hinge"], ["joint1", "two", "slide"], ["joint2", "two", "hinge"]]
    theirs = [["x", "two", "slide", 0, 0], ["y", "two", "unbounded", 1, 1], ["a", "one", "hinge", 3, 2]]
    assert matched(ours, theirs) == {"a": 2, "joint1": 0, "joint2": 1}
    assert matched(ours, theirs[1:]) == {"a": 1}  # of two joints one is there: which, nobody knows
    assert matched([["a", "one", "slide"]], theirs) == {}
