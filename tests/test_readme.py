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


def test_a_scene_is_judged_in_three_engines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("pinocchio")
    (block,) = BLOCKS
    table = run(block, tmp_path)["table"]
    assert "within" in capsys.readouterr().out
    judged = table[table["limit"].notna() & table["engine"].isin(["reference", "mujoco", "pinocchio"])]
    assert set(judged["engine"]) == {"reference", "mujoco", "pinocchio"}
    assert not table["verdict"].isin(["outside", "crashed"]).any()
