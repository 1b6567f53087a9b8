"""Stress suites: which scenes are run, as data; a module here is a suite, found by its name.

A suite is a module with a docstring whose first line says what it stresses, and one public name, `SUITE`.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from crossbody.cases import SceneError, UnknownName, _registry

if TYPE_CHECKING:
    from crossbody.reports.suites._contract import Suite


def names() -> tuple[str, ...]:
    """Names of all suites; imports none of them."""
    return _registry.plugin_names(__name__, list(__path__))


def summary(name: str) -> str:
    """What a suite stresses, in one line; imports nothing."""
    return _registry.summary(__name__, list(__path__), name)


def load(name: str) -> Suite:
    """A suite by its name, or the one in a file of one's own (ends in .py).

    Raises:
        UnknownName: if there is none; the message lists the names.
        InvalidValue: if its axes contradict each other.
        SceneError: if a file defines no SUITE.
    """
    from crossbody.reports.suites._contract import Suite

    own = name.endswith(".py")
    module = _file(Path(name)) if own else _registry.load_plugin("suite", __name__, list(__path__), name)
    found = getattr(module, "SUITE", None)
    if not isinstance(found, Suite):
        raise SceneError(f"Suite file {module.__file__} does not define SUITE, a crossbody.reports.suites Suite.")
    return found


def _file(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"crossbody_suite_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise UnknownName("suite file", str(path), names())
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
