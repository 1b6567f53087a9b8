"""What MuJoCo keeps for the whole process: set for one run and put back whatever happens."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import mujoco

Hook = Callable[[Any, Any], None]


@contextmanager
def hooked(hook: Hook | None) -> Iterator[None]:
    """Call `hook(model, data)` in every evaluation, between the rows' reference accelerations and the solver.

    It sits in the slot of the control callback, which Runge-Kutta visits in every stage.
    Compiling a model while it is set would call it too: compile before.
    """
    previous = mujoco.get_mjcb_control()
    mujoco.set_mjcb_control(hook)
    try:
        yield
    finally:
        mujoco.set_mjcb_control(previous)
