"""Limits that hold for every case, and those of engines for bodies on a line.

A case may widen one with its reason, none may leave one out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from crossbody.cases.case import Case, Limit

TOLERANCE = 1e-9
"""For which limits on errors are: where a looser one is asked for, they are wider by as much."""
_TOLERANCE = "a thousand times the default tolerance of 1e-9: errors grow from event to event"
_FASTER = "a thousand times the default tolerance of 1e-9, times the ratio of the fastest rate to the motion's"
_IDENTITY = "an identity at every sample: rounding"
_COUNT = "a count"
_ON_THE_GRID = "impacts on the grid of steps: the distance moved in one step"
_FOUND_LATE = "a contact is found at the start of a step and pushes until its end: the distance moved in two steps"
_LOCATED = "located events: rounding, and the tolerance of a root times its rate"
_LOCATING = (
    ("reference", "*"), ("mujoco", "matched"), ("pinocchio", "law"), ("pinocchio", "impulse"),
    ("pinocchio", "impulse_simultaneous"), ("exudyn", "*"),
)  # fmt: skip
"""Engines and profiles whose events are located between their steps."""
_SAMPLED = (
    "the trapezoidal rule between a run's own samples; an impact inside a step causes an error of half "
    "the distance moved in it"
)
_OF_MUJOCO = (
    "MuJoCo's own pyramids, soft contacts and step: friction creeps where it holds, pushes "
    "off the slip where it slides, and lifts what slides fast"
)
_RIGID = "rigid contacts on a grid of steps: friction, and its effect on velocities, begins and ends with a step"
_BOUNDED = f"{_RIGID}; its friction is bounded along two axes, not in a cone"
KNOWN = {
    ("mujoco", "default"): _OF_MUJOCO,
    ("pinocchio", "admm"): _RIGID,
    ("drake", "matched"): "stiff contacts on a grid of steps, and friction as a steep function of the slip",
    ("drake", "default"): (
        "soft contacts, one per pair of solids, at the deepest point; friction as a function of the slip and "
        "of the previous normal force"
    ),
    ("dart", "matched"): _BOUNDED,
    ("dart", "default"): f"{_BOUNDED}, and bodies at rest are put to sleep",
}
_FRICTION = tuple(
    Limit(metric="*", engine=engine, profile=profile, covers_none=True, known=known)
    for (engine, profile), known in KNOWN.items()
)
"""What takes engines with laws of their own outside where contacts or joints of a scene have friction."""

_OF_DART = Limit(
    metric="gap_residual", value=5e-7, engine="dart",
    why="DART expands rotations below a thousandth of a radian to second order, 1.7e-10 off: of what rolls, whose gaps "
    "are measured by 1e-6 m, that moves a shape by less than 1e-12 m",
)  # fmt: skip


def default_limits(case: Case) -> tuple[Limit, ...]:
    """Limits on position, velocity, force, energy, events and drift, where the case's rows have such."""
    everyone = tuple(Limit(metric=metric, value=value, why=why) for metric, value, why in _defaults(case))
    everyone += (*_FRICTION, _OF_DART) if case.rubs else ()
    if not case.law.unilateral.any():
        return everyone
    located = (
        Limit(metric="event_gap", value=1e-6, engine=engine, profile=profile, why=_LOCATED)
        for engine, profile in _LOCATING
    )
    late = Limit(metric="event_gap", value=2.0, engine="pinocchio", profile="admm", why=_FOUND_LATE)
    return (*everyone, *located, late)


def _defaults(case: Case) -> Iterator[tuple[str, float, str]]:
    yield "start_error", 1e-12, "the case's own numbers, converted to an engine's coordinates and back: rounding"
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
    yield "mode_contradicted", 0.0, "a mode says what the recorded gap, force and slip are"
    yield "law_residual", 1e-6, "the law's own equation at every state, with the rounding of stiff rows"
    yield "lam_impulse_path", 1e-5, _FASTER
    yield "contact_work", 1e-6, _TOLERANCE
    if case.law.unilateral.any():
        yield "gap_error", 1e-6, _TOLERANCE
        yield "event_gap", 1.0, _ON_THE_GRID
        yield "complementarity", 1e-6, "contacts only push, to the precision of the instant of release"
        yield "event_times", shortest(case.t_end), _TOLERANCE
        yield "mode_times", shortest(case.t_end), _TOLERANCE
        yield "touch_count", 0.0, _COUNT
        yield "release_count", 0.0, _COUNT
    if case.rubs:
        yield "stick_times", shortest(case.t_end), _TOLERANCE
        yield "slip_times", shortest(case.t_end), _TOLERANCE
        yield "cone_violation", 1e-6, "friction is at most mu times the normal force, to the error of sticking rows"
        yield "friction_angle", 1e-6, "friction opposes the slip, to the precision of its direction"
    if (~case.law.unilateral & (case.law.a0 > 0.0)).any():
        yield "constraint_drift", 1e-8, "the law corrects closures at its own rate"


