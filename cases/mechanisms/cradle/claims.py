"""What comes out of a cradle beside what rules say, and how far each engine may be off, and why."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import defaults
from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case, CaseMetric, Claim, Limit
from crossbody.cases.contacts import CLOSED, contacts
from crossbody.cases.mechanisms.cradle import scene
from crossbody.cases.mechanisms.cradle.rules import answer
from crossbody.cases.trajectory import Trajectory

SLOW = 1e-6  # a gap that closes slower than this part of the speed that came in stands still
NEAR = 1e-6  # part of an energy of turning by which the recorded one may be another
SHUT = 1e-3  # a gap deeper than this part of speed/sqrt(a0) still pushes, in a run without modes


def row(case: Case) -> scene.Row:
    """Return the balls of a case, with their speeds as they arrive."""
    return scene.row(case.parameters, case.mechanism)


def speeds(run: Trajectory, case: Case) -> Floats:
    """Return the speeds of the balls along their paths (n, balls), m/s."""
    return run.v if case.mechanism == "sliders" else case.number("length") * run.v


def outgoing(run: Trajectory, case: Case) -> tuple[int, Floats | None]:
    """Find the sample behind the collisions, and the speeds there (balls,), m/s; None where they are not over.

    Sliders: the last sample. Pendulums: the first behind the first touch at which nothing pushes
    and no gap closes.
    """
    moving = speeds(run, case)
    if not len(run.t):
        return 0, None
    if case.mechanism == "sliders":
        return len(run.t) - 1, moving[-1]
    touched = contacts(run)
    if not touched:
        return 0, None
    still = np.diff(moving, axis=1) >= -SLOW * row(case).speed
    parted = (run.t >= touched[0].touch) & (still & ~_pushes(run, case)).all(axis=1)
    # The touch itself stands there twice: before it gaps still close.
    at = int(np.argmax(parted))
    return (at, moving[at]) if parted[at] else (0, None)


def _pushes(run: Trajectory, case: Case) -> NDArray[np.bool_]:
    """Rows that push (n, nc): by mode, else by depth."""
    if (run.mode >= 0).all():
        return np.isin(run.mode, CLOSED)
    balls = row(case)
    return np.asarray(run.gap < -SHUT * balls.speed / math.sqrt(balls.a0))


def distance(rule: str, run: Trajectory, case: Case) -> float | None:
    """Return max |v_i - v_i of the rule| / v_in; None where the rule has no answer or collisions go on."""
    balls = row(case)
    expected, found = answer(rule, balls), outgoing(run, case)[1]
    if expected is None or found is None:
        return None
    return float(np.max(np.abs(found - expected))) / balls.speed


def _balls_out(run: Trajectory, case: Case) -> float | None:
    found = outgoing(run, case)[1]
    return None if found is None else float((found > 0.5 * row(case).speed).sum())


def _energy_created(run: Trajectory, case: Case) -> float | None:
    """(E_out - E_in) / T_in, negative if lost."""
    at, found = outgoing(run, case)
    if found is None:
        return None
    brought = 0.5 * float(row(case).masses @ row(case).v0 ** 2)
    return float(run.total_energy[at] - run.total_energy[0]) / brought


def _momentum(run: Trajectory, case: Case) -> float:
    """Max |sum m v - sum m v(0)| / sum m v(0)."""
    momentum = run.v @ row(case).masses
    return float(np.max(np.abs(momentum - momentum[0])) / abs(momentum[0]))


_BEHIND = "speeds after the collisions against {}, relative to the incoming speed"
METRICS = {
    "balls_out": CaseMetric(doc="balls that leave with more than half the incoming speed", number=_balls_out),
    "energy_created": CaseMetric(
        doc="energy after the collisions minus that before, relative to the incoming kinetic energy",
        number=_energy_created, always=True,
    ),
    **{
        name: CaseMetric(doc=_BEHIND.format(what), number=partial(distance, rule), always=True)
        for name, rule, what in (
            ("pattern_distance", "sequential", "one collision after another"),
            ("pattern_simultaneous", "simultaneous", "all collisions at once, (2 - n)/n, 2/n, ... of n equal balls"),
            ("pattern_memoryless", "memoryless", "the memoryless law at the row's own gap, a0 and zeta"),
            ("pattern_linear", "linear", "a chain of linear springs"),
            ("pattern_hertz", "hertz", "a chain of Hertzian springs"),
        )
    },
}  # fmt: skip
SLIDING = {
    "momentum": CaseMetric(
        doc="momentum gained or lost on the line, relative to the incoming momentum", number=_momentum, always=True
    )
}
"""Of sliders alone: strings take momentum up."""


TOGETHER = (
    "It integrates the law of all contacts together: balls that touch act as one block, and "
    "where collisions overlap the law itself makes energy."
)
OBVIOUS = (
    "The obvious model has spheres with friction, an elastic contact that MuJoCo's own step of 2 "
    "ms just resolves (solref -10000 0) and Euler's method, not the case's law."
)
AT_ONCE = "All impacts are solved together, as a complementarity problem: touching balls act as one block."
IN_TURN = "Impacts are instantaneous and follow one another, as in the ideal cradle, but not as this rule requires."
STEPPING = "Time stepping with all contacts in one complementarity problem: first order, touching balls are one block."
IMPACT = "Instantaneous impacts replace the law of contacts: nothing overlaps, nothing is compressed."

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
_RESTING = "rows that touch at rest release and touch again by rounding: touches cannot be matched with certainty"
_FIXED = "Runge-Kutta 4 with located events, twenty steps per contact"
_KEPT = "a force on one ball acts on its neighbour"

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
    ("mujoco", "matched"): (1e-4, "Runge-Kutta 4 with located events, twenty steps per contact, then straight lines"),
    ("pinocchio", "law"): (2e-5, "relative tolerance of 1e-10, in many short arcs where balls touch"),
}
"""Sliders: largest error of position against the engine's own equations (twice what was measured)."""


