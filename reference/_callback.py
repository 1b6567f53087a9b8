"""A controller in Python as a kernel `control`: compiled code calls it by the address in the kernel's own state.

The kernel is compiled once for all controllers. Nothing passes through a frame of compiled code
as an exception: what the controller raises is kept, the inputs stay as they were, and the run is
told to end at the present instant.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from crossbody.cases.control import Controller
from crossbody.reference import kernels
from crossbody.reference._activations import Live
from crossbody.reference.kinds import Floats

MEMORY = 1  # length of the kernel's state: the address
_SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_double, *(ctypes.c_void_p,) * 3)


@intrinsic
def _call(typingctx: Any, address: Any, t: Any, q: Any, v: Any, u: Any) -> Any:
    """Call a function void(double, void*, void*, void*) by its address."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [ir.DoubleType(), word, word, word])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
        return context.get_dummy_value()

    return types.void(types.int64, types.float64, types.uintp, types.uintp, types.uintp), generate


@kernels.control
def control(t: float, q: Floats, v: Floats, u: Floats, s: Floats, p: Floats) -> None:
    """Ask the callable whose address is in s; an address is exact as a number, and 0 is none."""
    if s[0] != 0.0:
        _call(np.int64(s[0]), t, q.ctypes.data, v.ctypes.data, u.ctypes.data)


class Callback:
    """One run's controller as compiled code calls it.

    Args:
        controller: of the run.
        nq, nv: lengths of q and v.
        end: called when the controller has failed: the run must end now.
        live: activations that follow what it gives; None without.

    Attributes:
        address: for the kernel's state; it is good as long as this object lives.
        failure: what the controller raised; None if nothing.
    """

    def __init__(
        self, controller: Controller, nq: int, nv: int, end: Callable[[float], None], live: Live | None = None
    ) -> None:
        self.controller, self.end, self.live = controller, end, live
        self.failure: BaseException | None = None
        self._rooms = tuple(ctypes.c_double * size for size in (nq, nv, len(controller.u)))
        self._places: tuple[int, ...] = ()
        self._arrays: list[Floats] = []
        self._function = _SIGNATURE(self._ask)
        self.address = float(ctypes.cast(self._function, ctypes.c_void_p).value or 0)

    def _ask(self, t: float, *places: int) -> None:
        try:
            if places != self._places:  # the workspace stays where it is: views of it are made once
                rooms = (room.from_address(at) for room, at in zip(self._rooms, places, strict=True))
                self._places, self._arrays = places, [np.ctypeslib.as_array(room) for room in rooms]
            q, v, u = self._arrays
            count = self.controller.width
            u[:count] = self.controller(t, q, v)[:count]
            if self.live is not None:
                self.live.put(t, u)
        except BaseException as failure:  # an interrupt too: no exception passes through compiled code
            self.failure = failure
            self.end(t)
