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
from numba.extending import intrinsic

from crossbody.reference import kernels
from crossbody.reference.cache import compiled
from crossbody.reference.core import advance as core
from crossbody.reference.core.bundles import ADDRESSES, TABLE, function_at
from crossbody.reference.core.layout import BUFFERS, KERNELS, MODEL, STATE, WORK

_STATE = numba.from_dtype(STATE)[::1]
_ADVANCE = types.int64(ADDRESSES, _STATE, TABLE, TABLE, TABLE, types.int64)


@cache
def _declared() -> Any:
    return compiled(core.advance, lazy=[_ADVANCE])


@cache
def program() -> Any:
    """The function `advance`, from the cache or compiled (once per installation)."""
    found = _declared()
    found.compile(_ADVANCE)
    found.disable_compile()
    return found


def is_missing() -> bool:
    """Whether that would be compiled, and kept."""
    return bool(_declared().lacks(_ADVANCE))


_FRICTION = types.float64(types.int64, _STATE.dtype, MODEL, WORK, types.int64)
_INSTANT = types.int64(types.int64, KERNELS, _STATE.dtype, MODEL, WORK, BUFFERS)


def units() -> tuple[tuple[Callable[..., Any], Any], ...]:
    """Return what every run needs, with its signatures."""
    from crossbody.reference.core.instant_answers import answer

    return (core.advance, _ADVANCE), (answer, _INSTANT)


@cache
def _unit(module: str, signature: Any) -> Any:
    """What `answer` of a module of the core is compiled to on its own, from the cache or anew."""
    return compiled(import_module(f"crossbody.reference.core.{module}").answer, [signature])


def _code(module: str, signature: Any) -> int:
    """Where that stands, callable by the convention of compiled functions."""
    found = _unit(module, signature).overloads[signature.args]
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_func_name))


def friction_code() -> int:
    """Return where the code stands that answers for contacts with friction, which other scenes do not compile."""
    return _code("friction_answers", _FRICTION)


def instant_code() -> int:
    """Return where the code stands that settles modes."""
    return _code("instant_answers", _INSTANT)


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
    found = function.overloads[signature.args]
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
    return address(program(), _ADVANCE)


def entry(functions: Sequence[Any]) -> Callable[..., int]:
    """Return the program for one system's kernels: called with its tables and a number of steps."""
    return bound(program(), kernels.NAMES, functions)
