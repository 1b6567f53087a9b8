"""The folder is the registry: a module without a leading underscore is a plug-in.

Names are read from the folder, modules are imported only when asked for. Other distributions add theirs by entry
points (`crossbody.cases._installed`); of two of one name ours is taken.
"""

from __future__ import annotations

import ast
import importlib
import pkgutil
from collections.abc import Collection
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType

from crossbody.cases import _installed
from crossbody.cases._errors import UnknownName


def own_names(path: list[str], hidden: Collection[str] = ()) -> tuple[str, ...]:
    """Names of the plug-ins in a folder (a package's `__path__`), sorted; nothing is imported."""
    found = (m.name for m in pkgutil.iter_modules(path))
    return tuple(sorted(n for n in found if not n.startswith("_") and n not in hidden))


def plugin_names(package: str, path: list[str], hidden: Collection[str] = ()) -> tuple[str, ...]:
    """Names of the plug-ins of a package, of its folder and of other distributions, sorted; nothing is imported.

    Args:
        package: the package's dotted name, which is the group of its entry points.
        path: the package's `__path__`.
        hidden: public modules of the folder that are not plug-ins.
    """
    return tuple(sorted({*own_names(path, hidden), *_installed.modules(package)}))


def load_plugin(kind: str, package: str, path: list[str], name: str, hidden: Collection[str] = ()) -> ModuleType:
    """Import one plug-in.

    Raises:
        UnknownName: if there is no such plug-in.
    """
    if not isinstance(name, str):
        raise UnknownName(kind, name, plugin_names(package, path, hidden))
    if name in own_names(path, hidden):
        return importlib.import_module(f"{package}.{name}")
    module = _installed.modules(package).get(name)
    if module is None:
        raise UnknownName(kind, name, plugin_names(package, path, hidden))
    return importlib.import_module(module)


def summary(package: str, path: list[str], name: str) -> str:
    """First line of a plug-in's docstring, read without importing it; of an installed one where it comes from."""
    spec = PathFinder.find_spec(f"{package}.{name}", path)
    if spec is None or spec.origin is None:
        module = _installed.modules(package).get(name)
        return f"from {module}" if module else ""
    text = ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0]
