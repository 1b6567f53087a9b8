"""What a run may import: each of these takes longer than the run."""

from __future__ import annotations

import gc
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from crossbody.reports import entry

READERS = ("crossbody.cases.files.mjcf", "crossbody.cases.files.urdf")  # of robot files
HEAVY = ("mujoco", "pandas", "scipy.interpolate", "scipy.linalg", "scipy.optimize", "scipy.sparse", *READERS)
SCRIPT = f"""
import sys
from crossbody.reports.cli import main
try:
    main(["run", "bouncing_ball:listing", "-e", "reference:compiled", "--quiet", "--out", sys.argv[1]])
except SystemExit as end:
    print(end.code, *(name for name in {HEAVY} if name in sys.modules))
"""


def test_a_run_of_the_reference_imports_nothing_for_others(tmp_path: Path) -> None:
    command = [sys.executable, "-c", SCRIPT, str(tmp_path / "out")]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.split() == ["0"]


SHOWN = """
import sys
MADE_BY = ("jinja2", "crossbody.reports.pages.html")
from crossbody.reports.commands import run
from crossbody.reports.cli import main
show = run.show
run.show = lambda *told: (show(*told), print("pages:", *(name in sys.modules for name in MADE_BY)))
try:
    main(["run", "bouncing_ball:listing", "-e", "reference:compiled", "--out", sys.argv[1]])
finally:
    print("at the end:", "jinja2" in sys.modules)
"""


def test_what_makes_pages_is_imported_once_the_verdicts_are_shown(tmp_path: Path) -> None:
    command = [sys.executable, "-c", SHOWN, str(tmp_path / "out")]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "within" in told.partition("pages: False False")[0]
    assert told.endswith("at the end: True\n")


@pytest.fixture
def collector() -> Iterator[None]:
    """The collector of garbage, which is put back as it was."""
    before = gc.get_threshold()
    yield
    gc.set_threshold(*before)


def test_garbage_is_looked_for_late_at_first_alone(collector: None) -> None:
    gc.callbacks.append(entry._look_more_often)
    gc.collect(0)
    assert gc.get_threshold()[0] == entry.FRESH < entry.FIRST
    assert entry._look_more_often not in gc.callbacks
