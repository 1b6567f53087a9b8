"""What setuptools is told is what there is: a folder or a file that is missing there is missing in the wheel."""

from __future__ import annotations

import os
import runpy
import shutil
import subprocess
import sys
import tomllib
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest
import setuptools
from places import FOLDERS, ROOT

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
    parts = {f"crossbody.{folder}": folder for folder in FOLDERS}
    assert told["package_dir"] == {"crossbody": "reports/package"} | parts


def test_every_file_is_code_or_named_as_data() -> None:
    patterns = ("*.py", *TOLD["package-data"]["*"])
    assert not [str(path) for path in FILES if not any(fnmatch(path.name, pattern) for pattern in patterns)]


BESIDE = "from crossbody import cases, reports; print(cases.__file__); print(reports.__file__)"


def test_a_checkout_beside_a_script_does_not_come_before_what_is_installed(tmp_path: Path) -> None:
    """What `setup.py build` makes is what a wheel holds; the folder of a checkout has no `__init__.py`."""
    source = tmp_path / "source"
    source.mkdir()
    for name in ("pyproject.toml", "setup.py", "README.md"):
        shutil.copy2(ROOT / name, source)
    for folder in FOLDERS:
        shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns("__pycache__"))
    build = [sys.executable, "setup.py", "-q", "build", "--build-lib", str(tmp_path / "site")]
    subprocess.run(build, cwd=source, check=True, capture_output=True)
    (tmp_path / "work").mkdir()
    source.rename(tmp_path / "work" / "crossbody")
    (tmp_path / "work" / "script.py").write_text(BESIDE)
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "site")}
    run = [sys.executable, "work/script.py"]
    done = subprocess.run(run, cwd=tmp_path, env=environment, check=True, capture_output=True, text=True)
    assert all(line.startswith(str(tmp_path / "site")) for line in done.stdout.splitlines()), done.stdout
    assert done.stderr == ""
    module = [sys.executable, "-m", "crossbody", "list", "bouncing_ball"]
    done = subprocess.run(module, cwd=tmp_path, env=environment, check=True, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == (shell("list", "bouncing_ball").stdout, "")


def shell(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Return what the command says."""
    command = [str(Path(sys.executable).with_name("crossbody")), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "arguments", [("--version",), ("run", "bouncing_ball:listing", "--dry-run"), ("list", "nothing"), ("run", "--jbs")]
)
def test_the_module_does_what_the_command_does(arguments: tuple[str, ...], tmp_path: Path) -> None:
    module = [sys.executable, "-m", "crossbody", *arguments]
    done = subprocess.run(module, cwd=tmp_path, capture_output=True, text=True, check=False)
    told = shell(*arguments)
    assert (done.returncode, done.stdout, done.stderr) == (told.returncode, told.stdout, told.stderr)


def test_another_checkout_than_the_editable_installation_is_told(tmp_path: Path) -> None:
    (tmp_path / "crossbody").mkdir()
    for folder in FOLDERS:
        (tmp_path / "crossbody" / folder).symlink_to(ROOT / folder)
    (tmp_path / "script.py").write_text(BESIDE)
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, check=True, capture_output=True, text=True)
    assert str(tmp_path / "crossbody") in done.stdout
    assert "rename the folder, or install it" in done.stderr
    (tmp_path / "crossbody").rename(tmp_path / "other")
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, check=True, capture_output=True, text=True)
    assert done.stderr == ""
