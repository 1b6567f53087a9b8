"""Which multipliers a run shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases import Mode

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from crossbody.cases import Trajectory


def told(run: Trajectory) -> NDArray[np.bool_] | None:
    """Which rows have multipliers (nc,); None if lam is not known.

    Of rows that are always on and follow from others lam is NaN from the first sample to the last.
    """
    unknown = np.isnan(run.lam)
    follow = unknown.all(axis=0) & np.all(run.mode == Mode.BILATERAL, axis=0)
    known = not unknown[:, ~follow].any() and not (follow.any() and follow.all())
    return ~follow if known else None
