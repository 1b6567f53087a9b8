"""The compiled loop with its one fixed signature: compiled once, for every mechanism."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np
from numba import types

from crossbody.reference import kernels
from crossbody.reference._cache import compiled
from crossbody.reference.core import advance as core
from crossbody.reference.core._struct import TABLE
from crossbody.reference.core.layout import STATE


def _state() -> Any:
    return numba.typeof(np.zeros(1, STATE))


@cache
def program() -> Any:
    """The function `advance`, from the cache or compiled (once per installation)."""
    functions = [kernels.function_type(name) for name in kernels.NAMES]
    return compiled(core.advance, [types.int64(*functions, _state(), TABLE, TABLE, TABLE, types.int64)])


@cache
def entry(functions: tuple[Any, ...]) -> Callable[..., int]:
    """The program with one system's kernels built in.

    Handing nine functions over from Python costs more than a short run; an entry names them as constants. It is worth
    its compilation for runs that are repeated.
    """
    advance = program()
    dynamics, gaps, rows, energy, power, solve, control, watch, switch = functions

    def call(state, model, work, buffers, budget):  # type: ignore[no-untyped-def]
        return advance(
            dynamics, gaps, rows, energy, power, solve, control, watch, switch, state, model, work, buffers, budget
        )

    return numba.njit([types.int64(_state(), TABLE, TABLE, TABLE, types.int64)])(call)  # type: ignore[no-any-return]
