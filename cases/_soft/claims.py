"""What must come out of the soft contact, and how far engines may be from it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from crossbody.cases._case import Claim, Limit, Parameter, Tier, Value
from crossbody.cases._soft import closed_forms as closed

_PROTOTYPE = "an independent prototype of the same equations, to the digits it printed"
_DIGITS = {"touch_right": 1e-5, "touch_left": 1e-5}
"""Last digit that the prototype printed."""
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


_BOUNDS = {
    "contact_imbalance": (1e-3, "the last digit printed"),
    "event_times": (1e-6, "tolerances of 1e-9 on a smooth approach"),
    "energy_drift": (1e-4, "over the largest kinetic energy, which is small"),
    "block_end": (2e-6, "the slowest pole leaves exp(-2.8 t) of the shift, and a moving block a reading"),
    "flange_end": (2e-6, "the slowest pole leaves exp(-2.8 t) of the shift"),
    "tactile_invariant": (1e-12, "Runge-Kutta methods keep linear invariants to rounding"),
}


OBVIOUS = (
    "The obvious model has MuJoCo's own contact constants (solref 0.02 1), whose stiffness goes with the mass that "
    "they join: against pads of 10 g a contact gives way by nine tenths of the squeeze and holds 0.19 N, not 2 N. "
    "Nothing is located within its step of 2 ms."
)
_STEPPED = "Runge-Kutta 4 at fixed steps, a few of them in the decay of a pad behind its touch"
_STEPS = {"position": 1e-5, "gap_error": 1e-5, "velocity": 1e-2}
_ALWAYS = ("event_times", "energy_drift")


def limits(variant: str, claimed: Iterable[Claim], kstar: float) -> tuple[Limit, ...]:
    """Of what is claimed, and wider ones than every case has: a limit without a claim would ask for zero.

    The same for all engines that follow the case's law; the last digit printed bounds what was printed.
    """
    digits = {**_DIGITS, "end_imbalance": 1e-5 if kstar else 1e-3}
    told = {**{m: (x, "the last digit printed") for m, x in digits.items()}, **_BOUNDS}
    bounds = {metric: told[metric] for metric in (*_ALWAYS, *(claim.metric for claim in claimed))}
    stepped = (Limit(metric=m, value=x, engine="mujoco", profile="matched", why=_STEPPED) for m, x in _STEPS.items())
    known = (Limit(metric=m, engine="mujoco", profile="default", known=OBVIOUS) for m in ("*", "audit"))
    return (*(Limit(metric=m, value=x, why=why) for m, (x, why) in bounds.items()), *stepped, *known)
