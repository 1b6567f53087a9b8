"""Energy that the integrator made or lost, over the largest kinetic energy or the swing of the potential.

What is left of E(t) - E(0) after the work of the inputs, of every multiplier and of damping.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.scale import energy

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
NEEDS = "ledger"


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |E - E(0) - input + dissipated - work of all rows| / the truth's largest energy; NaN without an account."""
    scale = energy(truth.trajectory)
    if scale == 0.0:
        return None
    if run.ledger is None:
        return math.nan
    book = run.ledger.input - run.ledger.dissipated + run.ledger.contact.sum(axis=1)
    change = run.total_energy - run.total_energy[0]
    return float(np.max(np.abs(change - (book - book[0])))) / scale
