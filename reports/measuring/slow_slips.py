"""Until when slips are fast enough for a tolerance to tell their directions, and friction with them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Mode, Trajectory
from crossbody.cases.defaults import TOLERANCE
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.friction import RUBS, SLIP, least_directed, rubbed
from crossbody.reports.measuring.impulse import cumulative
from crossbody.reports.measuring.truth import Truth, taken

OPEN = 5e-6
"""Part of the largest impulse that friction of slow slips may leave open: half of what impulses are judged to."""


def firm_until(truth: Truth, second: Trajectory, rtol: float, case: Case) -> float:
    """Return until when friction of slow slips is known to `OPEN` of the largest impulse, s; infinite if to the end.

    A slip known to d turns by up to d over its speed, and its friction with it. The two sources of the truth
    tell d, in proportion to their tolerance.
    What stays slower than `least_directed` may as well hold; what begins to slide goes where its force held it.

    Args:
        truth: the motion.
        second: that of its other source.
        rtol: tolerance of that one.
        case: what moves.
    """
    inside, exact = aligned(truth, second, case)
    other = taken(second, inside)
    one, two = rubbed(exact, case), rubbed(other, case)
    scale = float(np.max(np.abs(cumulative(truth.trajectory)), initial=0.0))
    if one is None or two is None or not len(exact.t) or not scale > 0.0:
        return math.inf
    rubs = [np.isin(run.mode[:, one.rows], RUBS) for run in (exact, other)]
    speed, apart = (np.linalg.norm(slip, axis=-1) for slip in (one.slip, one.slip - two.slip))
    slow = rubs[0] & rubs[1] & (speed <= SLIP * float(np.max(speed, initial=0.0, where=rubs[0])))
    slides = slow & (exact.mode[:, one.rows] == Mode.SLIP)
    turned = np.minimum(TOLERANCE / rtol * apart / np.maximum(speed, np.finfo(float).tiny), 2.0)
    lost = _never_again(speed < least_directed(exact), slides)
    turned = np.where(slides, one.mu * one.normal * np.where(lost, 2.0, turned), 0.0)
    each = np.minimum(turned[1:], turned[:-1]).sum(axis=1)  # between two samples: one at a stop has no direction
    left = np.append(0.0, np.cumsum(np.diff(exact.t) * each))
    beyond = np.flatnonzero(left > OPEN * scale)
    return float(exact.t[beyond[0] - 1]) if len(beyond) else math.inf


def _never_again(slow: NDArray[np.bool_], slides: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where (n, m) a slide is slow and remains so to its end."""
    found = slow & slides
    for k in range(len(found) - 2, -1, -1):
        found[k] &= found[k + 1] | ~slides[k + 1]
    return found
