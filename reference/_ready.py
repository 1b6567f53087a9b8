"""Code that is the same for all mechanisms, read back without importing what it was compiled from.

To name it by its content (`_fingerprint`), some hundred functions have to be imported and declared, which takes longer
than a run. Where none of their modules was imported yet, nobody can have changed a function in this process: the bytes
of the sources then say the same, and beside the code is kept what they were compiled to.
"""

from __future__ import annotations

import os
import sys
from typing import Any

import numpy as np
from numba.core.compiler import CompileResult
from numba.core.registry import cpu_target

from crossbody.cases.sources import digest, readable
from crossbody.reference import code_store
from crossbody.reference.cache import debugging, machine, restored

_REFERENCE = os.path.dirname(__file__)
FOLDERS = (_REFERENCE, os.path.join(os.path.dirname(_REFERENCE), "cases"))
"""Whose functions and constants it is made of."""
CORE = "crossbody.reference.core"
TABLES = frozenset(f"{CORE}.{name}" for name in ("bundles", "dop853_table", "layout"))
"""Modules of the core by which runs are laid out, and that are imported with this one."""


def read(module: str, signature: Any) -> CompileResult | None:
    """Return what a module's code was compiled to from these sources; None if that is not kept, or not to be believed.

    Args:
        module: of the core.
        signature: of the function that it is compiled for.
    """
    known = any(name.startswith(f"{CORE}.") and name not in TABLES for name in sys.modules)
    store = None if known or not readable() else code_store.current()
    key = None if store is None else store.read(_name(module, signature))
    if store is None or key is None or not store.has(key.decode()):
        return None
    return restored(store, key.decode(), cpu_target.target_context)


def note(module: str, signature: Any, key: str) -> None:
    """Keep under which key these sources were compiled to."""
    store = code_store.current() if key and readable() else None
    if store is not None and not store.has(name := _name(module, signature)):
        store.write(name, key.encode())


def _name(module: str, signature: Any) -> str:
    """Return under which name it is kept: readable, then a digest of all that the code depends on."""
    depends = (module, str(signature), *map(digest, FOLDERS), np.__version__, str(debugging()), *machine())
    return code_store.named(f"sources_of_{module}", *depends)
