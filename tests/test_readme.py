"""The code in the README runs as it stands there, each block for itself."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent
BLOCKS = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)


def run(block: str, tmp_path: Path) -> dict[str, Any]:
    # Compiled code is cached beside its source, so the example is run from a file.
    path = tmp_path / "example.py"
    path.write_text(block, encoding="utf-8")
    scope: dict[str, Any] = {"__file__": str(path), "__name__": "example"}
    exec(compile(block, str(path), "exec"), scope)
    return scope


def the_one_with(words: str) -> str:
    (found,) = (block for block in BLOCKS if words in block)
    return str(found)


def test_comparison_from_python(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco")
    run(the_one_with("reports.compare"), tmp_path)
    assert "position" in capsys.readouterr().out


def test_a_mechanism_of_ones_own(tmp_path: Path) -> None:
    motion = run(the_one_with("@kernels.dynamics"), tmp_path)["run"]
    assert motion.outcome.ok
    assert sum(event.after.name == "CONTACT" for event in motion.events) >= 3
    assert motion.gap.min() > -5e-3


@pytest.mark.parametrize("block", [b for b in BLOCKS if "reports.compare" not in b and "@kernels" not in b])
def test_every_other_block(block: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(block, tmp_path)
    assert capsys.readouterr().out.strip()
