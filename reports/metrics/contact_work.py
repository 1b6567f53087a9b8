"""Work of every row against the truth's on matched arcs, by the truth's largest energy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.impulse import away
from crossbody.reports.measuring.scale import energy

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
NEEDS = "ledger"


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max over samples and rows of |W - W_truth| / the truth's largest energy.

    NaN without an account, None where the truth has none.

    The sum over all rows is in `energy_integrator`; here each row has its own. Instants of collisions that take no time
    are left out, as in `energy_drift`.
    """
    inside, exact = aligned(truth, run)
    scale = energy(truth.trajectory)
    if exact.ledger is None or scale == 0.0 or not inside.any() or not run.gap.shape[1]:
        return None
    if run.ledger is None:
        return math.nan
    smooth = away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)
    off = np.abs(run.ledger.contact[inside] - exact.ledger.contact)[smooth]
    return float(np.max(off, initial=0.0)) / scale
