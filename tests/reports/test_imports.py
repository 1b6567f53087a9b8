"""What a run may import: each of these takes longer than the run."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HEAVY = ("mujoco", "pandas", "scipy.interpolate", "scipy.linalg", "scipy.optimize", "scipy.sparse")
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
