"""What a run of the delta robot tells: its flange, beside the truth's and beside the path that it follows."""

from __future__ import annotations

import math

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.between import period
from crossbody.cases.case import Case, CaseMetric
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.parameters import of_numbers
from crossbody.cases.trajectory import Trajectory


def flange(run: Trajectory, case: Case) -> Floats:
    """Return the position of the flange (n, 3), m."""
    return pose.flanges(of_numbers(case.parameters), run.q)


def circle(p: pose.Numbers, t: Floats) -> Floats:
    """Return the circle (n, 3), m, that the flange is to follow: about its start, smoothly growing."""
    x = np.minimum(t / p["fade"], 1.0)
    radius = p["radius"] * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    angle = 2.0 * math.pi * p["frequency"] * t
    start = np.array([p["x"], p["y"], p["z"]])
    return start + np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(len(t))])


def _tracking_error(run: Trajectory, case: Case) -> float:
    """Max |r - z| in the last third of the horizon, m."""
    late = run.t > case.t_end * 2.0 / 3.0
    apart = circle(of_numbers(case.parameters), run.t[late]) - flange(run, case)[late]
    return float(np.max(np.linalg.norm(apart, axis=1), initial=0.0))


def _swing_period(run: Trajectory, case: Case) -> float | None:
    """Of the flange along x, behind the last change of the inputs, s; None without inputs."""
    if case.inputs is None:
        return None
    after = run.t > case.inputs.times[-1]
    return period(run.t[after], flange(run, case)[after, 0])


METRICS = {
    "flange": CaseMetric(doc="position of the flange against the truth's", unit="m", signal=flange, always=True),
    "swing_period": CaseMetric(
        doc="period of the flange's swing along x behind a push", unit="s", number=_swing_period
    ),
}
FOLLOWING = {
    "tracking_error": CaseMetric(
        doc="distance of the flange from the path that its controller follows", unit="m",
        number=_tracking_error, always=True,
    ),
}  # fmt: skip
"""Of a robot under control alone."""
