"""What a run of the delta robot tells of its flange, and how far each engine may be off, and why."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.between import period
from crossbody.cases.case import Case, CaseMetric, Limit
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
    "swing_period": CaseMetric(doc="period of the flange's swing along x after a push", unit="s", number=_swing_period),
}
FOLLOWING = {
    "tracking_error": CaseMetric(
        doc="distance of the flange from the path that its controller follows", unit="m",
        number=_tracking_error, always=True,
    ),
}  # fmt: skip
"""Of a robot under control alone."""


SOFT = (
    "The obvious model has MuJoCo's own equality constants (solref 0.02 1), its "
    "regularisation and a step of 2 ms, not the closures' law: tips stay some tenths of a "
    "millimetre apart and lam is off by some per cent."
)
_TIGHT = "tolerances of 1e-9 and 1e-10 and steps of 1 ms leave less than this on a smooth motion"
_TOLERANCE, _GROWTH, _ADDED = 1e-9, 2e3, 50.0
"""Default tolerance; how much a difference of the starts grows in the fall (280 in the light robot, 1,940
in the heavy one, moved aside by 1e-8 m); independent errors of some 2,500 steps add up as their root."""
_FALLEN = _TOLERANCE * _GROWTH * _ADDED
_LEVER = 0.1
"""Of the flange, m/rad, in order of magnitude: its links are .1 to .3 m long and share an angle's error."""
_GROWN = "the tolerance, times 2,000 for the growth of differences in the fall, times 50 for the errors of all steps"
_STEPS = (
    "a fixed step of 1 ms, although the robot folds within some ten steps; the error is proportional to "
    "its fourth power"
)
_COUNTS = "readings halfway between two counts of the encoder round either way, and a count is 24 urad"

Bounds = Mapping[str, tuple[float, str]]

_SMOOTH: Bounds = {
    "flange": (1e-8, _TIGHT),
    "angle_error": (1e-7, _TIGHT),
    "lam_error": (1e-6, _TIGHT),
    "constraint_drift": (1e-8, _TIGHT),
    "energy_drift": (1e-5, "over the largest kinetic energy, which is small"),
}


def _limits(bounds: Bounds) -> Iterator[Limit]:
    """The same bound for all, and for the obvious model the reason why it is outside."""
    for metric, (value, why) in bounds.items():
        yield Limit(metric=metric, value=value, why=why)
    for metric in ("*", "audit"):
        yield Limit(metric=metric, engine="mujoco", profile="default", known=SOFT)


def _fixed_step(factor: float, metrics: tuple[str, ...], bounds: Bounds) -> Iterator[Limit]:
    """Wider bounds for MuJoCo's fixed steps, which a folding robot outruns."""
    for metric in metrics:
        value, _ = bounds[metric]
        yield Limit(metric=metric, value=factor * value, why=_STEPS, engine="mujoco", profile="matched")


_FALL: Bounds = {
    "position": (_FALLEN, _GROWN),
    "velocity": (_FALLEN, _GROWN),
    "lam_impulse_path": (_FALLEN, _GROWN),
    "flange": (_LEVER * _FALLEN, _GROWN + ", on a lever of 0.1 m"),
    "angle_error": (_FALLEN, _GROWN),
    "lam_error": (_FALLEN, _GROWN),
    "constraint_drift": (1e-5, _GROWN),
    "energy_drift": (_FALLEN, _GROWN),
}
_SAMPLED: Bounds = {
    "position": (5e-5, _COUNTS + ", of half a radian"),
    "velocity": (1e-2, _COUNTS + ": a few steps of the torque show in the accelerations"),
    "lam_impulse_path": (1e-3, _COUNTS),
    "flange": (1e-6, _COUNTS),
    "angle_error": (1e-5, _COUNTS),
    "lam_error": (1e-1, _COUNTS + ": one more or less shows in the differentiated reading, and so in the torque"),
    "constraint_drift": (1e-8, _TIGHT),
    "energy_drift": (1e-2, _COUNTS),
}
_FOLDED = ("position", "velocity", "lam_impulse_path", "flange", "angle_error", "lam_error", "energy_drift")
_SWING = (1e-2, "0.5 % of a period of 1.4 s, for a swing that is not quite small")

IMPULSE = tuple(_limits(_SMOOTH))
FREE = (*_limits(_FALL), *_fixed_step(100.0, _FOLDED, _FALL))
SINGULARITY = (*_limits(_SMOOTH), Limit(metric="swing_period", value=_SWING[0], why=_SWING[1]))


def tracking(grown: float) -> tuple[Limit, ...]:
    """Limits of a robot on a circle, of whose radius a part has grown at the horizon."""
    value, why = _SAMPLED["position"]
    aside = {
        "position": (
            value / grown,
            why + ", over the part of the radius that is reached, with which sideways angles grow",
        )
    }
    return tuple(_limits({**_SAMPLED, **aside}))


def on_the_circle(lag: float, settled: bool) -> Limit:
    """Of what the controller leaves of its path, beside the lag of a steady circle, m.

    The lag is what sampling and delay leave once the start is forgotten, m; where it is settled,
    the last third of the horizon shows that alone.
    """
    if settled:
        return Limit(metric="tracking_error", value=0.1 * lag, why="the lag's next order, encoder counts and friction")
    why = "the remainder of the start, decaying as exp(-7 t); less than the lag, so that 0 does not pass"
    return Limit(metric="tracking_error", value=0.8 * lag, why=why)
