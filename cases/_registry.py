"""The folder is the registry: a module without a leading underscore is a plug-in.

Names are read from the folder, modules are imported only when asked for.
"""

from __future__ import annotations

import ast
import importlib
import pkgutil
from collections.abc import Collection
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType

from crossbody.cases._errors import UnknownName


def plugin_names(package: str, path: list[str], hidden: Collection[str] = ()) -> tuple[str, ...]:
    """Names of the plug-ins in a package's folder, sorted; nothing is imported.

    Args:
        package: the package's dotted name (only for the doc of errors).
        path: the package's `__path__`.
        hidden: public modules of the folder that are not plug-ins.
    """
    found = (m.name for m in pkgutil.iter_modules(path))
    return tuple(sorted(n for n in found if not n.startswith("_") and n not in hidden))


def load_plugin(kind: str, package: str, path: list[str], name: str, hidden: Collection[str] = ()) -> ModuleType:
    """Import one plug-in.

    Raises:
        UnknownName: if the folder has no such plug-in.
    """
    known = plugin_names(package, path, hidden)
    if name not in known:
        raise UnknownName(kind, name, known)
    return importlib.import_module(f"{package}.{name}")


def summary(package: str, path: list[str], name: str) -> str:
    """First line of a plug-in's docstring, read without importing it."""
    spec = PathFinder.find_spec(f"{package}.{name}", path)
    if spec is None or spec.origin is None:
        return ""
    text = ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0]
