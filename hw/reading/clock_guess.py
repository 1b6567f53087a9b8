"""Which column of a file seems to hold the times."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import InvalidValue
from crossbody.cases.arrays import Floats
from crossbody.hw.formats import Block, Column
from crossbody.hw.reading.units import is_time, to_si

NAMES = ("t", "time", "stamp", "timestamp", "log_time", "times", "seconds", "sec", "elapsed", "clock", "publish_time")
EARLY = 1000  # times that tell the unit
TICKS = (("ns", 3e4), ("us", 100.0))  # step from which on times are no seconds but these
SUFFIX = re.compile(r"[_\s](ns|us|ms|s)$")


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockGuess:
    """A column of times.

    Attributes:
        column: its name.
        unit: its unit; the file's, or guessed from its name, or "s".
        origin: what is taken off integers, in their own ticks.
    """

    column: str
    unit: str
    origin: int = 0

    def seconds(self, raw: NDArray[Any]) -> Floats:
        """Stored times to seconds since the origin."""
        since = raw - np.asarray(self.origin, dtype=raw.dtype) if self.origin else raw
        return to_si(self.unit).apply(since.astype(np.float64))


def last_word(name: str) -> str:
    """The last part of a column's name, without its unit: `/rig.header.stamp` is `stamp`."""
    return re.split(r"[./]", re.sub(r"\s*[\[(].*$", "", name))[-1].strip().lower()


def looks_like_time(name: str) -> bool:
    """Whether a column is named as times are."""
    return SUFFIX.sub("", last_word(name)) in NAMES


def guess_clock(columns: Sequence[Column], block: Block) -> ClockGuess | None:
    """The column of times, judged by names first and by the first block; None if none seems to be one."""
    named = [c for c in columns if looks_like_time(c.name)]
    named.sort(key=lambda column: NAMES.index(SUFFIX.sub("", last_word(column.name))))
    for column in [*named, *(c for c in columns if c not in named and _is_time(c.unit))]:
        if block[column.name].dtype.kind in "iuf":
            return _guess(column, block[column.name])
    return None


def _guess(column: Column, raw: NDArray[Any]) -> ClockGuess:
    suffix = SUFFIX.search(last_word(column.name))
    told = column.unit if _is_time(column.unit) else suffix.group(1) if suffix else ""
    unit = told or unit_of_ticks(raw)
    origin = int(raw[0]) if raw.dtype.kind in "iu" and len(raw) and abs(int(raw[0])) > 2**53 else 0
    return ClockGuess(column=column.name, unit=unit, origin=origin)


def unit_of_ticks(raw: NDArray[Any]) -> str:
    """The unit that times without one seem to be in: seconds, unless steps would be minutes."""
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(raw[:EARLY].astype(np.float64))  # what a float64 leaves of a large integer tells its size
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    usual = float(np.median(steps)) if len(steps) else 0.0
    return next((unit for unit, least in TICKS if usual >= least), "s")


def _is_time(unit: str) -> bool:
    try:
        return bool(unit) and is_time(unit)
    except InvalidValue:
        return False
