"""How far each engine may be from the truth of the delta robot at its default settings, and why."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from crossbody.cases._case import Limit

SOFT = (
    "The obvious model has MuJoCo's own equality constants (solref 0.02 1), its regularisation and a step of 2 ms, not "
    "the closures' law: tips stay some tenths of a millimetre apart and lam is off by percents."
)
_TIGHT = "tolerances of 1e-9 and 1e-10 and steps of 1 ms leave less than this on a smooth motion"
_GROWN = "the fall folds the robot and differences grow by orders of magnitude: of the tolerance, and of the fixed step"
_COUNTS = "readings near the middle between two counts of the encoder round either way, and a count is 24 urad"

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
        yield Limit(metric=metric, value=value, why=why, engine="mujoco", profile="default", known=SOFT)
    yield Limit(metric="audit", value=0.0, engine="mujoco", profile="default", known=SOFT)


def _scaled(factor: float, why: str, **more: tuple[float, str]) -> Bounds:
    return {metric: (factor * value, why) for metric, (value, _) in _SMOOTH.items()} | more


IMPULSE = tuple(_limits(_SMOOTH))
FREE = tuple(_limits(_SMOOTH))
SINGULARITY = tuple(
    _limits(dict(_SMOOTH) | {"swing_period": (1e-2, "0.5 % of a period of 1.4 s, for a swing that is not quite small")})
)
TRACKING = tuple(
    _limits(dict(_SMOOTH) | {"tracking_error": (5e-5, "half of what is claimed as about 0.1 mm")})
)  # fmt: skip
