"""Energy that the contact law made by switching rows on and off, over the largest kinetic energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.reports.measuring.switching import made

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Sum of the jumps of 1/2 a0 h_A^T G_A^-1 h_A / max T of the truth; None where there is no such potential."""
    scale = float(truth.trajectory.energy[:, 0].max())
    jumps = made(run, case)
    return None if jumps is None or scale == 0.0 else jumps / scale
