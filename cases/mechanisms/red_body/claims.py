"""What every case of the red body shows of its own, and how far an engine may be from it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from crossbody.cases.between import multipliers
from crossbody.cases.case import Case, CaseMetric, Claim, Limit
from crossbody.cases.mechanisms.red_body.order import LEFT, stages_in_order
from crossbody.cases.trajectory import Trajectory

FEET, WALL = slice(0, 2), 4


def _mode_order(run: Trajectory, case: Case) -> float | None:
    return None if (run.mode < 0).all() else float(stages_in_order(run.events))


def _foot_lam(run: Trajectory, case: Case) -> float | None:
    """Min of lam1 and lam2 over the run, N, from when both stand; None where they never do or lam is not known."""
    feet = run.lam[:, FEET]
    standing = np.flatnonzero((feet > 0.0).all(axis=1))
    return None if np.isnan(run.lam).any() or not len(standing) else float(feet[standing[0] :].min())


def _wall_lam(run: Trajectory, case: Case) -> float | None:
    return None if np.isnan(run.lam).any() else float(np.max(np.abs(run.lam[:, WALL])))


def _corner_lam(run: Trajectory, case: Case) -> float | None:
    """Max lam3 over the run, between its samples too, N; None where lam is not known."""
    lam = multipliers(run)
    return None if lam is None else float(lam[:, LEFT].max())


METRICS = {
    "mode_order": CaseMetric(
        doc="mode changes in the order of the presentation, before anything else: 5 if all", number=_mode_order
    ),
    "foot_lam": CaseMetric(doc="smallest multiplier of the feet of the slab", unit="N", number=_foot_lam),
    "peak_lam3": CaseMetric(doc="largest multiplier of the left corner", unit="N", number=_corner_lam),
    "wall_lam": CaseMetric(
        doc="largest multiplier of the wall beside the body, which is never reached", unit="N", number=_wall_lam
    ),
}


REAL_TIME = (
    "It integrates collisions in real time: while one lasts, bodies move and gravity acts, so "
    "that velocities after it differ from those of an instantaneous collision as b0^(-1/2)."
)
IN_NO_TIME = (
    "Collisions take no time: motion and the effect of gravity during one are missing, as "
    "b0^(-1/2), and so are the pulses of lam."
)
RIGID = "A restitution replaces the constants of COLLISION, and a rigid row those of CONTACT."
STEPPING = (
    "Time stepping at 1 ms with the restitution of each row: first order, no capture and no "
    "second set of constants; the left corner hops once before it rests."
)
OBVIOUS = (
    "The obvious model has MuJoCo's own contact constants (solref 0.02 1), one set for all, "
    "and a step of 2 ms: the left corner is not released when the right one lands."
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
    "foot_lam": (1e-3, "the residual of the engine's own solver in lam"),
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