SHORT, BRIEF = 1e-6, 0.1
"""To which instants are judged, s, and the horizon below which it is as much of it less, s."""


def shortest(t_end: float) -> float:
    """Return how far an instant of a motion may be off, s, by its horizon, s."""
    return SHORT * min(1.0, t_end / BRIEF)


def limits_of(case: Case) -> tuple[Limit, ...]:
    """The limits of a case in full: its own behind the defaults, so that of equals its own speak."""
    return (*default_limits(case), *case.limits)


MEMORYLESS = (
    "The law as a force of the state has no memory: it ends at h = 0, has no ballistic state "
    "and makes no energy, unlike the law."
)
SPRINGS = (
    "Springs and dampers below the surface, not the case's law: they yield under the weight, which is not cancelled."
)
PLANT = (
    "A MultibodyPlant's point contact is a spring without the law's damping and cubic term, which yields "
    "under the weight."
)
DISCRETE = (
    "The discrete plant regularises contact with a dissipation time of two steps: it takes energy out of every bounce."
)
IMPACT = "Time stepping on rigid contacts: impacts on the grid, and a restitution instead of the law."
GAMES = "Made for games: overlap is allowed, impacts come on a grid of 1/60 s, and a restitution replaces the law."
TOGETHER = (
    "Every pair pushes as if it were alone: balls that touch are a chain of springs, whose "
    "collisions overlap, not one collision after another."
)

FIXED_STEP = "Generalised-alpha at fixed steps, inside of which contacts begin and end."

_BALL: dict[tuple[str, str], str] = {
    ("exudyn", "matched"): MEMORYLESS, ("exudyn", "default"): SPRINGS, ("drake", "matched"): MEMORYLESS,
    ("drake", "continuous"): PLANT, ("drake", "default"): DISCRETE, ("dart", "matched"): IMPACT,
    ("pymunk", "matched"): IMPACT, ("pymunk", "default"): GAMES,
}  # fmt: skip
_SLIDERS: dict[tuple[str, str], str] = _BALL | {
    ("exudyn", "matched"): TOGETHER, ("exudyn", "default"): TOGETHER, ("drake", "matched"): TOGETHER,
    ("drake", "continuous"): TOGETHER,
}  # fmt: skip
_APART = {("exudyn", "default"): FIXED_STEP}
_LAW = (("exudyn", "matched"), ("drake", "matched"))  # the profiles to which the law's constants are given

