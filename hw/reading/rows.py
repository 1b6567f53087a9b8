"""Some rows of a log on their way to SI, and signals with times of their own brought to them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import LogFormatError
from crossbody.cases.arrays import Floats


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


def join(path: Path, how: str, time: Floats, other: Rows, column: str) -> tuple[tuple[Floats, ...], int]:
    """Values (n,) of other rows at the times (n,), s, of a log; and how many lead without any.

    They are taken "exact", by "hold" or "linear", NaN where there are none; path and column are for
    messages.
    """
    back = np.flatnonzero(~(np.diff(other.time) > 0.0))
    if len(back):
        raise LogFormatError(path, "the times of its rows do not increase.", int(other.rows[back[0] + 1]), column)
    if how == "exact":
        return _exact(path, time, other, column), 0
    if how == "linear":
        values = tuple(np.interp(time, other.time, v, left=np.nan, right=np.nan) for v in other.values)
    else:
        at = np.searchsorted(other.time, time, side="right") - 1
        values = tuple(np.where(at >= 0, v[at], np.nan) for v in other.values)
    lead = int(np.searchsorted(time, other.time[0])) if len(other.time) else len(time)
    return values, lead


def _exact(path: Path, time: Floats, other: Rows, column: str) -> tuple[Floats, ...]:
    if len(time) != len(other.time) or not np.array_equal(time, other.time):
        n = min(len(time), len(other.time))
        row = int(np.argmax(np.append(time[:n] != other.time[:n], True)))
        text = 'has other times than the log; say `join = "hold"` (commands) or "linear" (smooth signals).'
        raise LogFormatError(path, text, row, column)
    return other.values
