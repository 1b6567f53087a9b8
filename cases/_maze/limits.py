"""How far each engine may be from the truth of the ball maze, and why."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from crossbody.cases._case import Limit

OBVIOUS = (
    "The obvious model builds rings of segments and has MuJoCo's own contact constants and friction, not the case's "
    "law: it rolls over facets, sinks in and slips."
)
TENDON = (
    "MuJoCo's rolling condition is a tendon, linear in the joints: while a landing ball sinks in by h it acts at the "
    "face's own radius, off by h/rho, a thousandth."
)
_TOLERANCE = "a thousand times the default tolerance of 1e-9"
_LOG = "read between the samples of a run"
_MULTISTEP, _STIFF = 20.0, "errors of backward differentiation add up over thousands of steps in stiff contact"
_TINY_SWING = 1e-9 / (1.0 - math.cos(1e-3))
"""m g rho times the default tolerance, over m g rho (1 - cos(angle)), the kinetic energy of a swing of 1e-3 rad."""
_SMALL = "a tolerance of 1e-9 in the height, over the height of a swing of 1e-3 rad: 1/(1 - cos 1e-3) = 2e6"
_JUMPS = "lam jumps at every landing, and a sample on the wrong side of a jump counts half a step"
_GROWN = "errors of the first landing grow until the last ring"

Bounds = Mapping[str, tuple[float, str]]

_MOTION: Bounds = {"position": (1e-6, _TOLERANCE), "energy_drift": (1e-6, _TOLERANCE)}
_OF: Mapping[str, Bounds] = {
    "inside": {
        **_MOTION,
        "energy_drift": (_TINY_SWING, _SMALL),
        "energy_integrator": (_TINY_SWING, _SMALL),
        "swing_period": (1e-6, _LOG),
    },
    "free": {**_MOTION, "swing_period": (1e-6, _LOG)},
    "outside": {
        **_MOTION,
        "lam_impulse_path": (1e-3, _JUMPS),
        "event_times": (1e-6, _TOLERANCE),
        "unstable_pole": (1e-6, _TOLERANCE),
        "leave_angle": (1e-5, _LOG),
    },
    "balanced": _MOTION,
    "solve": {
        "position": (1e-4, _GROWN),
        "velocity": (1e-2, _GROWN),
        "energy_drift": (1e-4, _GROWN),
        "event_times": (1e-4, _GROWN),
        "gap_error": (1e-2, _GROWN),
        "lam_impulse_path": (1e-2, _JUMPS),
        "ring_changes": (0.0, "a count"),
        "ring_change_times": (1e-5, _GROWN),
        "contact_loss": (7e-6, "1 % of 0.70 mJ"),
    },
}

_LANDS = ("outside", "solve")
"""Variants in which a ball lands on a face."""


def limits(variant: str) -> tuple[Limit, ...]:
    """The limits of one variant beside those that every case has."""
    return (*_limits(_OF[variant]), *_known(variant))


def _limits(bounds: Bounds) -> Iterator[Limit]:
    for metric, (value, why) in bounds.items():
        yield Limit(metric=metric, value=value, why=why)
        if bounds.get(metric) == _MOTION.get(metric):
            yield Limit(
                metric=metric, value=_MULTISTEP * _MOTION[metric][0], why=_STIFF, engine="reference", profile="cvode"
            )


def _known(variant: str) -> Iterator[Limit]:
    for metric in ("*", "audit"):
        yield Limit(metric=metric, engine="mujoco", profile="default", known=OBVIOUS)
    if variant in _LANDS:
        yield Limit(metric="*", engine="mujoco", profile="matched", known=TENDON)
