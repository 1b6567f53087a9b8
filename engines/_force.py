"""Functions of cases, compiled: engines ask for forces, and for rows, in every stage of a step."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

from numba import types

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Force
from crossbody.reference.cache import compiled

_V = types.float64[::1]
_SIGNATURE = types.void(types.float64, _V, _V, _V, _V)
Acting = Callable[[float, Floats, Floats, Floats], None]  # (t, q, v, out): writes generalised forces


def acting(force: Force) -> Acting:
    """Return a force as a function of time and state alone."""
    function, numbers = kernel(force.function, _SIGNATURE), force.numbers

    def act(t: float, q: Floats, v: Floats, out: Floats) -> None:
        function(t, q, v, numbers, out)

    return act


@cache
def kernel(function: Any, signature: Any) -> Any:
    """Return a function of a case, and all that it calls, compiled."""
    return compiled(_over_compiled(function), [signature])


def _over_compiled(function: FunctionType) -> FunctionType:
    """Return a function that calls compiled ones where it called functions of its module in Python."""
    named = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    helpers = {name: _helper(one) for name, one in named.items() if isinstance(one, FunctionType)}
    within = {**function.__globals__, **helpers}
    made = FunctionType(function.__code__, within, function.__name__, function.__defaults__, function.__closure__)
    made.__module__, made.__qualname__ = function.__module__, function.__qualname__
    return made


@cache
def _helper(function: FunctionType) -> Any:
    return compiled(_over_compiled(function))
