"""Modes of contacts that do not hold somewhere in the run: penetration while FREE, a pull, a missed contact.

Looked for on a fine grid between the run's rows, by the equations and not by the events that the run found.
"""

from __future__ import annotations

from crossbody.cases import Case, Trajectory
from crossbody.reports.measuring.modes import violated
from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = True
RTOL = 1e-6  # every run that a limit is set for is at least as good


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Rows in modes that do not hold; None for a machine that is not level, and without modes or equations."""
    found = violated(case, run, RTOL)
    return None if found is None else float(len(found))
