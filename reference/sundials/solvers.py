"""CVODE and IDA, imported without what they take of scipy for sparse matrices, which nothing here hands them."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any

FOR_SPARSE = ("scipy.sparse", "scipy.optimize._numdiff")
"""They and what they import take longer than a run: three hundred modules."""


class _Later(ModuleType):
    """A module that is imported once something of it is asked for."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *given, **named: getattr(import_module(self.__name__), name)(*given, **named)


@contextmanager
def _without(names: tuple[str, ...]) -> Iterator[None]:
    """Have modules that are not imported yet found as `_Later` for so long."""
    own = {name: _Later(name) for name in names if name not in sys.modules}
    sys.modules.update(own)
    try:
        yield
    finally:
        for name, module in own.items():
            if sys.modules.get(name) is module:
                del sys.modules[name]


with _without(FOR_SPARSE):
    import sksundae
    from sksundae.cvode import CVODE
    from sksundae.ida import IDA

__all__ = ["CVODE", "IDA", "VERSION"]
VERSION: str = sksundae.__version__
