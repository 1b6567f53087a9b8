"""The compiled loop with its one fixed signature: compiled once, for every mechanism."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, wraps
from sys import modules
from typing import Any

import numba
import numpy as np
from numba import types

from crossbody.reference import kernels
from crossbody.reference.cache import compiled, embedding
from crossbody.reference.core import advance as core
from crossbody.reference.core import friction_answers
from crossbody.reference.core._struct import TABLE
from crossbody.reference.core.layout import MODEL, STATE, WORK


def _state() -> Any:
    return numba.typeof(np.zeros(1, STATE))


def _signature() -> Any:
    functions = [kernels.function_type(name) for name in kernels.NAMES]
    return types.int64(*functions, _state(), TABLE, TABLE, TABLE, types.int64)


@cache
def program() -> Any:
    """The function `advance`, from the cache or compiled (once per installation)."""
    return compiled(core.advance, [_signature()])


_FRICTION = types.float64(types.int64, _state().dtype, MODEL, WORK, types.int64)


@cache
def _friction() -> Any:
    """What answers for contacts with friction, from the cache or compiled once a scene has some."""
    return compiled(friction_answers.answer, [_FRICTION])


def friction_code() -> int:
    """Where that stands, callable by the convention of compiled functions."""
    found = _friction().overloads[_FRICTION.args]
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_func_name))


class Address(types.WrapperAddressProtocol):  # type: ignore[misc]
    """A compiled function by its address.

    Named as such in other compiled code it is called, not compiled with it once more: that took seconds.
    """

    def __init__(self, function: Any, signature: Any) -> None:
        self._signature = signature
        self._compiled = function.overloads[signature.args]  # the code lives as long as its address is known

    def __wrapper_address__(self) -> int:
        """Where it stands, callable from C."""
        name = self._compiled.fndesc.llvm_cfunc_wrapper_name
        return int(self._compiled.library.get_pointer_to_function(name))

    def signature(self) -> Any:
        """What it takes and returns."""
        return self._signature


def addresses(names: Sequence[str], functions: Sequence[Any]) -> list[Address]:
    """Kernels by their names, to be named in other compiled code."""
    return [Address(function, kernels.REAL[name]) for name, function in zip(names, functions, strict=True)]


@cache
def address() -> Address:
    """The program, to be named in other compiled code."""
    return Address(program(), _signature())


KEPT = 16  # of what is built from one kernel: a few systems share it


def kept_with_kernels(build: Callable[[tuple[Any, ...]], Any]) -> Callable[[tuple[Any, ...]], Any]:
    """Keep what is built from a system's kernels as long as the kernels live, and no longer.

    It holds the kernels, so that no weak reference would let them go: it hangs on one of them instead, one that is not
    bound to a module for good, and goes with it.
    """

    @wraps(build)
    def kept(functions: tuple[Any, ...]) -> Any:
        owner = next((function for function in functions if not _permanent(function)), functions[0])
        found: dict[Any, Any] = vars(owner).setdefault("kept", {})
        key = (build.__module__, build.__name__, *map(id, functions))  # an id is a name as long as what has it lives
        if key not in found:
            built = build(functions)
            while len(found) >= KEPT:
                found.pop(next(iter(found)), None)
            found[key] = built
        return found[key]

    return kept


def _permanent(function: Any) -> bool:
    """Whether a module holds it under its own name."""
    home = modules.get(getattr(function, "__module__", None) or "")
    return getattr(home, getattr(function, "__name__", ""), None) is function


@kept_with_kernels
def entry(functions: tuple[Any, ...]) -> Callable[..., int]:
    """The program with one system's kernels built in.

    Handing ten functions over from Python costs more than a short run; an entry names their addresses as constants.
    """
    advance = address()
    dynamics, gaps, rows, energy, power, velocity, solve, control, watch, switch = addresses(kernels.NAMES, functions)

    def call(state, model, work, buffers, budget):  # type: ignore[no-untyped-def]
        return advance(
            dynamics, gaps, rows, energy, power, velocity, solve, control, watch, switch,
            state, model, work, buffers, budget,
        )  # fmt: skip

    found: Callable[..., int] = embedding(call, types.int64(_state(), TABLE, TABLE, TABLE, types.int64))
    return found
