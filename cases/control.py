"""A controller of the user's own: a Python callable, asked at its ticks, the same one in every engine.

    u = control(t, q, v)         at t = 0, tick, 2 tick, ..., and held in between

A run has a copy of its own (`Controller`), so that none begins with what another has left. What the
callable raises, or gives in another form than it should, is wrong use and ends as a `ControlError`;
numbers that are not finite end the run as any other numerical failure does, by its outcome.
"""

from __future__ import annotations

import copy
import dataclasses
import math
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from types import MethodType
from typing import Any

import numpy as np

from crossbody.cases.arguments import flag, real, shown
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.case import Inputs
from crossbody.cases.errors import ControlError, InvalidValue

MOST = 100_000_000
"""Of ticks in a run: what the controller gives is kept."""
NEAR = 16.0 * float(np.finfo(np.float64).eps)
"""Part of a time by which two instants differ that are meant to be one: .3 and 3 times .1 do."""


class NotFinite(Exception):  # noqa: N818 - an end, not an error: it is caught where the run is driven
    """A controller gave what is not finite; the message says which, and when."""


@dataclass(frozen=True, slots=True, eq=False)
class Control:
    """A controller u = function(t, q, v) with its tick.

    The callable gets copies of q (nq,) and v (nv,), in the scene's own convention in every engine, and
    returns the controls (nu,) in the order of the scene's actuators; one number will do for one of them.

    Each run has its own: a class is called for a new instance, an object (or the object of a
    bound method) is copied deeply as it was handed over, and its `reset()` is called where it has
    one. A plain function is called as it is: what it keeps outside itself is the user's.

    Attributes:
        function: the callable, or a class of such.
        tick: s, between two calls.
        factory: whether `function()` makes the callable of a run, as a class does.
        names: of the inputs of the system, the controls first; only told.
        width: number of inputs that it sets, the first ones; 0 for all.

    Raises:
        InvalidValue: for what cannot be called, or a tick that is not above 0.
    """

    function: Callable[..., Any]
    tick: float
    factory: bool = False
    names: tuple[str, ...] = ()
    width: int = 0

    def __post_init__(self) -> None:
        """Check what can be checked without a call."""
        if not callable(self.function):
            raise InvalidValue(f"Control.function is {shown(self.function)}; it must be a callable of (t, q, v).")
        tick = real("Control.tick", self.tick)
        if not (math.isfinite(tick) and tick > 0.0):
            raise InvalidValue(f"Control.tick is {shown(self.tick)}; it must be finite and above 0 s.")
        object.__setattr__(self, "tick", tick)
        object.__setattr__(self, "factory", flag("Control.factory", self.factory) or isinstance(self.function, type))

    @property
    def label(self) -> str:
        """Its name in messages."""
        named = self.function if hasattr(self.function, "__qualname__") else type(self.function)
        return str(getattr(named, "__qualname__", named))

    def fitted(self, t_end: float) -> Control:
        """Return it with a tick that divides the horizon exactly, if it does so up to rounding.

        49 times 1/49 is less than 1: the controller would be asked once more, one rounding before the end.
        """
        count = round(t_end / self.tick)
        if count > MOST:
            raise InvalidValue(f"Control.tick is {self.tick:g} s, {count:.1e} of them in a run; at most {MOST:.0e}.")
        tick = self.tick
        if count and abs(count * tick - t_end) <= NEAR * t_end:
            while count * tick < t_end:
                tick = math.nextafter(tick, math.inf)
        return dataclasses.replace(self, tick=tick)

    def instants(self, t_end: float) -> Floats:
        """When it is asked before t_end, s."""
        times = np.arange(math.ceil(t_end / self.tick) + 1, dtype=np.float64) * self.tick
        return np.asarray(times[times < t_end])

    def on_ticks(self, times: Floats) -> Floats:
        """Return instants, s, those that are ticks up to rounding exactly on them."""
        ticks = np.round(times / self.tick) * self.tick
        found: Floats = np.where(np.abs(ticks - times) <= NEAR * times, ticks, times)
        return found if np.all(np.diff(found) > 0.0) else times

    def begin(self, inputs: int) -> Controller:
        """Return what controls one run of a system with so many inputs.

        Raises:
            ControlError: if it cannot be made or copied.
        """
        try:
            step = self.function() if self.factory else copy.deepcopy(self.function)
            reset = getattr(step.__self__ if isinstance(step, MethodType) else step, "reset", None)
            if callable(reset):
                reset()
        except (Exception, SystemExit) as error:
            done = "made" if self.factory else "copied and reset"
            raise ControlError(
                f"The controller {self.label} cannot be {done} for a run: {_said(error)}. "
                "Every run has its own; valid: a class, an object that can be copied deeply, "
                "or with factory=True what makes one."
            ) from error
        if not callable(step):
            raise ControlError(f"The controller {self.label} makes {shown(step)}, which cannot be called.")
        return Controller(self, step, inputs)


