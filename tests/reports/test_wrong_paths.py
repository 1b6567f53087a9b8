"""Paths and names that are not there, on the command line: what there is, or what would be valid, is told."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from robot_readers import ARM

from crossbody.cases import UnknownName
from crossbody.cases.errors import NoFile
from crossbody.reports.cli import main

MOTOR = '<actuator><motor name="m" joint="arm"/></actuator></mujoco>'
LISTED = "from crossbody.reports.cli import main; main(['list'])"
THERE = "Did you mean 'arm.xml'? Known: arm.xml, hand.xml."


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("arm.xml", "hand.xml", "arm.txt", "arm.mjcf", "ARM.XML"):
        Path(name).write_text(ARM)
    Path("apart").mkdir()
    Path("apart", "driven.xml").write_text(ARM.replace("</mujoco>", MOTOR))
    Path("empty.csv").touch()
    Path("folder.xml").mkdir()
    Path("below").mkdir()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("run arn.xml", f"There is no robot file 'arn.xml'. {THERE}"),
        ("audit arn.xml", f"There is no robot file 'arn.xml'. {THERE}"),
        ("stress arn.xml", f"There is no robot file 'arn.xml'. {THERE}"),
        ("run below/arm.xml", "There is no robot file 'below/arm.xml'; there is no other *.xml in its folder."),
        ("run gone/arm.xml", "There is no robot file 'gone/arm.xml': there is no folder 'gone'."),
        ("run folder.xml", "There is no robot file 'folder.xml': it is a folder, a pipe or a device."),
        ("audit arm", "There is no robot file 'arm'; valid: the path of a file."),
        ("audit arm.txt", "The robot file arm.txt ends in '.txt'; valid: .xml, .urdf."),
        ("run arm.txt", "The case 'arm.txt' is not a case file; its path must end in .py, .xml, .urdf."),
        ("run arm.mjcf", "The case 'arm.mjcf' is not a case file; its path must end in .py, .xml, .urdf."),
        ("run ARM.XML", "The case 'ARM.XML' is not a case file; its path must end in .py, .xml, .urdf."),
        ("run below", "The case 'below' is not a case file; its path must end in .py, .xml, .urdf."),
        ("run bouncing_ball.py", "There is no case file 'bouncing_ball.py'. Did you mean 'bouncing_ball'?"),
        ("run arm.xml --ctrl u.csv", "There is no table of controls 'u.csv'. Known: empty.csv."),
        ("run apart/driven.xml --ctrl empty.csv", "Controls empty.csv: No columns to parse from file; valid: a table"),
        ("run arm.xml --control pid.py:Pid --tick 1", "There is no controller file 'pid.py'; there is no other *.py"),
        ("analyse delta_impulse --at z", "--at 'z' is not name=value, for example --at z=0.4."),
        ("list mujco", "There is no case, engine, metric, suite or model 'mujco'. Did you mean 'mujoco'? Known are"),
        ("list positon", "There is no case, engine, metric, suite or model 'positon'. Did you mean 'position'? Known"),
    ],
)  # fmt: skip
def test_it_is_told(words: str, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(words.split())
    told = capsys.readouterr().err
    assert (end.value.code, told.count("\n")) == (2, 1)
    assert told.startswith(f"crossbody: {says}"), told
    assert "none." not in told


def test_files_alike_in_their_suffix_alone_are_not_meant() -> None:
    assert "Did you mean" not in str(NoFile("robot file", "xyz.xml"))
    assert str(UnknownName("thing", "a", ())) == "There is no thing 'a'. There are none."


def test_of_a_full_folder_some_files_are_named() -> None:
    for number in range(100):
        Path(f"{number:03}.urdf").touch()
    told = str(NoFile("robot file", Path("x.urdf")))
    assert told.endswith("018.urdf, 019.urdf.")


def test_in_a_folder_that_is_gone_what_needs_none_is_done_and_the_rest_is_told(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("gone").mkdir()
    words = "cd gone && rmdir ../gone && exec " + shlex.join([sys.executable, "-c", LISTED])
    done = subprocess.run(["sh", "-c", words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "bouncing_ball" in done.stdout
    Path("below").rename("gone")
    os.chdir("gone")
    os.rmdir("../gone")
    with pytest.raises(SystemExit) as end:
        main(["run", "bouncing_ball", "--variant", "linear", "-e", "reference:compiled", "--out", "out"])
    assert end.value.code == 2
    assert capsys.readouterr().err.endswith("crossbody: The working folder has been removed; change to another one.\n")
