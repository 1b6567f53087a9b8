"""What a run of the ball maze tells: ring changes, swings, where the ball leaves its first face."""

from __future__ import annotations

import math

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.between import period
from crossbody.cases.case import Case, CaseMetric
from crossbody.cases.contacts import at, contacts
from crossbody.cases.trajectory import Trajectory

FACE_BELOW = 0


def ring_changes(run: Trajectory, case: Case) -> Floats:
    """Return the instants at which the ball passed a ring (m,), s."""
    channel = case.discrete.index("channel")
    return np.array([switch.t for switch in run.switches if switch.variable == channel])


def leaving(run: Trajectory) -> tuple[float, float] | None:
    """Find angle from the top and its rate, rad and rad/s, where the ball leaves the outer face; None if it stays."""
    first = next((c for c in contacts(run) if c.row == FACE_BELOW and np.isfinite(c.release)), None)
    if first is None:
        return None
    x, y, xd, yd = (
        at(run, signal, first.release) for signal in (run.q[:, 1], run.q[:, 2], run.v[:, 1], run.v[:, 2])
    )  # fmt: skip
    return float(np.arctan2(x, y)), (y * xd - x * yd) / (x * x + y * y)


def _leave_angle(run: Trajectory, case: Case) -> float | None:
    left = leaving(run)
    return None if left is None else math.cos(left[0])


def _unstable_pole(run: Trajectory, case: Case) -> float | None:
    """Where the ball leaves the face, by delta'^2 = 2 pole^2 (cos(delta0) - cos(delta)), exact."""
    left = leaving(run)
    if left is None:
        return None
    angle, rate = left
    start = math.atan2(run.q[0, 1], run.q[0, 2])
    return abs(rate) / math.sqrt(2.0 * (math.cos(start) - math.cos(angle)))


METRICS = {
    "leave_angle": CaseMetric(
        doc="cosine of the angle from the top at which the ball leaves an outer face", number=_leave_angle
    ),
    "ring_changes": CaseMetric(
        doc="how often the ball passes a ring, inward and outward",
        number=lambda run, case: float(len(ring_changes(run, case))),
    ),
    "ring_change_times": CaseMetric(
        doc="how far the instants at which the ball passes a ring are off", unit="s", instants=ring_changes, always=True
    ),
    "swing_period": CaseMetric(
        doc="period of the ball's swing inside a ring", unit="s", number=lambda run, case: period(run.t, run.q[:, 1])
    ),
    "unstable_pole": CaseMetric(
        doc="rate at which a ball released near the top of an outer face runs away", unit="1/s", number=_unstable_pole
    ),
}