def limits(
    mechanism: str, rule: str, gap: float, claims: Iterable[Claim], turning: float = 0.0
) -> tuple[Limit, ...]:  # fmt: skip
    """The limits of one mechanism under one rule, with a gap between neighbours at rest, m; claims are counts.

    `turning` is the part of the energy of balls on strings that is theirs of turning, if they are spheres.
    """
    counts = {claim.metric: (0.0, "a count") for claim in claims}
    turned = Limit(
        metric="energy_residual", value=1e-9, engine="mujoco", profile="default", known=OBVIOUS,
        known_least=(1.0 - NEAR) * turning, known_size=(1.0 + NEAR) * turning,
    )  # fmt: skip
    bounds = {**_bounds(mechanism, rule, gap), **counts}
    return (*_all(mechanism, rule, bounds, gap > 0.0), *((turned,) if turning else ()))


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


def _all(mechanism: str, rule: str, bounds: Bounds, apart: bool) -> Iterator[Limit]:
    for metric, (value, why) in bounds.items():
        yield Limit(metric=metric, value=value, why=why)
    for (engine, profile), known in _OTHERS[rule].items():
        yield Limit(metric="*", engine=engine, profile=profile, covers_none=True, known=known)
    if rule == "resolved":
        for metric in ("position", "energy_drift", "gap_error"):
            yield Limit(metric=metric, value=1e-5, engine="mujoco", profile="matched", why=_FIXED)
    if mechanism == "sliders":
        yield Limit(metric="momentum", value=1e-10, why=_KEPT)
        yield from defaults.sliders(bounds, apart)
        for (engine, profile), (value, why) in _STEP.items():
            yield Limit(metric="largest position (step)", value=value, engine=engine, profile=profile, why=why)
        yield Limit(metric="energy_switching_error", value=1e-6, why="the formula is exact where G is constant")
    for engine, profile, known in _OTHER_PHYSICS:
        yield Limit(metric="audit", engine=engine, profile=profile, known=known)