# How far each of these takes an engine at the default parameters: about twice what was measured over the variants
# (crossbody run bouncing_ball newtons_cradle -e exudyn -e drake -e dart -e pymunk).
_BALL_SIZES: Mapping[tuple[str, str], Mapping[str, float]] = {
    ("exudyn", "matched"): {
        "bounces": 2, "contacts": 2, "transitions": 4, "touch_count": 110, "position": 0.2,
        "event_times": 0.15, "energy_drift": 0.25, "energy_per_bounce": 0.28,
        "fifth_exit": 0.13, "lam_impulse": 0.04, "lam_impulse_path": 0.04,
        "penetration_error": 0.2, "restitution_error": 0.7, "separation_gap": 0.04,
    },
    ("exudyn", "default"): {
        "bounces": 4, "contacts": 4, "transitions": 20, "touch_count": 4, "position": 200.0,
        "event_times": 3.0, "energy_drift": 3e5, "energy_per_bounce": 0.3, "lam_impulse": 0.7,
        "lam_impulse_path": 0.7, "penetration_error": 20.0, "restitution_error": 4.0,
        "separation_gap": 0.04, "final_gap": 0.2, "law_residual": 2.0,
    },
    ("dart", "matched"): {
        "bounces": 2, "contacts": 2, "transitions": 8, "touch_count": 2, "position": 0.7,
        "event_times": 0.9, "energy_drift": 3.0, "energy_per_bounce": 0.2, "fifth_exit": 0.6,
        "lam_impulse": 0.2, "lam_impulse_path": 0.4, "penetration_error": 3.0,
        "restitution_error": 4.0, "separation_gap": 0.04, "final_gap": 5e-8, "law_residual": 2e3,
    },
    ("drake", "matched"): {
        "bounces": 2, "contacts": 2, "transitions": 4, "touch_count": 110, "position": 0.2,
        "event_times": 0.15, "energy_drift": 0.25, "energy_per_bounce": 0.28,
        "fifth_exit": 0.13, "lam_impulse": 0.04, "lam_impulse_path": 0.04,
        "penetration_error": 0.2, "restitution_error": 0.7, "separation_gap": 0.04,
    },
    ("drake", "continuous"): {
        "bounces": 8, "contacts": 6, "transitions": 30, "touch_count": 20, "position": 3.0,
        "event_times": 4.0, "energy_drift": 4.0, "energy_per_bounce": 0.3, "lam_impulse": 2.0,
        "lam_impulse_path": 2.0, "penetration_error": 20.0, "restitution_error": 2.0,
        "separation_gap": 0.04, "final_gap": 2.0, "final_lam": 20.0, "law_residual": 2.0,
    },
    ("drake", "default"): {
        "bounces": 8, "contacts": 20, "transitions": 40, "touch_count": 20, "position": 3.0,
        "event_times": 4.0, "energy_drift": 4.0, "energy_per_bounce": 0.7, "lam_impulse": 2.0,
        "lam_impulse_path": 2.0, "penetration_error": 20.0, "restitution_error": 4.0,
        "separation_gap": 0.05, "final_gap": 2.0, "final_lam": 20.0, "law_residual": 2.0,
    },
    ("pymunk", "matched"): {
        "bounces": 6, "contacts": 6, "transitions": 20, "touch_count": 20, "position": 0.7,
        "event_times": 2.0, "energy_drift": 3.0, "energy_per_bounce": 0.3, "fifth_exit": 0.6,
        "lam_impulse": 0.3, "lam_impulse_path": 0.4, "penetration_error": 3.0,
        "restitution_error": 4.0, "separation_gap": 0.04, "law_residual": 2e3,
    },
    ("pymunk", "default"): {
        "bounces": 2, "contacts": 2, "transitions": 8, "touch_count": 6, "position": 0.7,
        "event_times": 1.0, "energy_drift": 3.0, "energy_per_bounce": 0.5, "fifth_exit": 0.5,
        "lam_impulse": 0.3, "lam_impulse_path": 0.3, "penetration_error": 2.0,
        "restitution_error": 4.0, "separation_gap": 0.05, "final_gap": 0.02, "law_residual": 60.0,
    },
}  # fmt: skip
_SLIDER_SIZES: Mapping[tuple[str, str], Mapping[str, float]] = {
    ("exudyn", "matched"): {"energy_drift": 1.2, "event_times": 0.02, "pattern_distance": 0.6, "position": 0.6},
    ("exudyn", "default"): {"energy_drift": 1.2, "event_times": 0.02, "pattern_distance": 0.6, "position": 0.6},
    ("dart", "matched"): {
        "balls_out": 2, "energy_drift": 3e-4, "event_times": 8e-3, "pattern_distance": 2.0, "position": 2.0,
    },
    ("drake", "matched"): {"energy_drift": 1.2, "event_times": 0.02, "pattern_distance": 0.6, "position": 0.6},
    ("drake", "continuous"): {"energy_drift": 1.2, "event_times": 8e-3, "pattern_distance": 0.6, "position": 0.6},
    ("drake", "default"): {
        "balls_out": 2, "energy_drift": 2.0, "event_times": 0.02, "pattern_distance": 2.0, "position": 2.0,
    },
    ("pymunk", "matched"): {
        "balls_out": 2, "event_times": 8e-3, "pattern_distance": 2.0, "position": 2.0, "touch_count": 4,
    },
    ("pymunk", "default"): {
        "balls_out": 2, "energy_drift": 0.9, "event_times": 0.2, "pattern_distance": 2.0, "position": 2.0,
        "touch_count": 2,
    },
}  # fmt: skip


def ball(wanted: Mapping[str, tuple[float, str]], bilateral: bool) -> Iterator[Limit]:
    """The limits of a ball: `wanted` is metric -> value and its reason."""
    for (engine, profile), known in _BALL.items():
        if not (bilateral and known == MEMORYLESS):
            yield from _limits(engine, profile, known, wanted, _BALL_SIZES.get((engine, profile), {}))


def sliders(wanted: Mapping[str, tuple[float, str]], apart: bool) -> Iterator[Limit]:
    """The limits of a cradle's sliders, which collide one after another where they start apart."""
    for (engine, profile), known in (_SLIDERS | (_APART if apart else {})).items():
        yield from _limits(engine, profile, known, wanted, _SLIDER_SIZES.get((engine, profile), {}))


def _limits(
    engine: str, profile: str, known: str, wanted: Mapping[str, tuple[float, str]], sizes: Mapping[str, float]
) -> Iterator[Limit]:  # fmt: skip
    for metric, (value, why) in wanted.items():
        yield Limit(
            metric=metric, value=value, engine=engine, profile=profile, why=why, known=known,
            known_size=sizes.get(metric, 0.0), covers_none=True,
        )  # fmt: skip
    yield Limit(metric="*", engine=engine, profile=profile, covers_none=True, known=known)
    if (engine, profile) not in _LAW:
        yield Limit(metric="audit", engine=engine, profile=profile, known=known)
