"""Which smooth piece of a motion each instant belongs to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats


def pieces(starts: Floats, t: Floats) -> NDArray[np.intp]:
    """Index of the piece of each time (n,): before an end, and behind it if the time stands again.

    Args:
        starts: where the pieces begin, s, nondecreasing.
        t: nondecreasing times (n,), s.
    """
    again = np.concatenate(([False], t[1:] == t[:-1]))
    before = np.searchsorted(starts, t, side="left") - 1
    after = np.searchsorted(starts, t, side="right") - 1
    return np.clip(np.where(again, after, before), 0, None)
