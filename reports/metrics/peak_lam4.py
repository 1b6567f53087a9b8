"""Largest multiplier of the fourth row; of the red body, the right corner's."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.reports.metrics._lam import peak

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "N"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max lam4 over the run, between its samples too, N; None where lam is not known."""
    return peak(run, 3)
