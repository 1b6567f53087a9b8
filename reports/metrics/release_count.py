"""Contacts that ended in the run less those of the truth: 0 if both let go equally often."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases.contacts import contacts

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Number of contacts of the run that ended minus the truth's; None without a row that can open."""
    if not case.law.unilateral.any():
        return None
    mine, theirs = (
        sum(np.isfinite(c.release) for c in contacts(each, truth.joined)) for each in (run, truth.trajectory)
    )
    return float(mine - theirs)
