"""Recorded energies against those of the recorded state, over the largest: an identity at every sample."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.measuring.equations import equations, finite, spread

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max over kinetic and potential energy of |E - E(q, v)| / max |E(q, v)|, at most 400 samples.

    None where the case has no equations, or those no energy.
    """
    system = equations(case)
    if system is None or system.energy is None:
        return None
    if not finite(run):
        return math.nan
    some = spread(run)
    wanted = np.zeros((len(some), 2))
    for row, q, v in zip(wanted, run.q[some], run.v[some], strict=True):
        system.energy(np.array(q), np.array(v), np.array(system.p), row)
    scale = np.max(np.abs(wanted), axis=0)
    off = np.max(np.abs(run.energy[some] - wanted), axis=0)
    return float(np.max(off / np.where(scale > 0.0, scale, 1.0)))
