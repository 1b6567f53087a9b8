"""Energy that a contact law makes where rows are switched (docs/explanation/model.md).

With one a0 the active rows A have the potential 1/2 a0 h_A^T G_A^-1 h_A, G = H M^-1 H^T. Another
set of rows at the same state has another one, and lam books the difference:

    jump = 1/2 a0 (h_B^T G_B^-1 h_B - h_A^T G_A^-1 h_A)                 from the set A to the set B

Switching on a row j at h_j = 0 gives 1/2 a0 h_A^T [(G_(A+j)^-1)_AA - G_A^-1] h_A >= 0; a row that
lets go where its lam vanishes gives 0. Unequal a0 have no potential: there is no such number. The
sum is all that the law makes where G is constant; where G depends on q lam does work besides,
O(a0^-1/2) of it: a contact moves q by speed/sqrt(a0).
"""

from __future__ import annotations

import math
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.contacts import CLOSED
from crossbody.engines.equations import system_of

DEPENDENT = 1e-10
"""Singular value of G, over the largest, below which rows depend: the corners of a box share its weight."""


def made(run: Trajectory, case: Case) -> float | None:
    """Sum of the jumps over all instants at which rows are switched, J; NaN if the motion is not finite.

    None where the law has no such potential (unequal a0, a cubic term), where rows are always on
    or collide in no time, and where the run knows no modes.
    """
    law = case.law
    frozen = case.collisions != "resolved" and bool(law.b0.any())
    if frozen or not law.unilateral.all() or not len(law.a0) or not law.linear or np.ptp(law.a0) > 0.0:
        return None
    if (run.mode < 0).any() or case.inputs is not None:
        return None
    if not np.isfinite(run.q).all():
        return math.nan
    system = system_of(case)
    total, on = 0.0, np.zeros(len(law.a0), dtype=bool)
    for t, events in groupby(run.events, key=lambda event: event.t):
        q = np.array([np.interp(t, run.t, column) for column in run.q.T])
        before = potential(system, q, on)
        for event in events:
            on[event.contact] = event.after in CLOSED
        total += potential(system, q, on) - before
    return total


def potential(system: Any, q: Floats, on: NDArray[np.bool_]) -> float:
    """1/2 a0 h_A^T G_A^-1 h_A of the rows that are on, J; of rows that depend on each other the pseudoinverse.

    Args:
        system: the mechanism, all rows with one a0.
        q (n,): positions.
        on (nc,): the active rows.
    """
    if not on.any():
        return 0.0
    H, h = (part[on] for part in system.constraint(q)[:2])
    G = H @ np.linalg.solve(system.mass_matrix(q), H.T)
    return 0.5 * float(system.alpha[0, 0]) * float(h @ np.linalg.lstsq(G, h, rcond=DEPENDENT)[0])


def parted(run: Trajectory) -> bool:
    """Whether nothing pushes at the end."""
    return not np.isin(run.mode[-1], CLOSED).any()
