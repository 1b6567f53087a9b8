"""Instant at which the gap becomes positive for the fifth time after a contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases import Mode
from crossbody.cases.contacts import contacts

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "s"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """The fifth return to FREE, s; the fifth release where the run has no modes."""
    exits = [e.t for e in run.events if e.after == Mode.FREE] or [c.release for c in contacts(run)]
    return exits[4] if len(exits) > 4 and np.isfinite(exits[4]) else None
