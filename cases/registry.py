"""The folder is the registry: a module without a leading underscore is a plug-in.

Names are read from the folder, modules are imported only when asked for. Other distributions add theirs
by entry points, and users by files (`crossbody.cases.installed`); of two of one name ours is taken.
"""

from __future__ import annotations

import ast
import importlib
import os
import pkgutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType

from crossbody.cases import installed
from crossbody.cases.errors import UnknownName
from crossbody.cases.public_names import check


@dataclass(frozen=True, slots=True)
class Registry:
    """The plug-ins of one folder, and those that other distributions add to it.

    Attributes:
        kind: what a plug-in is called in messages.
        package: dotted name of the folder.
        hidden: public modules of the folder that are no plug-ins.
        group: of the entry points; empty where it is the folder's name.
    """

    kind: str
    package: str
    hidden: tuple[str, ...] = ()
    group: str = ""

    def own(self) -> tuple[str, ...]:
        """Return the names of the plug-ins in the folder, sorted; nothing is imported."""
        found = {name for folder in self._path() for name in _listed(folder, _changed(folder))}
        return tuple(sorted(name for name in found if not name.startswith("_") and name not in self.hidden))

    def names(self) -> tuple[str, ...]:
        """Return the names of all plug-ins, those of other distributions too, sorted; nothing is imported."""
        return tuple(sorted({*self.own(), *self._installed()}))

    def load(self, name: str) -> ModuleType:
        """Import one plug-in."""
        if isinstance(name, str) and name in self.own():
            return importlib.import_module(f"{self.package}.{name}")
        module = self._installed().get(name) if isinstance(name, str) else None
        if module is None:
            raise UnknownName(self.kind, name, self.names())
        found = importlib.import_module(module)
        check(found, self.group or self.package)
        return found

    def summary(self, name: str) -> str:
        """Return a plug-in's first line without importing it; of an installed one its origin."""
        spec = PathFinder.find_spec(f"{self.package}.{name}", self._path())
        if spec is None or spec.origin is None:
            module = self._installed().get(name, "")
            told = getattr(sys.modules.get(module), "__doc__", None)
            return told.partition("\n")[0] if told else f"from {module}" if module else ""
        text = ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))) or ""
        return text.partition("\n")[0]

    def _path(self) -> list[str]:
        return list(importlib.import_module(self.package).__path__)

    def _installed(self) -> Mapping[str, str]:
        return installed.modules(self.group or self.package)


@cache
def _listed(folder: str, _changed: int) -> tuple[str, ...]:
    """Return the modules in a folder; it is read anew when it has changed."""
    return tuple(module.name for module in pkgutil.iter_modules([folder]))


def _changed(folder: str) -> int:
    """Return when a folder changed last, ns."""
    try:
        return os.stat(folder).st_mtime_ns
    except OSError:  # inside an archive
        return 0
