"""Limits that hold for every case: a case may widen one with its reason, none may leave one out."""

from __future__ import annotations

from collections.abc import Iterator

from crossbody.cases.case import Case, Limit

TOLERANCE = 1e-9
"""For which limits on errors are: where a looser one is asked for, they are wider by as much."""
_TOLERANCE = "a thousand times the default tolerance of 1e-9: errors grow from event to event"
_FASTER = "of the tolerance, times the ratio of the fastest rate to the motion's"
_IDENTITY = "an identity at every sample: rounding"
_COUNT = "a count"
_ON_THE_GRID = "impacts on the grid of the steps: the way of one of them"
_FOUND_LATE = "a contact is found where a step begins and pushes until its end: the ways of two"
_LOCATED = "located events: rounding, and the tolerance of a root by its rate"
_LOCATING = (
    ("reference", "*"), ("mujoco", "matched"), ("pinocchio", "law"), ("pinocchio", "impulse"),
    ("pinocchio", "impulse_simultaneous"), ("exudyn", "*"),
)  # fmt: skip
"""Engines and profiles whose events are located between their steps."""
_SAMPLED = "the trapezoidal rule between a run's own samples; an impact inside a step costs half its way"
_OF_MUJOCO = (
    "MuJoCo's own pyramids, soft contacts and step: friction creeps where it holds, pushes "
    "off the slip where it slides, and lifts what slides fast"
)
_RIGID = (
    "rigid contacts on a grid of steps: friction begins and ends with a step, and so does what it makes of a velocity"
)
_BOUNDED = f"{_RIGID}; its friction is bounded along two axes, not in a cone"
KNOWN = {
    ("mujoco", "default"): _OF_MUJOCO,
    ("pinocchio", "admm"): _RIGID,
    ("drake", "matched"): "stiff contacts on a grid of steps, and friction as a steep function of the slip",
    ("drake", "default"): (
        "soft contacts, one a pair of solids, where they are deepest; friction as a function "
        "of the slip, and the normal force of the step before"
    ),
    ("dart", "matched"): _BOUNDED,
    ("dart", "default"): f"{_BOUNDED}, and what rests is put to sleep",
}
_FRICTION = tuple(
    Limit(metric="*", engine=engine, profile=profile, covers_none=True, known=known)
    for (engine, profile), known in KNOWN.items()
)
"""What takes engines with laws of their own outside where contacts or joints of a scene have friction."""


def default_limits(case: Case) -> tuple[Limit, ...]:
    """Limits on position, velocity, force, energy, events and drift, where the case's rows have such."""
    everyone = tuple(Limit(metric=metric, value=value, why=why) for metric, value, why in _defaults(case))
    everyone += _FRICTION if case.rubs else ()
    if not case.law.unilateral.any():
        return everyone
    located = (
        Limit(metric="event_gap", value=1e-6, engine=engine, profile=profile, why=_LOCATED)
        for engine, profile in _LOCATING
    )
    late = Limit(metric="event_gap", value=2.0, engine="pinocchio", profile="admm", why=_FOUND_LATE)
    return (*everyone, *located, late)


def _defaults(case: Case) -> Iterator[tuple[str, float, str]]:
    yield "start_error", 1e-12, "the case's own numbers, put into an engine's coordinates and back: rounding"
    yield "position", 1e-6, _TOLERANCE
    yield "velocity", 1e-5, _FASTER
    yield "energy_drift", 1e-6, _TOLERANCE
    yield "energy_integrator", 1e-6, "the account of all work closes to integration accuracy"
    yield "energy_residual", 1e-9, _IDENTITY
    yield "rate_residual", 2e-2, _SAMPLED
    if not case.contacts:
        return
    yield "gap_residual", 1e-9, _IDENTITY
    yield "mode_residual", 0.0, "an identity at every sample"
    yield "law_residual", 1e-6, "the law's own equation at every state, with the rounding of stiff rows"
    yield "lam_impulse_path", 1e-5, _FASTER
    yield "contact_work", 1e-6, _TOLERANCE
    if case.law.unilateral.any():
        yield "gap_error", 1e-6, _TOLERANCE
        yield "event_gap", 1.0, _ON_THE_GRID
        yield "complementarity", 1e-6, "contacts push only, to the precision of the released instant"
        yield "event_times", 1e-6, _TOLERANCE
        yield "mode_times", 1e-6, _TOLERANCE
        yield "touch_count", 0.0, _COUNT
        yield "release_count", 0.0, _COUNT
    if case.rubs:
        yield "stick_times", 1e-6, _TOLERANCE
        yield "slip_times", 1e-6, _TOLERANCE
        yield "cone_violation", 1e-6, "friction is at most mu times the normal force, to what rows that stick are off"
        yield "friction_angle", 1e-6, "friction is against the slip, to the precision of its direction"
    if (~case.law.unilateral & (case.law.a0 > 0.0)).any():
        yield "constraint_drift", 1e-8, "the law draws closures back at its own rate"


def limits_of(case: Case) -> tuple[Limit, ...]:
    """The limits of a case in full: its own behind the defaults, so that of equals its own speak."""
    return (*default_limits(case), *case.limits)
