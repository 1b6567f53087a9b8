"""Position against the truth's on matched arcs, over the largest of each coordinate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import differences
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.scale import least, of_like

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
SMALL, STILL = 1e-6, 1e-9
"""A coordinate that moves less than this part of its like rests."""


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max over samples and coordinates of |q - q_truth| / max |q_truth|, of its like where one rests.

    A quaternion is told by the angle between both, rad, since q and -q are the same rotation.
    """
    inside, exact = aligned(truth, run)
    if not inside.any():
        return None
    off = differences(run.q[inside], exact.q, case.quaternions)
    return float(np.max(off / scale_of(truth.trajectory, case)))


def scale_of(exact: Trajectory, case: Case) -> Floats:
    """Return the largest |q_truth| (n,) of each coordinate; of its like, for one that rests but for rounding.

    The joints of a scene, a robot's, are measured by the largest of their unit: one that hardly moves in the truth, by
    the balance of others, tells of an engine that moves it how far that is, and not how still it ought to be. Where all
    of these rest, what the case says of their size. Errors below 1e-12, what absolute tolerances are, pass the usual
    limit of 1e-6.
    """
    own: Floats = np.max(np.abs(exact.q), axis=0)
    shared, smallest = of_like(own, case.coordinates), least(case.coordinates)
    own = shared if case.scene is not None else own
    scale = np.where(shared < smallest, smallest, np.where(own > STILL * shared, np.maximum(own, SMALL), shared))
    scale[list(case.quaternions)] = 1.0  # rad
    return scale
