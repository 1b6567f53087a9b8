"""What comes out of a cradle: the balls' last speeds, beside what collision rules say."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case, CaseMetric
from crossbody.cases.contacts import CLOSED, contacts
from crossbody.cases.mechanisms.cradle import scene
from crossbody.cases.mechanisms.cradle.rules import answer
from crossbody.cases.trajectory import Trajectory

SLOW = 1e-6  # a gap that closes slower than this part of the speed that came in stands still
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
    """Return max |v_i - v_i of the rule| / v_in; None where the rule has no answer or collisions are not over.

    Args:
        rule: one of `crossbody.cases.mechanisms.cradle.rules.RULES`.
        run: the motion.
        case: of a cradle.
    """
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


_BEHIND = "speeds behind the collisions against {}, over the speed that came in"
METRICS = {
    "balls_out": CaseMetric(doc="balls that leave with more than half the speed that came in", number=_balls_out),
    "energy_created": CaseMetric(
        doc="energy behind the collisions less that before, over the kinetic energy that came in",
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
        doc="momentum that appeared or got lost on the line, over what came in", number=_momentum, always=True
    )
}
"""Of sliders alone: strings take momentum up."""
