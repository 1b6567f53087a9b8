"""The package crossbody itself, of which the five folders are the parts."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

PARTS = ("cases", "engines", "hw", "reference", "reports")


def __getattr__(name: str) -> ModuleType:
    """Import a part when it is first asked for, as in `import crossbody; crossbody.cases.load(...)`."""
    if name in PARTS:
        return import_module(f"crossbody.{name}")
    raise AttributeError(f"module 'crossbody' has no attribute {name!r}")
