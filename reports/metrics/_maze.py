"""What a run of the ball maze tells: ring changes, and where the ball leaves the face it started on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reports.metrics._contacts import at, contacts

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory

FACE_BELOW = 0


def is_maze(case: Case) -> bool:
    """Whether the case is the ball maze."""
    return case.mechanism == "maze"


def ring_changes(run: Trajectory, case: Case) -> Floats:
    """Instants at which the ball passed a ring (m,), s."""
    channel = case.discrete.index("channel")
    return np.array([switch.t for switch in run.switches if switch.variable == channel])


def leaving(run: Trajectory) -> tuple[float, float] | None:
    """Angle from the top and its rate, rad and rad/s, where the ball leaves the outer face; None if it does not."""
    first = next((c for c in contacts(run) if c.row == FACE_BELOW and np.isfinite(c.release)), None)
    if first is None:
        return None
    x, y, xd, yd = (
        at(run, signal, first.release) for signal in (run.q[:, 1], run.q[:, 2], run.v[:, 1], run.v[:, 2])
    )  # fmt: skip
    return float(np.arctan2(x, y)), (y * xd - x * yd) / (x * x + y * y)
