"""Code that is read back by the sources that it was compiled from."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from numba.core import types

from crossbody.reference import _program, _ready, cache, code_store

RUN = """
import sys
from crossbody import cases, engines
from crossbody.reference import _ready
{before}
run = engines.load("reference").prepare(cases.load("bouncing_ball", "resting"), "compiled").run()
print("crossbody.reference.core.advance" in sys.modules, run.steps, repr(float(run.q[-1, 0])), repr(float(run.t[-1])))
"""


def run(before: str = "") -> list[str]:
    """Whether a process imported the core for a run, and what came out of it."""
    ask = [sys.executable, "-c", RUN.format(before=before)]
    return subprocess.run(ask, capture_output=True, text=True, check=True).stdout.split()


def test_a_second_process_runs_the_same_code_without_importing_it() -> None:
    run()
    ready, declared = run(), run("import crossbody.reference.core.advance")
    assert ready[0] == "False"
    assert declared[0] == "True"
    assert ready[1:] == declared[1:]


def test_a_process_that_may_have_changed_the_core_names_code_by_its_content(monkeypatch: pytest.MonkeyPatch) -> None:
    run()
    for name in [name for name in sys.modules if name.startswith(f"{_ready.CORE}.") and name not in _ready.TABLES]:
        monkeypatch.delitem(sys.modules, name)
    signature = _program._UNITS["advance"][1]
    assert _ready.read("advance", signature) is not None
    monkeypatch.setitem(sys.modules, f"{_ready.CORE}.settle", np)
    assert _ready.read("advance", signature) is None


def test_other_sources_libraries_or_settings_have_other_names(monkeypatch: pytest.MonkeyPatch) -> None:
    signature = _program._UNITS["advance"][1]
    names = {
        _ready._name("advance", signature),
        _ready._name("machine", signature),
        _ready._name("advance", types.void()),
    }
    for module, name, other in (
        (_ready, "digest", lambda _folder: "another"),
        (_ready, "machine", lambda: ("another",)),
        (_ready, "debugging", lambda: not cache.debugging()),
        (np, "__version__", "0"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(module, name, other)
            names.add(_ready._name("advance", signature))
    assert len(names) == 7


def test_a_name_whose_code_is_gone_is_not_believed(monkeypatch: pytest.MonkeyPatch, tmp_path: object) -> None:
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path))
    for name in [name for name in sys.modules if name.startswith(f"{_ready.CORE}.") and name not in _ready.TABLES]:
        monkeypatch.delitem(sys.modules, name)
    signature = _program._UNITS["advance"][1]
    _ready.note("advance", signature, "advance-" + 32 * "0")
    store = code_store.current()
    assert store is not None
    assert store.has(_ready._name("advance", signature))
    assert _ready.read("advance", signature) is None
