"""How far each engine may be from the truth of Newton's cradle at its default settings, and why."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from crossbody.cases import defaults
from crossbody.cases.case import Claim, Limit

TOGETHER = (
    "It integrates the law of all contacts together: balls that touch act as one block, and "
    "where collisions overlap the law itself makes energy."
)
OBVIOUS = (
    "The obvious model: spheres with friction, an elastic contact that MuJoCo's own step of 2 "
    "ms just resolves (solref -10000 0) and Euler's method, not the case's law."
)
AT_ONCE = "All impacts are solved together, as a complementarity problem: touching balls act as one block."
IN_TURN = "Impacts come one after another, in no time: what the ideal cradle does, not what this rule asks for."
STEPPING = "Time stepping with all contacts in one complementarity problem: first order, touching balls are one block."
IMPACT = "Impacts in no time replace the law of contacts: nothing overlaps, nothing is compressed."

_OTHERS: dict[str, Mapping[tuple[str, str], str]] = {
    "sequential": {
        ("mujoco", "matched"): TOGETHER, ("mujoco", "default"): OBVIOUS, ("pinocchio", "law"): TOGETHER,
        ("pinocchio", "impulse_simultaneous"): AT_ONCE, ("pinocchio", "admm"): STEPPING,
    },
    "simultaneous": {
        ("mujoco", "matched"): TOGETHER, ("mujoco", "default"): OBVIOUS, ("pinocchio", "law"): TOGETHER,
        ("pinocchio", "impulse"): IN_TURN, ("pinocchio", "admm"): STEPPING,
    },
    "resolved": {
        ("mujoco", "default"): OBVIOUS, ("pinocchio", "impulse"): IMPACT,
        ("pinocchio", "impulse_simultaneous"): IMPACT, ("pinocchio", "admm"): STEPPING,
    },
}  # fmt: skip
"""Rule of the case -> engines that follow another one."""

_EXACT = "straight lines between impacts: rounding"
_LOCATED = "tolerances of 1e-9 and 1e-10, from touch to touch"
_RESTING = "rows that touch at rest let go and touch again by rounding: touches are not matched with certainty"
_FIXED = "Runge-Kutta 4 with located events, twenty steps a contact"
_KEPT = "what acts on one ball acts on its neighbour"

_OTHER_PHYSICS = (
    ("mujoco", "default", OBVIOUS), ("pinocchio", "impulse", IMPACT),
    ("pinocchio", "impulse_simultaneous", IMPACT), ("pinocchio", "admm", STEPPING),
)  # fmt: skip
"""Engines whose constants are a restitution, or their own: the others must pass the audit."""

Bounds = Mapping[str, tuple[float, str]]

_SLIDERS: Bounds = {
    "pattern_distance": (1e-10, _EXACT),
    "energy_drift": (1e-10, _EXACT),
    "energy_integrator": (1e-10, _EXACT),
    "position": (1e-9, _EXACT),
    "event_times": (1e-10, _EXACT),
    "touch_count": (0.0, "a count"),
}
_PENDULUMS: Bounds = {
    "pattern_distance": (1e-3, "balls that wait for the last collision swing back a little, by the gap"),
    "energy_drift": (1e-6, _LOCATED),
    "energy_integrator": (1e-6, _LOCATED),
    "position": (1e-5, _LOCATED),
    "event_times": (1e-6, _LOCATED),
    "touch_count": (0.0, "a count"),
}
_RESOLVED: Bounds = {
    "energy_drift": (1e-6, _LOCATED),
    "energy_integrator": (1e-6, _LOCATED),
    "position": (1e-6, _LOCATED),
    "event_times": (1e-6, _LOCATED),
    "touch_count": (0.0, "a count"),
}
_TOUCHING: Bounds = {
    "energy_drift": (1e-3, _RESTING),
    "energy_integrator": (1e-6, _LOCATED),
    "position": (1e-5, _RESTING),
}
_STEP: Mapping[tuple[str, str], tuple[float, str]] = {
    ("mujoco", "matched"): (1e-4, "Runge-Kutta 4 with located events, twenty steps a contact, then straight lines"),
    ("pinocchio", "law"): (2e-5, "relative tolerance of 1e-10, in many short arcs where balls touch"),
}
"""Sliders: largest error of position against the engine's own equations (twice what was measured)."""


def limits(mechanism: str, rule: str, gap: float, claims: Iterable[Claim]) -> tuple[Limit, ...]:
    """The limits of one mechanism under one rule.

    Args:
        mechanism: "sliders" or "pendulums".
        rule: for several contacts.
        gap: between neighbours at rest, m; 0 where they touch.
        claims: what the case claims: each is a count.
    """
    counts = {claim.metric: (0.0, "a count") for claim in claims}
    return tuple(_all(mechanism, rule, {**_bounds(mechanism, rule, gap), **counts}))


def _bounds(mechanism: str, rule: str, gap: float) -> Bounds:
    if rule == "resolved":
        return _RESOLVED if gap > 0.0 else _TOUCHING
    bounds = _SLIDERS if mechanism == "sliders" else _PENDULUMS
    if rule == "sequential":
        return bounds
    # Whether a row that passes an impulse on without having closed counts as a touch is a matter of convention.
    kept = {metric: bound for metric, bound in bounds.items() if metric != "touch_count"}
    pattern = kept.pop("pattern_distance")
    return kept | ({"pattern_simultaneous": pattern} if gap == 0.0 else {})  # apart, not all collide at once


def _all(mechanism: str, rule: str, bounds: Bounds) -> Iterator[Limit]:
    for metric, (value, why) in bounds.items():
        yield Limit(metric=metric, value=value, why=why)
    for (engine, profile), known in _OTHERS[rule].items():
        yield Limit(metric="*", engine=engine, profile=profile, covers_none=True, known=known)
    if rule == "resolved":
        for metric in ("position", "energy_drift", "gap_error"):
            yield Limit(metric=metric, value=1e-5, engine="mujoco", profile="matched", why=_FIXED)
    if mechanism == "sliders":
        yield Limit(metric="momentum", value=1e-10, why=_KEPT)
        yield from defaults.sliders(bounds)
        for (engine, profile), (value, why) in _STEP.items():
            yield Limit(metric="largest position (step)", value=value, engine=engine, profile=profile, why=why)
        yield Limit(metric="energy_switching_error", value=1e-6, why="the formula is exact where G is constant")
    for engine, profile, known in _OTHER_PHYSICS:
        yield Limit(metric="audit", engine=engine, profile=profile, known=known)
