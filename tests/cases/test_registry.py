"""The folder is the registry: what is put there is found, also after the folder was listed."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from crossbody.cases import UnknownName
from crossbody.cases.registry import Registry


def test_a_plug_in_is_found_as_soon_as_its_file_is_there_and_no_longer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "of_plug_ins"
    package.mkdir()
    (package / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    registry = Registry("plug-in", package.name, hidden=("shared",))
    for k, names in enumerate([(), ("one",), ("one", "two"), ("two",)]):
        for path in package.glob("*.py"):
            path.unlink()
        for name in ("__init__", "_inner", "shared", *names):
            (package / f"{name}.py").write_text(f"NAME = {name!r}")
        os.utime(package, ns=(k, k))  # a clock of the system's own may stand still between two of these
        assert registry.own() == names
        with pytest.raises(UnknownName):
            registry.load("shared")
    assert registry.load("two").NAME == "two"
    del sys.modules[package.name], sys.modules[f"{package.name}.two"]
