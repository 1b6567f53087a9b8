"""Indices of coordinates, inputs and rows as they are given."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crossbody.cases import SceneError
from crossbody.cases.arrays import distinct
from crossbody.reference.kinds import Index


def different(where: str, given: Sequence[int], below: int) -> Index:
    """Return indices as an array.

    Raises:
        SceneError: if one comes twice, or lies outside of 0 .. below - 1.
    """
    found = np.asarray(given, dtype=np.int64)
    if np.any(found < 0) or np.any(found >= below) or len(distinct(found)) != len(found):
        raise SceneError(f"{where} is {found.tolist()}; valid: different ones below {below}.")
    return found
