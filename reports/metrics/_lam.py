"""The multiplier of one row between the samples of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases import Mode
from crossbody.cases.arrays import Floats
from crossbody.reports.judging._between import between

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from crossbody.cases import Trajectory

PARTS = 16
"""Points looked at from each sample to the next."""


def told(run: Trajectory) -> NDArray[np.bool_] | None:
    """Which rows have multipliers (nc,); None if lam is not known.

    Of rows that are always on and follow from others lam is NaN from the first sample to the last.
    """
    unknown = np.isnan(run.lam)
    follow = unknown.all(axis=0) & np.all(run.mode == Mode.BILATERAL, axis=0)
    known = not unknown[:, ~follow].any() and not (follow.any() and follow.all())
    return ~follow if known else None


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
