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
from crossbody.reference.core.layout import STATE

_F, _F2 = types.float64[::1], types.float64[:, ::1]
_B, _B2 = types.int8[::1], types.int8[:, ::1]
_I, _I2 = types.int64[::1], types.int64[:, ::1]
# What `advance` takes after the kernels and the state.
_DATA = (_F, _F2, _F2, _B, _I, _F, _F2, _F, _F, _I, _B, _B2, _F2, _B2, _F, _I2, types.int64)


def _state() -> Any:
    return numba.typeof(np.zeros(1, STATE))


@cache
def program() -> Any:
    """The function `advance`, from the cache or compiled (once per installation)."""
    functions = [kernels.function_type(name) for name in kernels.NAMES]
    return compiled(core.advance, [types.int64(*functions, _state(), *_DATA)])


@cache
def entry(functions: tuple[Any, ...]) -> Callable[..., int]:
    """The program with one system's kernels built in.

    Handing seven functions over from Python costs more than a short run; an entry names them as constants. It is worth
    its compilation for runs that are repeated.
    """
    advance = program()
    dynamics, gaps, rows, energy, power, solve, control = functions

    def call(
        state, p, alpha, beta, unilateral, follows, inputs_t, inputs_u, samples, W, I,  # noqa: E741
        mode, history, out, modes, events_t, events, budget,
    ):  # type: ignore[no-untyped-def]  # fmt: skip
        return advance(
            dynamics, gaps, rows, energy, power, solve, control,
            state, p, alpha, beta, unilateral, follows, inputs_t, inputs_u, samples, W, I,
            mode, history, out, modes, events_t, events, budget,
        )  # fmt: skip

    return numba.njit([types.int64(_state(), *_DATA)])(call)  # type: ignore[no-any-return]
