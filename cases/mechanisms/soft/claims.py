"""What must come out of the soft contact, and how far engines may be from it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from crossbody.cases.case import Claim, Limit, Parameter, Tier, Value
from crossbody.cases.mechanisms.soft import closed_forms as closed

_PROTOTYPE = "an independent prototype of the same equations, to the digits it printed"
_DIGITS = {"touch_right": 1e-5, "touch_left": 1e-5}  # last digit that the prototype printed
_RUNS: dict[tuple[str, float], dict[str, float]] = {
    ("axis", 0.0): {"touch_right": 1.81511, "touch_left": 2.80418, "contact_imbalance": 0.231, "end_imbalance": 4e-3},
    ("axis", 20.0): {"touch_right": 1.81511, "touch_left": 2.80260, "contact_imbalance": 0.210, "end_imbalance": 2e-5},
    ("delta", 0.0): {"touch_right": 1.81511, "touch_left": 2.80428},
    ("delta", 20.0): {"touch_right": 1.81511, "touch_left": 2.80261},
}
"""(variant, k*) -> what a run with the other parameters at their defaults shows."""


def _preset(
    given: Mapping[str, Value], table: Mapping[str, Parameter], variant: Mapping[str, Value]
) -> bool:  # fmt: skip
    """Whether all but k* is as the variant sets it."""
    return all(given[k] == variant.get(k, p.default) for k, p in table.items() if k != "kstar")


def claims(
    variant: str, given: Mapping[str, Value], table: Mapping[str, Parameter], preset: Mapping[str, Value]
) -> tuple[Claim, ...]:
    """The numbers of the run, void once a parameter but k* is changed."""
    k = float(given["kstar"])
    found = _RUNS.get((variant, k), {}) if _preset(given, table, preset) else {}
    told = [Claim(metric=m, expected=x, tier=Tier.B, source=_PROTOTYPE) for m, x in found.items()]
    return (*told, *_ends(variant, k, given), Claim(metric="tactile_invariant", expected=0.0, tier=Tier.A, source=(
        "x_ref + k (mb b' + bt (b - b0)) + k (y_R - y_L)/ks is constant"
    ))) if found else ()  # fmt: skip


def _ends(variant: str, k: float, given: Mapping[str, Value]) -> Iterator[Claim]:
    """Who has moved: with feedback the robot too."""
    p = {name: float(value) for name, value in given.items()} | {"k": 0.01 * k}
    if k > 0.0:
        yield Claim(metric="block_end", expected=closed.final_position(p), tier=Tier.A, source="offset k bt/(1 + k bt)")
    if k > 0.0 and variant == "axis":
        yield Claim(metric="flange_end", expected=closed.final_position(p), tier=Tier.A, source="f_L = f_R at rest")


_STIFF = "fifty tolerances of 1e-9 in a pad, over its time constant of 0.5 ms, where the jaws close within seconds"
_WEIGHT = "ten tolerances of 1e-9 in the depth of a robot of 9 N at 0.6 m, over its kinetic energy of 0.6 mJ"
_BOUNDS = {
    "contact_imbalance": (1e-3, "the last digit printed"),
    "velocity": (1e-4, _STIFF),
    "energy_drift": (1e-4, _WEIGHT),
    "block_end": (2e-6, "the slowest pole leaves exp(-2.8 t) of the shift, and a moving block a reading"),
    "flange_end": (2e-6, "the slowest pole leaves exp(-2.8 t) of the shift"),
    "tactile_invariant": (1e-12, "Runge-Kutta methods keep linear invariants to rounding"),
}


OBVIOUS = (
    "The obvious model has MuJoCo's own contact constants (solref 0.02 1), whose stiffness goes with the "
    "mass that they join: against pads of 10 g the one place where two balls touch gives way by all but "
    "a fortieth of the squeeze and holds 0.05 N, not 2 N. Nothing is located within its step of 2 ms."
)
_ALWAYS = {"axis": ("velocity",), "delta": ("velocity", "energy_drift")}
STEP = 1.5  # step of Runge-Kutta 4 in the matched model, in time constants of a pad
_STEPPED = f"Runge-Kutta 4 at {STEP} time constants of a pad: "


_PEAK = 1.875  # fastest rate of the jaws' path over its mean


def _fixed_steps(p: Mapping[str, float], moving: float) -> Iterator[tuple[str, float, str]]:
    """What a fixed step leaves of the decay of a pad behind its touch: metric, limit and reason.

    The law excites the pad's fast mode by a1/fast of the speed of the touch, which is at most the
    largest there is. The polynomial R of Runge-Kutta 4 misses the exponential of a step by a
    twentieth, and of all steps together, each smaller by R, by 1/(1 - R)^2 times that.

    Args:
        p: parameters, SI.
        moving: mass that moves with the flange, kg.
    """
    reduced = 1.0 / (1.0 / p["pad_mass"] + 2.0 / moving)
    damping = 0.5 * p["cp"] / reduced
    fast, z = damping + math.sqrt(max(damping**2 - p["kp"] / reduced, 0.0)), -STEP
    left = 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0)))
    missed = abs(math.exp(z) - left) * p["a1"] / fast
    along = missed / (1.0 - left) ** 2 / fast * _PEAK / (p["close_end"] - p["close_start"])
    yield "velocity", missed, _STEPPED + "its error in exp(-1.5), times a1 over the pad's rate"
    yield "position", along, _STEPPED + "the velocity's, over the pad's rate, on the way of the jaws"
    yield "gap_error", along, _STEPPED + "the velocity's, over the pad's rate, on the way of the jaws"
    yield "energy_drift", 4.0 * missed * p["pad_mass"] / moving, _STEPPED + "twice the velocity's, in both pads"


def limits(variant: str, claimed: Iterable[Claim], p: Mapping[str, float]) -> tuple[Limit, ...]:
    """Of what is claimed, and wider ones than every case has: a limit without a claim would ask for zero.

    The same for all engines that follow the case's law; the last digit printed bounds what was printed.
    """
    digits = {**_DIGITS, "end_imbalance": 1e-5 if p["kstar"] else 1e-3}
    told = {**{m: (x, "the last digit printed") for m, x in digits.items()}, **_BOUNDS}
    bounds = {metric: told[metric] for metric in (*_ALWAYS[variant], *(claim.metric for claim in claimed))}
    moving = p["flange_mass"] if variant == "axis" else p["m3"]
    stepped = (
        Limit(metric=m, value=x, engine="mujoco", profile="matched", why=why)
        for m, x, why in _fixed_steps(p, moving)
        if m != "energy_drift" or variant == "axis"  # the delta's weight moves far more energy than its speed
    )
    known = (Limit(metric=m, engine="mujoco", profile="default", known=OBVIOUS) for m in ("*", "audit"))
    return (*(Limit(metric=m, value=x, why=why) for m, (x, why) in bounds.items()), *stepped, *known)
