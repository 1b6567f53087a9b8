"""What a run in a warm cache does not import, because it would take longer than the run itself."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import sys
from pathlib import Path
from crossbody.reports import cli, entry

do, told = cli._do, Path(sys.argv.pop(1))

def noted(*given, **asked):
    code = do(*given, **asked)
    told.write_text(" ".join(sys.modules))
    return code

cli._do = noted
entry.main()
"""
ROBOT = Path(__file__).parents[1] / "support" / "driven_ball.xml"
NEEDLESS = {
    "numpy.ma", "pandas", "scipy.integrate", "scipy.interpolate", "scipy.linalg", "scipy.optimize", "scipy.sparse",
    "scipy.spatial", "yaml",
}  # fmt: skip
WARM = (
    "crossbody.reference.core.advance", "crossbody.reports.judging.known_answers",
    "crossbody.reports.judging.known_drives", "crossbody.reports.judging.known_engines",
    "crossbody.reports.judging.known_scenes", "crossbody.reports.judging.known_turns",
)  # fmt: skip
"""What the first run of a version of the code asks for, and keeps."""


def modules(tmp_path: Path, *words: str) -> set[str]:
    """Modules of a command when it has ended."""
    told = tmp_path / "modules.txt"
    ask = [sys.executable, "-c", SCRIPT, str(told), "run", "-q", *words, "--out", str(tmp_path / "out")]
    subprocess.run(ask, check=True, stdout=subprocess.DEVNULL, cwd=tmp_path)
    return set(told.read_text(encoding="utf-8").split())


@pytest.mark.parametrize(
    ("case", "engine"),
    [
        ("bouncing_ball:resting", "reference:compiled"), ("sliding_block:stops", "reference:compiled"),
        ("bouncing_ball:listing", "reference:compiled"), ("bouncing_ball:resting", "mujoco"),
        (str(ROBOT), "mujoco"),
    ],
)  # fmt: skip
def test_a_run_imports_nothing_that_it_does_not_need(case: str, engine: str, tmp_path: Path) -> None:
    if engine == "mujoco" and not importlib.util.find_spec(engine):
        pytest.skip("needs mujoco")
    modules(tmp_path, case, "-e", engine)  # the first run of a version asks the engine for its known answers
    later = modules(tmp_path, case, "-e", engine)
    assert not NEEDLESS & later
    assert not later.intersection(WARM)


def test_settings_of_numba_that_stand_here_are_read(tmp_path: Path) -> None:
    """yaml is imported for a file that is there."""
    (tmp_path / ".numba_config.yaml").write_text("developer_mode: 1\n", encoding="utf-8")
    ask = "from crossbody.reference import System; from numba.core import config; print(config.DEVELOPER_MODE)"
    told = subprocess.run([sys.executable, "-c", ask], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert told.split() == ["1"]


def test_what_numba_looks_at_is_there_for_others(tmp_path: Path) -> None:
    ask = "from crossbody.reference import System; import scipy, yaml; print(scipy.__name__, yaml.__name__)"
    told = subprocess.run([sys.executable, "-c", ask], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert told.split() == ["scipy", "yaml"]
