"""A log that MuJoCo writes itself: every state lands in a row of one preallocated array."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.engines._log import Log, Modes

STATE = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)  # as its own type it costs three times the copy
"""time, qpos, qvel, act, ...: what a step starts from, inputs apart."""


class Tape(Log):
    """One row an instant; the last row is also the state to which a step returns that overran an event.

    Attributes:
        rows (capacity, size of the state): the first `n` are written.
        n: instants recorded.
    """

    def __init__(self, model: Any, data: Any, capacity: int) -> None:
        super().__init__()
        self.model, self.data, self.n = model, data, 0
        self.rows: Floats = np.empty((max(capacity, 16), mujoco.mj_stateSize(model, STATE)))

    def record(self, lam: Any, mode: Modes) -> None:
        """Append the present state."""
        if self.n == len(self.rows):
            self.rows = np.concatenate((self.rows, np.empty_like(self.rows)))
        mujoco.mj_getState(self.model, self.data, self.rows[self.n], STATE)
        self.n += 1
        self.lam.append(lam)
        self.mode.append(mode)

    def rewind(self) -> None:
        """Put the last recorded state back."""
        mujoco.mj_setState(self.model, self.data, self.rows[self.n - 1], STATE)

    def columns(self) -> tuple[Floats, Floats, Floats]:
        """Times (n,), qpos (n, nq), qvel (n, nv)."""
        nq, nv, rows = self.model.nq, self.model.nv, self.rows[: self.n]
        return rows[:, 0], rows[:, 1 : 1 + nq], rows[:, 1 + nq : 1 + nq + nv]
