"""What setuptools is told is what there is: a folder or a file that is missing there is missing in the wheel."""

from __future__ import annotations

import runpy
import tomllib
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest
import setuptools

ROOT = Path(__file__).parent.parent
FOLDERS = ("cases", "engines", "hw", "reference", "reports")
TOLD: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
FILES = [p for name in FOLDERS for p in (ROOT / name).rglob("*") if p.is_file() and p.parent.name != "__pycache__"]


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    found: dict[str, Any] = {}
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(setuptools, "setup", found.update)
    runpy.run_path("setup.py")
    return found


def test_every_folder_is_a_package(told: dict[str, Any]) -> None:
    there = {f"crossbody.{'.'.join(path.parent.relative_to(ROOT).parts)}" for path in FILES}
    assert there <= set(told["packages"])
    assert not [name for name in told["packages"] if "__pycache__" in name]


def test_every_package_is_mapped_to_its_folder(told: dict[str, Any]) -> None:
    assert told["package_dir"] == {f"crossbody.{folder}": folder for folder in FOLDERS}


def test_every_file_is_code_or_named_as_data() -> None:
    patterns = ("*.py", *TOLD["package-data"]["*"])
    assert not [str(path) for path in FILES if not any(fnmatch(path.name, pattern) for pattern in patterns)]
