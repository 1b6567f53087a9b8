"""The compiled loop with its one fixed signature: compiled once, for every mechanism.

Compiled code takes the kernels of a mechanism by their addresses, in one array: ten functions handed over from Python
cost more than a short run, and to name them as constants is to compile anew in every process.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from importlib import import_module
from typing import Any

import numba
import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic

from crossbody.reference import kernels
from crossbody.reference.cache import compiled
from crossbody.reference.core import advance as core
from crossbody.reference.core.bundles import TABLE
from crossbody.reference.core.layout import BUFFERS, MODEL, STATE, WORK


def _state() -> Any:
    return numba.typeof(np.zeros(1, STATE))


def _signature() -> Any:
    functions = [kernels.function_type(name) for name in kernels.NAMES]
    return types.int64(*functions, _state(), TABLE, TABLE, TABLE, types.int64)


@cache
def program() -> Any:
    """The function `advance`, from the cache or compiled (once per installation)."""
    from crossbody.reference.ahead import begin

    return compiled(core.advance, [_signature()], beside=begin)


_FRICTION = types.float64(types.int64, _state().dtype, MODEL, WORK, types.int64)
_KERNELS = types.NamedTuple([kernels.function_type(name) for name in kernels.NAMES], core.Kernels)
_INSTANT = types.int64(types.int64, _KERNELS, _state().dtype, MODEL, WORK, BUFFERS)


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


ADDRESSES = types.int64[::1]


def at_address(signature: Any) -> Any:
    """Return what makes a function of an address, in compiled code: it is called as from C."""
    kind = types.FunctionType(signature)

    @intrinsic
    def function(typingctx: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
            made = cgutils.create_struct_proxy(kind)(context, builder)
            made.c_addr = builder.inttoptr(args[0], cgutils.voidptr_t)
            return made._getvalue()

        return kind(types.int64), generate

    return function


def address(function: Any, signature: Any) -> int:
    """Return where a compiled function stands, callable from C as long as it lives."""
    found = function.overloads[signature.args]
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name))


def bound(call: Any, names: Sequence[str], functions: Sequence[Any], program: int) -> Callable[..., Any]:
    """Return compiled code with its first argument: the addresses of kernels, and behind them of what they are for."""
    found = [address(function, kernels.REAL[name]) for name, function in zip(names, functions, strict=True)]
    made = partial(call, np.array([*found, program]))
    made.functions = tuple(functions)  # type: ignore[attr-defined]  # whose code stands there
    return made


dynamics, gaps, rows, energy, power, velocity, solve, control, watch, switch = map(at_address, kernels.REAL.values())
advance = at_address(_signature())


def _go(at, state, model, work, buffers, budget):  # type: ignore[no-untyped-def]
    call = advance(at[10])
    return call(
        dynamics(at[0]), gaps(at[1]), rows(at[2]), energy(at[3]), power(at[4]), velocity(at[5]), solve(at[6]),
        control(at[7]), watch(at[8]), switch(at[9]), state, model, work, buffers, budget,
    )  # fmt: skip


@cache
def _going() -> Any:
    """That program as it is called from Python."""
    return compiled(_go, [types.int64(ADDRESSES, _state(), TABLE, TABLE, TABLE, types.int64)])


def compile_loop() -> None:
    """Have the loop ready, from the cache or compiled."""
    program(), _going()


def advance_address() -> int:
    """Return where the program stands, for other compiled code."""
    return address(program(), _signature())


def entry(functions: Sequence[Any]) -> Callable[..., int]:
    """Return the program for one system's kernels: called with its tables and a number of steps."""
    return bound(_going(), kernels.NAMES, functions, advance_address())
