"""What spares numba work while it compiles: a quarter of the time that the integrator takes."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import types
from numba.core.types.functions import BaseFunction

_NUMBERS = (types.Integer, types.Float, types.Boolean)
_resolve = BaseFunction.get_call_type


@contextmanager
def hastened() -> Iterator[None]:
    """Compile without collecting garbage, and resolve what is called with numbers once; within another, do nothing.

    A compiler makes objects by the million that all live as long as it works. For a sum of two
    numbers numba tries forty signatures, thousands of times.
    """
    if BaseFunction.get_call_type is not _resolve:
        yield
        return
    collects, BaseFunction.get_call_type = gc.isenabled(), _remembering()
    gc.disable()
    try:
        yield
    finally:
        BaseFunction.get_call_type = _resolve
        if collects:
            gc.enable()


def _remembering() -> Any:
    """Return numba's choice of a signature, which is made once for numbers of the same types."""
    known: dict[tuple[Any, ...], tuple[Any, Any]] = {}

    def get_call_type(function: BaseFunction, context: Any, args: Any, kws: Any) -> Any:
        if kws or not all(isinstance(arg, _NUMBERS) for arg in args):
            return _resolve(function, context, args, kws)
        asked = (function.typing_key, *args)
        if asked not in known:
            found = _resolve(function, context, args, kws)
            if found is None:
                return None
            known[asked] = found, function._impl_keys[found.args]
        signature, function._impl_keys[signature.args] = known[asked]
        return signature

    return get_call_type
