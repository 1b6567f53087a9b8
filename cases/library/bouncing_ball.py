"""A ball dropped on a floor that pushes back like a spring and damper, with a ballistic state.

q = height of the lowest point, h = q (Bortoff, American Modelica Conference 2020).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from crossbody.cases import closed_forms as cf
from crossbody.cases import defaults
from crossbody.cases.case import Case, Claim, Coordinate, Limit, Parameter, Tier, Value
from crossbody.cases.mechanisms.ball import Ball, Motion
from crossbody.cases.scene import UNBOUNDED, Body, Joint, Loop, RowLaw, Scene, Shape
from crossbody.cases.scene_contacts import law_of

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
    "final_gap": (1e-9, "the remainder of the decay exp(-10 t), and the tolerance"),
    "final_lam": (1e-6, "the remainder of the decay exp(-10 t), and the tolerance"),
    "fifth_exit": (1e-2, "width of the zoomed figure"),
    "energy_per_bounce": (1e-6, _TOLERANCE),
    "separation_gap": (1e-7, _TOLERANCE),
    "restitution": (1e-6, _TOLERANCE),
    "contact_time": (1e-7, _TOLERANCE),
    "penetration": (1e-5, "the deepest sample, not the deepest instant"),
}

OBVIOUS = "The obvious model has MuJoCo's own contact constants (solref 0.02 1), and its step is 2 ms unless set."
IMPACT = (
    "An instantaneous impact has no contact phase: a restitution replaces the law, so the ball "
    "neither sinks in nor stays in contact for a time in which its weight acts."
)
STEPPING = (
    "Time stepping on a rigid contact: first order, with impacts on the grid and a restitution instead of the law."
)

_KNOWN = (("mujoco", "default", OBVIOUS), ("pinocchio", "impulse", IMPACT), ("pinocchio", "admm", STEPPING))
# The engine at its own step against itself much finer: what remains when the model is the same.
_STEP = (
    ("mujoco", "matched", 2e-5, 2e-5, "Runge-Kutta 4 at fixed steps of 1 ms"),
    ("mujoco", "default", 6e-2, 6e-3, "Euler at 2 ms, impacts on the grid"),
    ("pinocchio", "admm", 2e-2, 3e-2, "first order, impacts on the grid"),
)

_OFF = "it starts off the floor, and the remaining distance decays as the law prescribes"
_OTHER_LAW = (("mujoco", "default", OBVIOUS), ("pinocchio", "impulse", IMPACT), ("pinocchio", "admm", STEPPING))
_SMALL = "it is relative to the kinetic energy, which is a thousandth of the stored energy"
_FIXED = "Runge-Kutta 4 at fixed steps of 1 ms, without events"
STEP_PARTS = ("largest position (step)", "largest event_times (step)")
_THOUSANDFOLD, LEAST, FAULT = 1e-6, 1e-5, 1e-3  # LEAST as for velocities of all; a fault of a per cent is well above
_EXACT_THERE = ("energy_integrator", "final_lam")  # numbers of a run that fixed steps leave as they are
_LOCATED = (
    "Runge-Kutta 4 with located events: of an oscillation's energy, twenty steps in half a period lose "
    "(pi/20)^6/72 each, and the two in which it touches and lets go as much again, which adds up over the impacts"
)
_LOSS = 2.0 * 20.0 * (np.pi / 20.0) ** 6 / 72.0
"""Part of the energy of an oscillation that Runge-Kutta 4 loses in half a period of twenty steps, with its ends."""
_FIXED_STEP = {"position": 1e-6, "energy_drift": 2e-5, "lam_impulse": 1e-6, "lam_impulse_path": 1e-6}


def limits(claims: Iterable[Claim], bilateral: bool, p: Mapping[str, float]) -> tuple[Limit, ...]:
    """The limits of one variant beside those that every case has: its claims, and the properties of engines.

    `bilateral` says whether the floor is always on; `p` are the parameters, of which the height is that of the start.
    """
    claimed, sizes = {claim.metric for claim in claims}, _sizes(p)
    wanted = ERRORS | {metric: CLAIMS[metric] for metric in CLAIMS if metric in claimed}
    sized = {metric: (value * sizes.get(metric, 1.0), why) for metric, (value, why) in wanted.items()}
    return tuple(_all(sized, bilateral, p))


def _sizes(p: Mapping[str, float]) -> Mapping[str, float]:
    """Return what limits in units of energy and force are parts of: those of the fall, and of the weight."""
    fall, weight = 0.5 * p["mass"] * _impact_speed(p) ** 2, p["mass"] * p["gravity"]
    return {name: size for name, size in (("energy_per_bounce", fall), ("final_lam", weight)) if size > 0.0}


def lost(p: Mapping[str, float]) -> float:
    """Return the part of its energy that Runge-Kutta 4 takes from a ball over as many impacts as it has at most.

    They are no closer than a flight at the speed of the first: what comes later, slower, has less energy to lose.
    """
    speed = _impact_speed(p)
    return _LOSS * (1.0 + (0.5 * p["t_end"] * p["gravity"] / speed if speed > 0.0 else 0.0))


def _located(metric: str, p: Mapping[str, float]) -> float:
    """Return by how much fixed steps with located events may take a metric off, in its unit.

    A flight lasts as the root of its energy: instants are off by half the part that is lost until then.
    """
    of = 0.5 * p["t_end"] if "_times" in metric else _sizes(p).get(metric, 1.0)
    return min(max(lost(p), LEAST), FAULT) * of


def _all(wanted: dict[str, tuple[float, str]], bilateral: bool, p: Mapping[str, float]) -> Iterator[Limit]:
    for metric, (value, why) in wanted.items():
        yield Limit(metric=metric, value=value, why=why)
    for engine, profile, known in _KNOWN:
        yield Limit(metric="*", engine=engine, profile=profile, covers_none=True, known=known)
    yield from defaults.ball(wanted, bilateral)
    if bilateral:
        yield Limit(metric="energy_drift", value=2e-5, why=_SMALL)
        yield Limit(metric="energy_integrator", value=2e-5, why=_SMALL)
        yield Limit(metric="constraint_drift", value=abs(p["height"]) * (1.0 + 1e-9), why=_OFF)
        for metric, value in _FIXED_STEP.items():
            yield Limit(metric=metric, value=value, engine="mujoco", profile="matched", why=_FIXED)
    else:
        located = [m for m in wanted if (ERRORS | CLAIMS)[m][0] == _THOUSANDFOLD and m not in _EXACT_THERE]
        others = ("velocity", "gap_error", "mode_times", "lam_impulse_path", "restitution_error")
        for metric in (*located, *others, *STEP_PARTS):
            value = _located(metric, p)
            yield Limit(metric=metric, value=value, engine="mujoco", profile="matched", why=_LOCATED)
    for engine, profile, *sizes, why in _STEP if bilateral else _STEP[1:]:
        for metric, value in zip(STEP_PARTS, sizes, strict=True):
            yield Limit(metric=metric, value=value, engine=engine, profile=profile, why=why)
    for engine, profile, known in _OTHER_LAW:
        yield Limit(metric="audit", engine=engine, profile=profile, known=known)


PARAMETERS = {
    "mass": Parameter(default=1.0, unit="kg", doc="mass of the ball", low=0.0, open_low=True),
    "gravity": Parameter(default=9.81, unit="m/s^2", doc="towards the floor; 0 for a single impact", low=0.0),
    "height": Parameter(default=1.0, unit="m", doc="height of the lowest point at t = 0"),
    "speed": Parameter(default=0.0, unit="m/s", doc="initial speed towards the floor"),
    "a0": Parameter(default=100.0, unit="1/s^2", doc="stiffness of the floor over the mass", low=0.0),
    "a1": Parameter(default=20.0, unit="1/s", doc="damping of the floor over the mass", low=0.0),
    "a2": Parameter(default=1e6, unit="1/(m^2 s^2)", doc="cubic stiffness of the floor over the mass", low=0.0),
    "t_end": Parameter(default=5.0, unit="s", doc="horizon", low=0.0, open_low=True),
}

VARIANTS: dict[str, dict[str, Value]] = {
    "listing": {},
    "elastic": {"a1": 0.0},
    "linear": {"a0": 1e4, "a1": 20.0, "a2": 0.0},
    "resting": {"a2": 0.0},
    "bilateral": {"height": 1e-3},
}

_TITLES = {
    "listing": "a ball bounces twice and comes to rest without penetration",
    "elastic": "without damping the law makes energy at every bounce",
    "linear": "a linear floor, where every arc has a closed form",
    "resting": "a double pole below its threshold speed: the ball must never bounce",
    "bilateral": "the floor is always on, as for linearisation",
}


def _impact_speed(p: Mapping[str, float]) -> float:
    """Speed at the first touch, m/s; 0 if there is none."""
    square = p["speed"] ** 2 + 2.0 * p["gravity"] * p["height"]
    comes = p["height"] >= 0.0 and (p["gravity"] > 0.0 or p["speed"] > 0.0)
    return max(square, 0.0) ** 0.5 if comes else 0.0


def _first_touch(p: Mapping[str, float]) -> float:
    """Instant of the first touch, s, for a ball that comes down."""
    g = p["gravity"]
    return (_impact_speed(p) - p["speed"]) / g if g > 0.0 else p["height"] / p["speed"]


def _impact_claims(p: Mapping[str, float]) -> Iterator[Claim]:
    """One impact without gravity on a linear floor: its closed forms."""
    v0 = _impact_speed(p)
    if p["gravity"] or p["a2"] or not p["a0"] or not v0:
        return
    a0, a1 = p["a0"], p["a1"]
    if _first_touch(p) + cf.contact_time(a0, a1) >= p["t_end"]:
        return
    for metric, value in (
        ("restitution", cf.restitution(cf.damping_ratio(a0, a1))),
        ("contact_time", cf.contact_time(a0, a1)),
        ("penetration", cf.depth(a0, a1, v0)),
        ("separation_gap", cf.separation_gap(a0, a1, v0)),
    ):
        yield Claim(metric=metric, expected=value, tier=Tier.A, source="closed form of one linear contact")


def _undamped_claims(p: Mapping[str, float]) -> Iterator[Claim]:
    """Without damping every bounce adds m (g h_e - a0 h_e^2/2 - a2 h_e^4/4), whatever the speed."""
    v0 = _impact_speed(p)
    if p["a1"] or not p["gravity"] or not (p["a0"] or p["a2"]) or not v0 or 2.0 * _first_touch(p) >= p["t_end"]:
        return
    h = cf.elastic_separation_gap(p["a0"], p["a2"], p["gravity"])
    if v0**2 <= p["a0"] * h**2 + p["a2"] * h**4 / 2.0:
        return
    gain = cf.contact_work(p["mass"], p["gravity"], p["a0"], 0.0, p["a2"], 0.0, h, 0.0)
    yield Claim(metric="separation_gap", expected=h, tier=Tier.A, source="a0 h + a2 h^3 = g")
    yield Claim(metric="energy_per_bounce", expected=gain, tier=Tier.A, source="potential of the law at separation")


def _counts(contacts: int, bounces: int, transitions: int, tier: Tier, source: str) -> Iterator[Claim]:
    numbers = {"contacts": contacts, "bounces": bounces, "transitions": transitions}
    for metric, value in numbers.items():
        yield Claim(metric=metric, expected=float(value), tier=tier, source=source)


def _rest(p: Mapping[str, float], tier: Tier, source: str) -> Iterator[Claim]:
    yield Claim(metric="final_lam", expected=p["mass"] * p["gravity"], tier=tier, source=source)
    yield Claim(metric="final_gap", expected=0.0, tier=tier, source=source)


def _published_claims(variant: str, p: Mapping[str, float]) -> Iterator[Claim]:
    """What the presentation of the law states for its own numbers; void once a parameter is changed."""
    preset = {k: VARIANTS[variant].get(k, parameter.default) for k, parameter in PARAMETERS.items()}
    if dict(p) != preset:
        return
    if variant == "listing":
        yield from _counts(3, 2, 7, Tier.B, "listing and figure of the bouncing ball")
        yield from _rest(p, Tier.B, "rests with h -> 0, lam -> m g")
    elif variant == "resting":
        yield from _counts(1, 0, 1, Tier.A, "impact below the threshold speed")
        yield from _rest(p, Tier.A, "equilibrium of the law")
    elif variant == "elastic":
        yield Claim(metric="fifth_exit", expected=4.36, tier=Tier.B, source="zoomed figure, 4.35 s to 4.37 s")


RADIUS = 0.05
"""Of what is drawn, and touches in engines with contacts of their own, m; the law knows the lowest point alone."""


def scene(p: Mapping[str, float], bilateral: bool) -> Scene:
    """Return a ball on a slide by the height of its lowest point, with the floor as its bound."""
    law, (lowest, highest) = RowLaw(a0=p["a0"], a1=p["a1"], a2=p["a2"]), UNBOUNDED
    held = Loop(name="floor", type="joint", first="height", polynomial=(0.0,) * 5, law=law)
    return Scene(
        bodies=(Body(name="ball", mass=p["mass"]),),
        joints=(
            Joint(name="height", body="ball", type="slide", range=(lowest if bilateral else 0.0, highest), law=law),
        ),
        shapes=(
            Shape(name="floor", type="plane"),
            Shape(name="ball", body="ball", size=(RADIUS, 0.0, 0.0), position=(0.0, 0.0, RADIUS)),
        ),
        loops=(held,) if bilateral else (),
        gravity=(0.0, 0.0, -p["gravity"]),
    )  # fmt: skip


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with its truth; without a cubic term the motion is known in closed form."""
    p = {k: float(value) for k, value in parameters.items()}
    bilateral = variant == "bilateral"
    ball = Ball(mass=p["mass"], gravity=p["gravity"], a0=p["a0"], a1=p["a1"], bilateral=bilateral)
    claims = () if bilateral else (*_published_claims(variant, p), *_impact_claims(p), *_undamped_claims(p))
    linear, made = p["a2"] == 0.0, scene(p, bilateral)
    return Case(
        name="bouncing_ball",
        variant=variant,
        title=_TITLES[variant],
        mechanism="ball",
        parameters=parameters,
        coordinates=(Coordinate(name="height", unit="m"),),
        contacts=("floor",),
        q0=np.array([p["height"]]),
        v0=np.array([-p["speed"]]),
        t_end=p["t_end"],
        law=law_of(made),
        scene=made,
        closed_form=Motion(ball, p["height"], -p["speed"], p["t_end"]) if linear else None,
        claims=claims,
        limits=limits(claims, bilateral, p),
        consistent=not bilateral,  # its start is off the floor, and the law brings it down
        units={k: parameter.unit for k, parameter in PARAMETERS.items()},
    )
