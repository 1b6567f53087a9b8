"""Gap at the end of the first contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.cases.contacts import at, contacts

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "m"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Gap at the first release, m; negative below the surface."""
    ended = (c for c in contacts(run) if c.release < float("inf"))
    return next((at(run, run.gap[:, c.row], c.release) for c in ended), None)
