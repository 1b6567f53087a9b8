"""How far each engine may be from the truth of the red body at its default settings, and why."""

from __future__ import annotations

from collections.abc import Iterator

from crossbody.cases._case import Limit

_TOLERANCE = "a thousand times the default tolerance of 1e-9"
_FAST = "a thousand times the default tolerance, over the fast time scale of the collisions"

# Largest error of an engine that follows the law, by metric.
_ERRORS = {
    "position": (1e-6, _TOLERANCE),
    "event_times": (1e-8, _FAST),
    "energy_drift": (1e-6, _TOLERANCE),
    "energy_integrator": (1e-6, "the ledger must close to integration accuracy"),
    "lam_impulse": (1e-5, "both integrals take the same samples by the same rule"),
    "mode_order": (0.0, "every mode change, in order"),
    "peak_lam3": (1e-3, "the peak is at the touch, which is located"),
    "peak_lam4": (0.5, "read between the samples of a pulse of some forty steps"),
    "foot_lam": (1e-6, "the slab stands still"),
    "wall_lam": (0.0, "a row that is never touched has no multiplier"),
    "collision_impulse": (1e-8, _TOLERANCE),
}


def limits(variant: str) -> tuple[Limit, ...]:
    """The limits of one variant."""
    return tuple(_all(variant))


def _all(variant: str) -> Iterator[Limit]:
    for metric, (value, why) in _ERRORS.items():
        yield Limit(metric=metric, value=value, why=why)
