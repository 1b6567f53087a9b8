"""Some rows of a log on their way to SI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Consecutive rows of a log.

    Attributes:
        rows (k,): their numbers in the file, from 0.
        time (k,): s.
        values: of every signal (k,), SI, in the order of the map.
    """

    rows: NDArray[np.int64]
    time: Floats
    values: tuple[Floats, ...]

    def take(self, which: NDArray[np.bool_] | slice) -> Rows:
        """Some of the rows."""
        return Rows(rows=self.rows[which], time=self.time[which], values=tuple(v[which] for v in self.values))
