"""Energy that switching made by its formula against the ledger, over the largest kinetic energy, without damping."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from crossbody.reports.measuring.switching import made, parted

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
NEEDS = "ledger"


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """|sum of jumps - work of all rows| / max T of the truth.

    None with damping, whose work is not in the formula, and while rows still press, whose energy comes back; NaN
    without an account.
    """
    scale = float(truth.trajectory.energy[:, 0].max())
    jumps = made(run, case)
    if jumps is None or case.law.a1.any() or scale == 0.0 or not parted(run):
        return None
    if run.ledger is None:
        return math.nan
    return abs(jumps - float(run.ledger.contact[-1].sum())) / scale
