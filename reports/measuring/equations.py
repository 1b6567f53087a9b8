"""The reference's equations of a case, for what is recomputed from a run's own states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, CaseUnsupported, Trajectory
from crossbody.cases.remembered import remembered

if TYPE_CHECKING:
    from crossbody.reference import System

SAMPLES = 400


@remembered(4)
def equations(case: Case) -> System | None:
    """The mechanism with the law of its rows; None where the reference has none."""
    from crossbody.engines.equations import system_of  # numba, which a page does without

    try:
        return system_of(case)
    except CaseUnsupported:
        return None


def finite(run: Trajectory) -> bool:
    """Whether every recorded state is a number, so that equations can be asked about it."""
    return bool(np.isfinite(run.q).all() and np.isfinite(run.v).all())


def spread(run: Trajectory, among: NDArray[np.bool_] | None = None) -> NDArray[np.intp]:
    """Indices of at most `SAMPLES` samples, evenly spread; of those true in `among` (n,), if given."""
    some = np.arange(len(run.t)) if among is None else np.flatnonzero(among)
    return some[:: -(-len(some) // SAMPLES) or 1]
