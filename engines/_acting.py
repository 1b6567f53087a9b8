"""What acts on a scene in a run: compiled forces, recorded inputs, a controller of the user's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np
from numba import types

from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.case import Force
from crossbody.cases.control import Controller
from crossbody.reference.cache import compiled

_V = types.float64[::1]
_SIGNATURE = types.void(types.float64, _V, _V, _V, _V)
Act = Callable[[float, Floats, Floats, Floats], None]  # (t, q, v, out): writes generalised forces


def acting(force: Force) -> Act:
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


@dataclass(slots=True)
class Acting:
    """The inputs of one case, run by run.

    Attributes:
        case: a scene.
        times (m,), values (m, nu): recorded.
        instants: when any input changes or a force is not smooth, s, increasing.
        controller: of the present run; None where there is none.
    """

    case: Case
    times: Floats = field(init=False)
    values: Floats = field(init=False)
    instants: list[float] = field(init=False)
    controller: Controller | None = field(init=False, default=None)
    ticks: frozenset[float] = field(init=False, default=frozenset())

    def __post_init__(self) -> None:
        """Lay out the instants."""
        given, control, scene = self.case.inputs, self.case.control, self.case.scene
        count = len(scene.inputs) if scene is not None else 0
        self.times = np.zeros(0) if given is None else given.times
        self.values = np.zeros((0, count)) if given is None else given.values
        self.instants = self.times.tolist()
        if control is not None:
            ticks = control.instants(self.case.t_end)
            self.ticks = frozenset(ticks.tolist())
            self.instants = distinct(self.times, ticks).tolist()
        if self.case.force is not None and self.case.force.breaks:
            self.instants = distinct(self.instants, self.case.force.breaks).tolist()

    def reset(self) -> None:
        """Begin a run, with a controller of its own."""
        if self.case.control is not None:
            self.controller = self.case.control.begin(self.values.shape[1])

    def at(self, t: float, q: Floats, v: Floats) -> Floats:
        """Return the inputs (nu,) from the instant t, s, on; q and v are those of the case there."""
        total = np.zeros(self.values.shape[1]) if self.case.inputs is None else self.case.inputs.at(t)
        if self.controller is not None:
            total += self.controller(t, q, v) if t in self.ticks else self.controller.u
        return total

    def told(self, run: Trajectory) -> Trajectory:
        """Return the run with what its controller gave and how long it took."""
        if self.controller is None:
            return run
        more: dict[str, Any] = {"inputs": self.controller.given(self.times, self.values)}
        return replace(run, control_s=self.controller.seconds, **more)
