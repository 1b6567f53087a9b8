"""Coordinates and velocities of a run against the truth's and themselves: every function is a metric."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.case import Coordinate
from crossbody.cases.rotations import differences, ways
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.equations import finite
from crossbody.reports.measuring.impulse import away
from crossbody.reports.measuring.placed import Placed, largest, of_coordinates
from crossbody.reports.measuring.scale import least, of_like, scale_of_rates
from crossbody.reports.measuring.truth import Truth

UNITS = {"angle_error": "rad", "divergence_time": "s"}
NEEDS: dict[str, str] = {}
APART = 1e-3  # part of the largest coordinate by which a run has left the truth
STILL = 1e-6  # a coordinate whose way is below this part of the longest of its like rests
TURN = 0.5
"""Angle between samples, rad, beyond which they show no turn: the rule is off by TURN^2/12 of an
axis that goes round, and by whole turns soon."""


def angle_error(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Joint angles against the truth's.

    Max |q - q_truth| over samples and coordinates, rad; None unless every coordinate is an angle.
    """
    if any(c.unit != "rad" for c in case.coordinates):
        return None
    inside, exact = aligned(truth, run, case)
    return largest(np.abs(run.q[inside] - exact.q), run.t[inside], of_coordinates(case.coordinates))


def divergence_time(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """How long a run stays within a thousandth of the truth, as far as the truth itself can be trusted.

    First instant at which a coordinate is off by a thousandth of the largest, s; else the last one compared.
    None where rows can open: events are matched there before anything is compared.
    """
    if case.law.unilateral.any() or not len(case.law.a0):
        return None
    inside, exact = aligned(truth, run, case)
    scale = float(np.max(np.abs(truth.trajectory.q), initial=0.0))
    off = np.max(differences(run.q[inside], exact.q, case.quaternions), axis=1) > APART * scale
    return float(run.t[inside][np.argmax(off)] if off.any() else run.t[inside][-1])


def rate_residual(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Recorded velocities against the change of the recorded positions: the unexplained part of it.

    Max over coordinates of |sum of (dq - v dt) sign(v)| / sum of |dq|, v dt by the trapezoidal rule between
    samples. Errors of the rule alternate where the motion bends to and fro; a factor on v does not. What
    turns in space moves about its own axes, as its velocity counts; between samples that are too far apart
    nothing is said of it. None where nothing moves, NaN where a state is no number. It asks nothing of the
    truth or the law, so that it judges engines that follow another one as well.
    """
    if len(run.t) < 2:
        return None
    if not finite(run):
        return math.nan
    mean = 0.5 * (run.v[1:] + run.v[:-1])
    moved, rated = ways(run.q, case.quaternions), mean * np.diff(run.t)[:, None]
    for i, at in enumerate(case.quaternions):  # i of them before it have an entry more than rates
        turn = slice(at - i, at - i + 3)
        far = np.linalg.norm(rated[:, turn], axis=1) > TURN
        moved[far, turn] = rated[far, turn] = 0.0
    way = np.sum(np.abs(moved), axis=0)
    off = np.abs(np.sum((moved - rated) * np.sign(mean), axis=0))
    longest = of_like(way, case.velocities)
    moving = (way > STILL * longest) & (longest > least(case.velocities))
    return float(np.max(off[moving] / way[moving])) if moving.any() else None


def start_error(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """First recorded state against the case's start, over the largest of each coordinate.

    Max of |q(0) - q0| / max |q_truth| and |v(0) - v0| / max |v_truth|, each over all that share its unit.
    None for a run that begins later than its case, as one restarted inside of a log does. A known property
    of an engine never explains where it starts.
    """
    if not len(run.t) or run.t[0] != 0.0 or run.q.shape[1] != len(case.q0):
        return None
    off = differences(run.q[:1], case.q0[None], case.quaternions)[0]
    pairs = [(off, truth.trajectory.q, case.coordinates, False)]
    if not any(event.impulse and event.t == 0.0 for event in run.events):  # else the first row may be behind it
        pairs.append((np.abs(run.v[0] - case.v0), truth.trajectory.v, case.velocities, True))
    return max(_apart(*pair) for pair in pairs if pair[1].shape[1] == len(pair[2]))


def _apart(off: Floats, motion: Floats, named: Sequence[Coordinate], rates: bool) -> Placed:
    sizes = of_like(np.max(np.abs(motion), axis=0, initial=0.0), named)
    told = of_coordinates(named, "/s" if rates else "")
    return largest(off[None], np.zeros(1), told, np.maximum(sizes, least(named, rates)))


def velocity(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Velocity against the truth's on matched arcs, over the largest of each coordinate.

    Max over samples and coordinates of |v - v_truth| / max |v_truth|, of its like where one rests, and where all of
    these do, over the rate that leads as far as positions are measured by (`scale_of_rates`). Only touches are
    matched: a release that is off by dt shows as dt times the acceleration there. Instants of collisions that take no
    time are left out: several may share one, and a sample does not say behind which it stands.
    """
    inside, exact = aligned(truth, run, case)
    if not inside.any():
        return None
    scale = scale_of_rates(truth.trajectory, case)
    smooth = away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)
    off = np.abs(run.v[inside] - exact.v)[smooth]
    return largest(off, run.t[inside][smooth], of_coordinates(case.velocities, "/s"), scale)
