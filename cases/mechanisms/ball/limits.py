"""How far each engine may be from the truth of the bouncing ball at its default settings, and why."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from crossbody.cases import defaults
from crossbody.cases.case import Claim, Limit

_TOLERANCE = "a thousand times the default tolerance of 1e-9: errors grow from impact to impact"

# Largest error of an engine that follows the law, by metric.
ERRORS = {
    "position": (1e-6, _TOLERANCE),
    "event_times": (1e-6, _TOLERANCE),
    "energy_drift": (1e-6, _TOLERANCE),
    "energy_integrator": (1e-6, "the ledger must close to integration accuracy"),
    "penetration_error": (1e-6, _TOLERANCE),
    "restitution_error": (1e-5, "near the threshold speed the exit speed is a small difference"),
    "lam_impulse": (1e-6, _TOLERANCE),
    "law_residual": (1e-8, "an algebraic identity at every state"),
    "touch_count": (0.0, "a count"),
}

# How exactly a claimed number must come out.
CLAIMS = {
    "contacts": (0.0, "a count"),
    "bounces": (0.0, "a count"),
    "transitions": (0.0, "a count"),
    "final_gap": (1e-9, "the rest of the decay exp(-10 t), and the tolerance"),
    "final_lam": (1e-6, "the rest of the decay exp(-10 t), and the tolerance"),
    "fifth_exit": (1e-2, "width of the zoomed figure"),
    "energy_per_bounce": (1e-6, _TOLERANCE),
    "separation_gap": (1e-7, _TOLERANCE),
    "restitution": (1e-6, _TOLERANCE),
    "contact_time": (1e-7, _TOLERANCE),
    "penetration": (1e-5, "the deepest sample, not the deepest instant"),
}

OBVIOUS = "The obvious model has MuJoCo's own contact constants (solref 0.02 1) and a step of 2 ms, not the case's law."
IMPACT = (
    "An impact in no time has no contact phase: a restitution replaces the law, so the ball "
    "neither sinks in nor stays for the contact time, and weight does not act during it."
)
STEPPING = (
    "Time stepping on a rigid contact: first order, with impacts on the grid and a restitution instead of the law."
)

_KNOWN = (("mujoco", "default", OBVIOUS), ("pinocchio", "impulse", IMPACT), ("pinocchio", "admm", STEPPING))
# The engine at its own step against itself much finer: what remains when the model is the same.
_STEP = (
    ("mujoco", "matched", 2e-5, 2e-5, "Runge-Kutta 4 with located events at 1 ms"),
    ("mujoco", "default", 6e-2, 6e-3, "Euler at 2 ms, impacts on the grid"),
    ("pinocchio", "admm", 2e-2, 3e-2, "first order, impacts on the grid"),
)

_OFF = "it starts off the floor, and what is left of that decays as the law prescribes"
_OTHER_LAW = (("mujoco", "default", OBVIOUS), ("pinocchio", "impulse", IMPACT), ("pinocchio", "admm", STEPPING))
_SMALL = "the kinetic energy it is measured by is a thousandth of the energy that is stored"
_FIXED = "Runge-Kutta 4 at fixed steps of 1 ms, with no event to locate"
_THOUSANDFOLD = 1e-6
_EXACT_THERE = ("energy_integrator", "final_lam")  # numbers of a run that fixed steps leave as they are
_LOCATED = "Runge-Kutta 4 with located events, twenty steps in half a period of the law, from impact to impact"
_FIXED_STEP = {"position": 1e-6, "energy_drift": 2e-5, "lam_impulse": 1e-6, "lam_impulse_path": 1e-6}


def limits(claims: Iterable[Claim], bilateral: bool, height: float) -> tuple[Limit, ...]:
    """The limits of one variant beside those that every case has: its claims, and the properties of engines.

    Args:
        claims: what it claims.
        bilateral: whether the floor is always on.
        height: of the ball at the start, m.
    """
    claimed = {claim.metric for claim in claims}
    wanted = ERRORS | {metric: CLAIMS[metric] for metric in CLAIMS if metric in claimed}
    return tuple(_all(wanted, bilateral, height))


def _all(wanted: dict[str, tuple[float, str]], bilateral: bool, height: float) -> Iterator[Limit]:
    for metric, (value, why) in wanted.items():
        yield Limit(metric=metric, value=value, why=why)
    for engine, profile, known in _KNOWN:
        yield Limit(metric="*", engine=engine, profile=profile, covers_none=True, known=known)
    yield from defaults.ball(wanted, bilateral)
    if bilateral:
        yield Limit(metric="energy_drift", value=2e-5, why=_SMALL)
        yield Limit(metric="energy_integrator", value=2e-5, why=_SMALL)
        yield Limit(metric="constraint_drift", value=abs(height) * (1.0 + 1e-9), why=_OFF)
        for metric, value in _FIXED_STEP.items():
            yield Limit(metric=metric, value=value, engine="mujoco", profile="matched", why=_FIXED)
    else:
        located = [m for m, (value, _) in wanted.items() if value == _THOUSANDFOLD and m not in _EXACT_THERE]
        for metric in (*located, "gap_error", "mode_times"):
            yield Limit(metric=metric, value=1e-5, engine="mujoco", profile="matched", why=_LOCATED)
    for engine, profile, position, times, why in _STEP:
        for metric, value in (("position", position), ("event_times", times)):
            yield Limit(metric=f"largest {metric} (step)", value=value, engine=engine, profile=profile, why=why)
    for engine, profile, known in _OTHER_LAW:
        yield Limit(metric="audit", engine=engine, profile=profile, known=known)
