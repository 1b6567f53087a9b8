"""How far each engine may be from the truth of the red body at its default settings, and why."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from crossbody.cases.case import Claim, Limit

REAL_TIME = (
    "It integrates collisions in real time: while one lasts, bodies move and gravity acts, so "
    "that velocities behind it differ from those of a collision in no time as b0^(-1/2)."
)
IN_NO_TIME = (
    "Collisions take no time: what moves and what gravity does while one lasts is missing, as "
    "b0^(-1/2), and so are the pulses of lam."
)
RIGID = "A restitution stands for the constants of COLLISION, and a rigid row for those of CONTACT."
STEPPING = (
    "Time stepping at 1 ms with the restitution of each row: first order, no capture and no "
    "second set of constants; the left corner hops once before it rests."
)
OBVIOUS = (
    "The obvious model has MuJoCo's own contact constants (solref 0.02 1), one set for all, "
    "and a step of 2 ms: the left corner is not let go when the right one lands."
)

Bounds = Mapping[str, tuple[float, str]]
_TOLERANCE = "a thousand times the default tolerance of 1e-9"
_ERRORS: Bounds = {
    "position": (1e-6, _TOLERANCE),
    "event_times": (1e-8, "a thousand times the tolerance, over the fast time scale of the collisions"),
    "mode_times": (4e-7, _TOLERANCE + ", at a hundredth of the force, over a collision's slow rate of 268/s"),
    "energy_drift": (1e-6, _TOLERANCE),
    "energy_integrator": (1e-6, "the ledger must close to integration accuracy"),
    "lam_impulse": (1e-5, "both integrals take the same samples by the same rule"),
}
_CLAIMS: Bounds = {
    "mode_order": (0.0, "every mode change, in order"),
    "foot_lam": (1e-6, "the slab stands still"),
    "wall_lam": (0.0, "a row that is never touched has no multiplier"),
    "peak_lam3": (1e-3, "the peak is at the touch, which is located"),
    "collision_impulse": (1e-8, _TOLERANCE),
}
"""Judged where the case claims a number."""

_MATCHED_BOUNDS: Bounds = {
    "mode_times": (4e-5, "the hand-over is taken at the end of its step of 39 us"),
    "energy_drift": (1e-5, "Runge-Kutta 4 with located events at 39 us"),
    "foot_lam": (1e-3, "the engine's own solver leaves this much of lam"),
    "velocity": (1e-4, "Runge-Kutta 4 with located events at 39 us"),
}
"""What MuJoCo's fixed step costs where it follows the case's law."""

_KNOWN: dict[str, Mapping[tuple[str, str], str]] = {
    "resolved": {
        ("mujoco", "default"): OBVIOUS, ("pinocchio", "impulse"): IN_NO_TIME,
        ("pinocchio", "impulse_simultaneous"): IN_NO_TIME, ("pinocchio", "admm"): STEPPING,
    },
    "frozen": {
        ("mujoco", "matched"): REAL_TIME, ("mujoco", "default"): OBVIOUS, ("pinocchio", "law"): REAL_TIME,
        ("pinocchio", "admm"): STEPPING,
    },
}  # fmt: skip
"""Variant -> engines that follow other equations than the case."""
_OTHER_PHYSICS = (
    ("mujoco", "default", OBVIOUS), ("pinocchio", "impulse", RIGID),
    ("pinocchio", "impulse_simultaneous", RIGID), ("pinocchio", "admm", RIGID),
)  # fmt: skip
"""Engines whose constants are a restitution, or their own."""


def limits(variant: str, claims: Iterable[Claim]) -> tuple[Limit, ...]:
    """The limits of one variant: errors always, and what it claims."""
    claimed = {claim.metric for claim in claims}
    bounds = {**_ERRORS, **{metric: bound for metric, bound in _CLAIMS.items() if metric in claimed}}
    return tuple(_all(variant, bounds))


def _all(variant: str, bounds: Bounds) -> Iterator[Limit]:
    for metric, (value, why) in bounds.items():
        yield Limit(metric=metric, value=value, why=why)
    for metric, (value, why) in _MATCHED_BOUNDS.items() if variant == "resolved" else ():
        yield Limit(metric=metric, value=value, engine="mujoco", profile="matched", why=why)
    for (engine, profile), known in _KNOWN[variant].items():
        yield Limit(metric="*", engine=engine, profile=profile, covers_none=True, known=known)
    for engine, profile, known in _OTHER_PHYSICS:
        yield Limit(metric="audit", engine=engine, profile=profile, known=known)
