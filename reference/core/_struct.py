"""Bundles of arrays that compiled functions hand on by one pointer.

A named tuple of arrays is handed on word by word: forty arrays are three hundred arguments and forty reference counts a
call. A structref is one pointer.
"""

from __future__ import annotations

from typing import Any

from numba.core import types
from numba.experimental import structref


def by_reference(cls: type) -> Any:
    """Turn a class of annotated fields into a structref of the same name; built by position in compiled code."""
    fields = list(cls.__annotations__)
    kind = structref.register(type(f"{cls.__name__}Type", (types.StructRef,), {"__module__": cls.__module__}))
    proxy = type(cls.__name__, (structref.StructRefProxy,), {"__module__": cls.__module__, "__doc__": cls.__doc__})
    structref.define_constructor(proxy, kind, fields)
    structref.define_attributes(kind)
    globals()[kind.__name__] = kind  # numba's cache looks the type up by module and name
    kind.__module__ = __name__
    kind.__qualname__ = kind.__name__
    return proxy
