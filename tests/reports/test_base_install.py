"""Without any engine's package commands run what the reference can, and name the package that a robot file needs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ABSENT = ("mujoco", "pinocchio", "exudyn", "dartpy", "pymunk", "pydrake")
WITHOUT = f"""
import sys
sys.modules |= dict.fromkeys({ABSENT!r})
from crossbody.reports.entry import main
sys.argv[0] = "crossbody"
main()
"""
ROBOT = """<mujoco><worldbody><body><joint name="swing" axis="0 1 0"/><geom size=".1" pos="0 0 -.5"/></body></worldbody>
</mujoco>"""


def ran(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A command in a process in which no engine's package can be imported."""
    return subprocess.run([sys.executable, "-c", WITHOUT, *words], cwd=folder, capture_output=True, text=True)


@pytest.mark.parametrize("command", ["run", "list", "audit", "analyse", "stress", "bench"])
def test_a_robot_file_names_the_package_that_reads_it(command: str, tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(ROBOT, encoding="utf-8")
    found = ran(tmp_path, command, "arm.xml")
    assert found.returncode == 2, found.stderr
    assert "pip install 'crossbody[mujoco]'" in " ".join(found.stderr.split())
    assert [path.name for path in tmp_path.iterdir()] == ["arm.xml"]


@pytest.mark.parametrize(
    "words", [("run", "bouncing_ball", "--variant", "linear", "-q"), ("analyse", "bouncing_ball:linear", "-q")]
)
def test_a_case_of_the_library_needs_none(words: tuple[str, ...], tmp_path: Path) -> None:
    found = ran(tmp_path, *words)
    assert found.returncode == 0, found.stderr


@pytest.mark.parametrize("words", [(), ("log",)])
def test_without_a_command_the_help_is_as_it_stands(words: tuple[str, ...], tmp_path: Path) -> None:
    """It was one paragraph."""
    bare, asked = ran(tmp_path, *words), ran(tmp_path, *words, "--help")
    assert bare.returncode == 2
    assert bare.stderr.split("\n") == asked.stdout.split("\n")
