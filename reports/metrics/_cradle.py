"""What comes out of a cradle: speeds of the balls when no gap closes any more."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.cradle import scene
from crossbody.cases.mechanisms.cradle.rules import answer
from crossbody.reports.metrics._contacts import CLOSED, contacts

MECHANISMS = ("sliders", "pendulums")
SLOW = 1e-6
"""A gap that closes slower than this part of the speed that came in stands still."""
SHUT = 1e-3
"""A gap deeper than this part of speed/sqrt(a0) still pushes, in a run without modes."""


def is_cradle(case: Case) -> bool:
    """Whether the case is a row of balls."""
    return case.mechanism in MECHANISMS


def row(case: Case) -> scene.Row:
    """The balls of a case, with their speeds as they arrive."""
    return scene.row(case.parameters, case.mechanism)


def speeds(run: Trajectory, case: Case) -> Floats:
    """Speeds of the balls along their paths (n, balls), m/s."""
    return run.v if case.mechanism == "sliders" else case.number("length") * run.v


def outgoing(run: Trajectory, case: Case) -> tuple[int, Floats | None]:
    """Sample behind the collisions, and the speeds there (balls,), m/s; None where they are not over.

    Sliders: the last sample. Pendulums: the first behind the first touch at which nothing pushes and no gap closes.
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
    """Max |v_i - v_i of the rule| / v_in; None where there is no such number.

    Args:
        rule: one of `crossbody.cases.mechanisms.cradle.rules.RULES`.
        run: the motion.
        case: of a cradle or not.
    """
    if not is_cradle(case):
        return None
    balls = row(case)
    expected, found = answer(rule, balls), outgoing(run, case)[1]
    if expected is None or found is None:
        return None
    return float(np.max(np.abs(found - expected))) / balls.speed
