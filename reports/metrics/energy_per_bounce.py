"""Energy gained from one release to the next, mean over all bounces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases.contacts import at, contacts

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "J"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Mean gain of total energy per contact that ended, J; None where none did."""
    energy = run.total_energy
    ended = [c.release for c in contacts(run) if np.isfinite(c.release)]
    return (at(run, energy, ended[-1]) - float(energy[0])) / len(ended) if ended else None
