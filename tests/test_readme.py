"""The code in the README runs as it stands there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent
BLOCKS = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)


def test_there_are_examples() -> None:
    assert len(BLOCKS) == 2


def test_comparison_from_python(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco")
    exec(compile(BLOCKS[0], "README.md", "exec"), {})
    assert "position" in capsys.readouterr().out


def test_a_mechanism_of_ones_own(tmp_path: Path) -> None:
    # Compiled code is cached beside its source, so the example is run from a file.
    path = tmp_path / "example.py"
    path.write_text(BLOCKS[1], encoding="utf-8")
    scope: dict[str, Any] = {"__file__": str(path), "__name__": "example"}
    exec(compile(BLOCKS[1], str(path), "exec"), scope)
    run = scope["run"]
    assert run.outcome.ok
    assert sum(event.after.name == "CONTACT" for event in run.events) >= 3
    assert run.gap.min() > -5e-3