class Controller:
    """The controller of one run.

    Attributes:
        u (nu,): the inputs that it gave last, 0 where it sets none.
        seconds: time spent in it, with the copies and checks of what goes in and out.
        times, values: when it was asked, and what it gave.
    """

    def __init__(self, control: Control, step: Callable[..., Any], inputs: int) -> None:
        self.control, self.step = control, step
        self.width = control.width or inputs
        self.u: Floats = np.zeros(inputs)
        self.seconds = 0.0
        self.times: list[float] = []
        self.values: list[Floats] = []

    def __call__(self, t: float, q: Floats, v: Floats) -> Floats:
        """Ask for the inputs (nu,) from t on; a copy."""
        began = perf_counter()
        try:
            try:
                found = self.step(t, q.copy(), v.copy())
            except (Exception, SystemExit) as error:
                raise ControlError(f"{self._where(t)} {_said(error)}.") from error
            self.u[: self.width] = self._checked(t, found)
        finally:
            self.seconds += perf_counter() - began
        self.times.append(t)
        self.values.append(self.u.copy())
        return self.u.copy()

    def given(self, times: Floats, values: Floats) -> Inputs:
        """Return what acted on the run: these inputs (m,), (m, nu), and on top of them the controller's."""
        names = self.control.names or tuple(f"u[{i}]" for i in range(len(self.u)))
        own = np.array(self.values).reshape(-1, len(self.u))  # behind those with a name stand activations
        parts = [
            Inputs(names=names, times=times, values=values[:, : len(names)]),
            Inputs(names=names, times=np.array(self.times), values=own[:, : len(names)]),
        ]
        every = distinct(parts[0].times, parts[1].times)
        return Inputs(names=names, times=every, values=parts[0].at(every) + parts[1].at(every))

    def _checked(self, t: float, found: Any) -> Floats:
        try:
            u = np.asarray(found)
        except Exception as error:  # what is no array may raise anything on the way to one
            raise ControlError(f"{self._where(t)} gives {shown(found)}: {_said(error)}; {self._valid()}") from error
        u = u.reshape(1) if u.shape == () and self.width == 1 else u
        if u.shape != (self.width,) or u.dtype.kind not in "fiu":
            what = f"an array of shape {u.shape}" if u.shape != (self.width,) and u.shape else f"{shown(found)}"
            raise ControlError(f"{self._where(t)} gives {what}; {self._valid()}")
        if not np.all(np.isfinite(u)):
            raise NotFinite(f"{self._where(t)} gives u = {u.tolist()}.")
        return u

    def _where(self, t: float) -> str:
        return f"The controller {self.control.label} at tick {len(self.times)}, t = {t:g} s,"

    def _valid(self) -> str:
        names = ", ".join(self.control.names[: self.width])
        return f"valid: {self.width} real numbers{f', of {names}' if names else ''}."


def _said(error: BaseException) -> str:
    """What an error of the user's own code says, and the line that it comes from."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if frame.filename != __file__]
    place = f" in {own[-1].filename}, line {own[-1].lineno}" if own else ""
    text = str(error)
    return f"raises {type(error).__name__}{f' ({text[:300]})' if text else ''}{place}"
