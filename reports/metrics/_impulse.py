"""Impulse of the multipliers."""

from __future__ import annotations

import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.cases._trajectory import Trajectory


def cumulative(run: Trajectory, t: Floats | None = None) -> Floats:
    """INT lam dt by the trapezoidal rule (n, nc), N s.

    Args:
        run: its multipliers.
        t: other instants of the samples than the run's own.
    """
    t = run.t if t is None else t
    pieces = 0.5 * np.diff(t)[:, None] * (run.lam[1:] + run.lam[:-1])
    total: Floats = np.concatenate([np.zeros((1, run.lam.shape[1])), np.cumsum(pieces, axis=0)])
    return total
