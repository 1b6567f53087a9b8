"""Position against the truth's on matched arcs, over the largest of each coordinate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.apart import errors
from crossbody.reports.measuring.placed import Placed, largest
from crossbody.reports.measuring.scale import RESTS, ROUNDING, scale_of
from crossbody.reports.measuring.truth import Truth, taken

UNIT = "1"
CLAIMED = False
ROUNDED = 1e-3
"""Coordinates below this, m or rad, are those of a mechanism that stands in its reference pose."""
FEW = 20
"""Samples at which it is asked by how much gaps change with positions."""


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max over samples, between them, and coordinates of |q - q_truth| / max |q_truth|, of its like where one rests.

    A quaternion is compared by the angle between both, rad, since q and -q are the same rotation. Between samples that
    are further apart than a 200th of the horizon the error is the cubic through both of theirs and of the velocities'.
    """
    inside, exact = aligned(truth, run, case)
    off, t = errors(truth, taken(run, inside), exact, case)
    return _named(off, t, scale_of(truth.trajectory, case), case) if len(off) else None


def _named(off: Floats, t: Floats, scale: Floats, case: Case) -> Placed:
    """Return the largest; the angle of a quaternion by the name of all four."""
    named = [(one.name, one.unit) for one in case.coordinates]
    for j in case.quaternions:
        named[j] = named[j][0].removesuffix(" qw"), "rad"
    return largest(off, t, named, scale)


def gap_scale_of(truth: Truth, case: Case, rows: NDArray[np.bool_]) -> Floats:
    """Return what the gap of each row is measured by, m or rad: its largest, or how far its bodies are.

    A gap is known no better than the positions of which it is a function, by as much as it changes with each; but where
    the equations are not known, or discrete variables change them, than the widest of all.
    """
    from crossbody.reports.measuring.equations import SAMPLES, equations, spread  # numba, which a page does without

    motion, system = truth.trajectory, equations(case)
    own: Floats = np.max(np.abs(motion.gap[:, rows]), axis=0, initial=0.0)
    if not (own.any() or motion.q.any()):  # errors are absolute where a closed form rests exactly
        return own
    most = max(float(own.max()), ROUNDING * float(np.max(np.abs(motion.q))))
    if most < ROUNDED * ROUNDING:  # nor do coordinates near zero tell how large the mechanism is
        most = RESTS
    if system is None or system.jumps:
        return np.full(own.shape, most)
    some = spread(motion)[:: -(-SAMPLES // FEW)]
    slopes = np.abs(system.equations_along(motion.t[some], motion.q[some], motion.v[some])[2][:, rows])
    sizes = np.delete(scale_of(motion, case), [at + 3 for at in case.quaternions])
    known: Floats = np.max(slopes * sizes, axis=(0, 2))
    return np.maximum(own, np.minimum(known, most))
