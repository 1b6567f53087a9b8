"""How long a run stays within a thousandth of the truth, as far as the truth itself can be trusted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases.rotations import differences
from crossbody.reports.measuring.alignment import aligned

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "s"
CLAIMED = False
APART = 1e-3


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """First instant at which a coordinate is off by a thousandth of the largest, s; else the last one compared.

    None where rows can open: events are matched there before anything is compared.
    """
    if case.law.unilateral.any() or not len(case.law.a0):
        return None
    inside, exact = aligned(truth, run)
    scale = float(np.max(np.abs(truth.trajectory.q), initial=0.0))
    off = np.max(differences(run.q[inside], exact.q, case.quaternions), axis=1) > APART * scale
    return float(run.t[inside][np.argmax(off)] if off.any() else run.t[inside][-1])
