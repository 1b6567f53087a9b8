"""The compiled loop with its one fixed signature: compiled once, for every mechanism.

Compiled code takes the kernels of a mechanism by their addresses, in one array: ten functions handed over
from Python cost more than a short run, and to name them as constants is to compile anew in every process.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from importlib import import_module
from typing import Any

import numba
import numpy as np
from numba.core import types
from numba.core.compiler import CompileResult
from numba.extending import intrinsic

from crossbody.reference import _ready, kernels
from crossbody.reference.cache import compiled
from crossbody.reference.core.bundles import ADDRESSES, TABLE, function_at
from crossbody.reference.core.layout import BUFFERS, KERNELS, MODEL, STATE, WORK

_STATE = numba.from_dtype(STATE)[::1]
_ADVANCE = types.int64(ADDRESSES, _STATE, TABLE, TABLE, TABLE, types.int64)


_FRICTION = types.float64(types.int64, _STATE.dtype, MODEL, WORK, types.int64)
_INSTANT = types.int64(types.int64, KERNELS, _STATE.dtype, MODEL, WORK, BUFFERS)
_UNITS = {
    "advance": ("advance", _ADVANCE),
    "friction_answers": ("answer", _FRICTION),
    "instant_answers": ("answer", _INSTANT),
}
"""Module of the core -> the function in it that is compiled on its own, and its signature."""


@cache
def _declared(module: str) -> Any:
    name, signature = _UNITS[module]
    return compiled(getattr(import_module(f"{_ready.CORE}.{module}"), name), lazy=[signature])


@cache
def _unit(module: str) -> CompileResult:
    """Code of the core, from the cache or compiled (once per installation)."""
    _, signature = _UNITS[module]
    if (found := _ready.read(module, signature)) is not None:
        return found
    made = _declared(module)
    made.compile(signature)
    made.disable_compile()
    _ready.note(module, signature, made.kept_as)
    return made.overloads[signature.args]


def program() -> CompileResult:
    """Return the function `advance`."""
    return _unit("advance")


def is_missing() -> bool:
    """Whether that would be compiled, and kept."""
    return bool(_declared("advance").lacks(_ADVANCE))


def units() -> tuple[tuple[Callable[..., Any], Any], ...]:
    """Return what every run needs, with its signatures."""
    from crossbody.reference.core.advance import advance
    from crossbody.reference.core.instant_answers import answer

    return (advance, _ADVANCE), (answer, _INSTANT)


def _code(module: str) -> int:
    """Where that stands, callable by the convention of compiled functions."""
    found = _unit(module)
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_func_name))


def friction_code() -> int:
    """Return where the code stands that answers for contacts with friction, which other scenes do not compile."""
    return _code("friction_answers")


def instant_code() -> int:
    """Return where the code stands that settles modes."""
    return _code("instant_answers")


def at_address(signature: Any) -> Any:
    """Return what makes a function of an address, in compiled code: it is called as from C."""
    kind = types.FunctionType(signature)

    @intrinsic
    def function(typingctx: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
            return function_at(context, builder, kind, args[0])

        return kind(types.int64), generate

    return function


def address(function: Any, signature: Any) -> int:
    """Return where a compiled function stands, callable from C as long as it lives."""
    return _address(function.overloads[signature.args])


def _address(found: CompileResult) -> int:
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name))


def bound(call: Any, names: Sequence[str], functions: Sequence[Any], *programs: int) -> Callable[..., Any]:
    """Return compiled code with its first argument: the addresses of kernels, and behind them of what they are for."""
    found = [address(function, kernels.REAL[name]) for name, function in zip(names, functions, strict=True)]
    made = partial(call, np.array([*found, *programs]))
    made.functions = tuple(functions)  # type: ignore[attr-defined]  # whose code stands there
    return made


advance = at_address(_ADVANCE)


def advance_address() -> int:
    """Return where the program stands, for other compiled code."""
    return _address(program())


def entry(functions: Sequence[Any]) -> Callable[..., int]:
    """Return the program for one system's kernels: called with its tables and a number of steps."""
    return bound(program().entry_point, kernels.NAMES, functions)
