"""The multiplier of one row between the samples of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.reports.judging._between import between

if TYPE_CHECKING:
    from crossbody.cases import Trajectory

PARTS = 16
"""Points looked at from each sample to the next."""


def multipliers(run: Trajectory) -> Floats | None:
    """Lam (m, nc) at the samples and between them, by splines that never cross an event; None if lam is not known."""
    if np.isnan(run.lam).any():
        return None
    cuts = np.linspace(0.0, 1.0, PARTS, endpoint=False)
    inside = run.t[:-1, None] + np.diff(run.t)[:, None] * cuts
    return np.concatenate([run.lam, between(run)(np.unique(inside)).lam])


def peak(run: Trajectory, row: int) -> float | None:
    """Largest multiplier of one row, N; None if it is not known or there is no such row."""
    lam = multipliers(run) if row < run.lam.shape[1] else None
    return None if lam is None else float(lam[:, row].max())
