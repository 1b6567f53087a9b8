"""Stress suites: which scenes are run, as data. Ours are a table; one of a user's own is a file.

Such a file has a docstring whose first line says what it stresses, and one public name, `SUITE`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from crossbody import cases
from crossbody.cases import InvalidValue, SceneError, UnknownName
from crossbody.cases.installed import from_file
from crossbody.cases.registry import Registry
from crossbody.reports.suites._own import SUITES
from crossbody.reports.suites.contract import Suite

if TYPE_CHECKING:
    from crossbody.cases import Value

OWN = tuple(SUITES)  # names that no plug-in can take
_REGISTRY = Registry("suite", __name__, hidden=("axis", "contract"))


def names() -> tuple[str, ...]:
    """Names of all suites."""
    return tuple(sorted({*SUITES, *_REGISTRY.names()}))


def summary(name: str) -> str:
    """What a suite stresses, in one line."""
    return SUITES[name].about if name in SUITES else _REGISTRY.summary(name)


def load(name: str, fixed: Mapping[str, Value] | None = None) -> Suite:
    """Return a suite by its name, the one in a file of one's own (ends in .py), or that of a case or robot file.

    Args:
        name: which.
        fixed: parameters of a case, the same in every run.
    """
    from crossbody.cases.files.reading import SUFFIXES

    own = name.endswith(".py")
    module = from_file("suite", Path(name), names()) if own else None
    if name.endswith(SUFFIXES) or (own and not hasattr(module, "SUITE") and hasattr(module, "build")):
        from crossbody.reports.suites._of_case import suite_of

        return suite_of(name, fixed or {})
    if name not in names() and name in cases.names():
        from crossbody.reports.suites._of_case import suite_of

        return suite_of(name, fixed or {})
    if fixed:
        raise InvalidValue(f"The suite {name!r} has fixed parameters: {', '.join(fixed)} cannot be given.")
    if name in SUITES:
        return SUITES[name]
    if module is None and name not in _REGISTRY.names():
        raise UnknownName("suite or case", name, {*names(), *cases.names()})
    module = module or _REGISTRY.load(name)
    found = getattr(module, "SUITE", None)
    if not isinstance(found, Suite):
        raise SceneError(f"Suite file {module.__file__} does not define SUITE, a crossbody.reports.suites Suite.")
    return found
