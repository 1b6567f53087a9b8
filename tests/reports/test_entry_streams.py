"""Streams that the caller has closed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

COMMAND = Path(sys.executable).parent / "crossbody"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="closes a stream between fork and exec")
@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_command_ends_as_well_without_a_stream(number: int) -> None:
    """A shell closes them with <&-, >&- or 2>&-; a file that is opened next would be written in their stead."""
    done = subprocess.run(
        [COMMAND, "list"], preexec_fn=lambda: os.close(number), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "bouncing_ball" in done.stdout or number == 1
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(("words", "wanted"), [
    ("run bounc", "plain,bouncing_ball"), ("run red_body -e muj", "plain,mujoco"), ("list pin", "plain,pinocchio"),
    ("run red_body --variant fr", "plain,frozen"), ("replay -m ba", "plain,ball"), ("gapm", "plain,gapmap"),
    ("run ./robot", "file,./robot"), ("run bouncing_ball:lin", "plain,bouncing_ball:linear"),
    ("run bouncing_ball -e mujoco:m", "plain,mujoco:matched"), ("run robot.xml:st", "file,robot.xml:st"),
    ("identify -m single_pendulum -f del", "plain,delay"), ("identify -f del", "plain,delay"),
])  # fmt: skip
def test_a_shell_completes_commands_and_names(words: str, wanted: str) -> None:
    asked = {"COMP_WORDS": f"crossbody {words}", "COMP_CWORD": str(len(words.split()))}
    done = subprocess.run(
        [COMMAND], env={**os.environ, **asked, "_CROSSBODY_COMPLETE": "bash_complete"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout.split(), done.stderr) == (0, [wanted], "")


@pytest.mark.parametrize(("words", "known"), [
    ("run bouncing_ball --set ", {"plain,a0=", "plain,a1=", "plain,t_end="}),
    ("run bouncing_ball --set a0=1e4 --set t_", {"plain,t_end="}),
    ("run bouncing_ball:linear --set ", {"plain,a0=", "plain,t_end="}),
    ("analyse soft_contact --set ", {"plain,t_end="}),
    ("run bouncing_ball --set-engine ", {"plain,reference.rtol=", "plain,mujoco.dt="}),
    ("run --set-engine refe", {"plain,reference.rtol=", "plain,reference.max_steps="}),
    ("run bouncing_ball -e mujoco:matched --set-engine mujoco.d", {"plain,mujoco.dt="}),
    ("run robot.xml --law a", {"plain,a0=", "plain,a1="}),
    ("run robot.xml --law a0=1e4,a", {"plain,a0=1e4,a1="}),
])  # fmt: skip
def test_a_shell_completes_parameters_and_settings(words: str, known: set[str]) -> None:
    """Those that the command would take; of settings, those of the engines that are asked for."""
    *before, begun = words.split(" ")
    asked = {"COMP_WORDS": f"crossbody {words}", "COMP_CWORD": str(len(before) + 1)}
    done = subprocess.run(
        [COMMAND], env={**os.environ, **asked, "_CROSSBODY_COMPLETE": "bash_complete"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    offered = done.stdout.split()
    assert known <= set(offered)
    assert all(one.startswith(f"plain,{begun}") and one.endswith("=") for one in offered)
    if " -e " in words:
        assert all(one.startswith("plain,mujoco.") for one in offered)
