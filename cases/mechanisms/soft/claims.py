"""What must come out of the soft contact, by closed forms, and how far engines may be off."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crossbody.cases.arrays import Floats
from crossbody.cases.between import multipliers
from crossbody.cases.case import Case, CaseMetric, Claim, Limit, Parameter, Tier, Value
from crossbody.cases.contacts import contacts
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.parameters import of_numbers
from crossbody.cases.trajectory import Trajectory

SIDES = ("left", "right")


def touch(side: str, run: Trajectory, case: Case) -> float | None:
    """Return when a finger first touches, s; None if it does not."""
    index = case.contacts.index(side)
    return min((c.touch for c in contacts(run) if c.row == index), default=None)


def imbalance(lam: Floats, case: Case) -> Floats:
    """Return lam_L - lam_R (n,) of multipliers (n, nc), N."""
    left, right = (lam[:, case.contacts.index(side)] for side in SIDES)
    return left - right


def _coordinate(case: Case, name: str) -> int:
    return [c.name for c in case.coordinates].index(name)


def block(run: Trajectory, case: Case) -> tuple[Floats, Floats]:
    """Return position (n,), m, and velocity (n,), m/s, of the block along the fingers."""
    k = _coordinate(case, "block")
    return run.q[:, k], run.v[:, k]


def flange(run: Trajectory, case: Case) -> Floats:
    """Return the position of the flange along the fingers (n,), m."""
    if case.variant == "axis":
        return run.q[:, _coordinate(case, "flange")]
    return pose.flanges(of_numbers(case.parameters), run.q[:, :9])[:, 0]


def invariant(run: Trajectory, case: Case) -> Floats:
    """Return x_ref + k (mb b' + bt (b - b0)) + k (y_R - y_L)/ks of every sample (n,), m.

    Of q and v as the reference's mechanisms carry them: the error is the rate of its integral,
    x_ref = error + flange.
    """
    p = {name: case.number(name) for name in ("block_mass", "bt", "ks", "pad_mass")}
    k = 0.01 * case.number("kstar")
    b, rate = block(run, case)
    pads = [run.v[:, _coordinate(case, f"{side} pad")] for side in SIDES]
    felt = p["ks"] * p["pad_mass"] * np.sum(pads, axis=0)
    if case.variant == "axis":
        error = run.v[:, _coordinate(case, "integral of the error")]
        felt += run.v[:, _coordinate(case, "right sensor")] - run.v[:, _coordinate(case, "left sensor")]
    else:
        error = run.v[:, _coordinate(case, "integral of the error x")]
        felt += run.v[:, _coordinate(case, "difference of the sensors")]
    kept: Floats = error + flange(run, case) + k * (p["block_mass"] * rate + p["bt"] * (b - b[0]) + felt / p["ks"])
    return kept


def _contact_imbalance(run: Trajectory, case: Case) -> float:
    """Max |lam_L - lam_R| over the run, between its samples too; NaN where lam is not known."""
    lam = multipliers(run)
    return float(np.max(np.abs(imbalance(run.lam if lam is None else lam, case))))


def _drift(run: Trajectory, case: Case) -> float:
    kept = invariant(run, case)
    return float(np.max(np.abs(kept - kept[0])))


METRICS = {
    "block_end": CaseMetric(
        doc="final position of the block along the fingers",
        unit="m", number=lambda run, case: float(block(run, case)[0][-1]),
    ),
    "contact_imbalance": CaseMetric(
        doc="largest difference of the contact forces on both sides of the block", unit="N", number=_contact_imbalance
    ),
    "end_imbalance": CaseMetric(
        doc="difference of the contact forces at the end: 0 where the block is centred",
        unit="N", number=lambda run, case: abs(float(imbalance(run.lam, case)[-1])),
    ),
    "flange_end": CaseMetric(
        doc="final position of the flange along the fingers: whether robot or block moved",
        unit="m", number=lambda run, case: float(flange(run, case)[-1]),
    ),
    "tactile_invariant": CaseMetric(
        doc="drift of x_ref + k (mb b' + bt (b - b0)) + k (y_R - y_L)/ks, which the tactile loop keeps",
        unit="m", number=_drift,
    ),
    **{
        f"touch_{side}": CaseMetric(
            doc=f"instant at which the {side} finger first touches the block", unit="s", number=partial(touch, side)
        )
        for side in SIDES
    },
}  # fmt: skip


Numbers = Mapping[str, float]
Complex = NDArray[np.complex128]


def responses(p: Numbers, omega: ArrayLike) -> tuple[Complex, Complex]:
    """Frequency responses at omega (m,), rad/s, from the velocity of the fingers.

    Args:
        p: kp, cp, bt, k, ks, gain_p, gain_d, gain_i, flange_mass, pad_mass, block_mass, SI.
        omega: angular frequencies, rad/s, above 0.

    Returns:
        To the difference of the contact forces lam_L - lam_R, N/(m/s); to the velocity of the block, 1.
    """
    s = 1j * np.asarray(omega, dtype=np.float64)
    flexible = 2.0 * (p["kp"] + p["cp"] * s)
    together = (p["block_mass"] + 2.0 * p["pad_mass"]) * s * s + p["bt"] * s
    alone = p["block_mass"] * s * s + p["bt"] * s
    loop = p["gain_d"] * s * s + p["gain_p"] * s + p["gain_i"]
    sensor = p["ks"] / (s + p["ks"])
    flange = -(loop * (p["k"] / s) * sensor * alone + s * together / p["flange_mass"]) / (s**3 + loop)
    share = flexible / (flexible + together)
    block = share / s / (1.0 - share * flange)
    return alone * block, s * block


def final_position(p: Numbers) -> float:
    """Where flange and block come to rest, m: offset k bt/(1 + k bt).

    From the invariant x_ref + k (mb b' + bt (b - b0)) + k (y_R - y_L)/ks with equal forces at the end.
    """
    product = p["k"] * p["bt"]
    return p["offset"] * product / (1.0 + product)


def held_force(p: Numbers) -> float:
    """Contact force on each side once the block rests, N: the pad's stiffness times the interference."""
    return p["kp"] * p["squeeze"]


def grasp(p: Numbers, x: float = 0.0) -> tuple[Floats, Floats]:
    """The equilibrium with the block held at x, m: q (8,) and v (8,) of the mechanism `soft_contact`.

    Both sensors read the held force; flange, block and reference are at x.
    """
    half, force = 0.5 * p["width"], held_force(p)
    q, v = np.zeros(8), np.zeros(8)
    q[:4] = x, x - half, x + half, x
    v[5], v[6] = force, force
    return q, v


def touching(p: Numbers, x: float = 0.0) -> tuple[Floats, Floats]:
    """An equilibrium with the right pad alone against the block, at zero force: the approach's mode set."""
    q, v = grasp(p, x)
    q[1] -= 0.01
    v[5] = v[6] = 0.0
    return q, v


_PROTOTYPE = "an independent prototype of the same equations, to the digits it printed"
_DIGITS = {"touch_right": 1e-5, "touch_left": 1e-5}  # last digit that the prototype printed
_RUNS: dict[tuple[str, float], dict[str, float]] = {
    ("axis", 0.0): {"touch_right": 1.81511, "touch_left": 2.80418, "contact_imbalance": 0.231, "end_imbalance": 4e-3},
    ("axis", 20.0): {"touch_right": 1.81511, "touch_left": 2.80260, "contact_imbalance": 0.210, "end_imbalance": 2e-5},
    ("delta", 0.0): {"touch_right": 1.81511, "touch_left": 2.80428},
    ("delta", 20.0): {"touch_right": 1.81511, "touch_left": 2.80261},
}
"""(variant, k*) -> what a run with the other parameters at their defaults shows."""


def claims(
    variant: str, given: Mapping[str, Value], table: Mapping[str, Parameter], preset: Mapping[str, Value]
) -> tuple[Claim, ...]:
    """The numbers of the run, void once a parameter but k* is changed."""
    k = float(given["kstar"])
    as_set = all(given[k] == preset.get(k, p.default) for k, p in table.items() if k != "kstar")
    found = _RUNS.get((variant, k), {}) if as_set else {}
    told = [Claim(metric=m, expected=x, tier=Tier.B, source=_PROTOTYPE) for m, x in found.items()]
    return (*told, *_ends(variant, k, given), Claim(metric="tactile_invariant", expected=0.0, tier=Tier.A, source=(
        "x_ref + k (mb b' + bt (b - b0)) + k (y_R - y_L)/ks is constant"
    ))) if found else ()  # fmt: skip


def _ends(variant: str, k: float, given: Mapping[str, Value]) -> Iterator[Claim]:
    """Who has moved: with feedback the robot too."""
    p = {name: float(value) for name, value in given.items()} | {"k": 0.01 * k}
    if k > 0.0:
        yield Claim(metric="block_end", expected=final_position(p), tier=Tier.A, source="offset k bt/(1 + k bt)")
    if k > 0.0 and variant == "axis":
        yield Claim(metric="flange_end", expected=final_position(p), tier=Tier.A, source="f_L = f_R at rest")


_STIFF = "fifty tolerances of 1e-9 in a pad, over its time constant of 0.5 ms, where the jaws close within seconds"
_WEIGHT = "ten tolerances of 1e-9 in the depth of a robot of 9 N at 0.6 m, over its kinetic energy of 0.6 mJ"
_BOUNDS = {
    "contact_imbalance": (1e-3, "the last digit printed"),
    "velocity": (1e-4, _STIFF),
    "energy_drift": (1e-4, _WEIGHT),
    "block_end": (2e-6, "the slowest pole leaves exp(-2.8 t) of the shift, and a moving block causes a reading"),
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
    yield "position", along, _STEPPED + "that of the velocity, divided by the pad's rate, over the travel of the jaws"
    yield "gap_error", along, _STEPPED + "that of the velocity, divided by the pad's rate, over the travel of the jaws"
    yield "energy_drift", 4.0 * missed * p["pad_mass"] / moving, _STEPPED + "twice that of the velocity, in both pads"


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
