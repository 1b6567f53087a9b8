"""Rows of a log in SI, a bounded number at a time or all, and signals of other times brought to them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import LogFormatError
from crossbody.cases.arrays import Floats
from crossbody.hw.budget import current
from crossbody.hw.formats import Group, Reader
from crossbody.hw.reading.clock_guess import unit_of_ticks
from crossbody.hw.reading.plan import Plan, Source

EXACT = 2**53  # beyond, an integer is no float64
FIRST = 65536  # rows, where nobody tells how many there will be


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
        text = 'has other times than the log; set `join = "hold"` (commands) or "linear" (smooth signals).'
        raise LogFormatError(path, text, row, column)
    return other.values


class Stream:
    """The blocks of one plan, or of one run in it; `origin` is known once the first is there."""

    def __init__(self, plan: Plan, reader: Reader, part: int | None = None) -> None:
        self.plan, self.origin = plan, 0
        self._reader, self._part = reader, part
        self._begun = False

    def rows(self) -> Iterator[Rows]:
        """The log's own rows with the signals that stand in them."""
        plan = self.plan
        own = list(plan.own)
        extra = [plan.columns.part] if plan.columns.part else []
        counted = 0
        for start, block in self._blocks(plan.group, own, [plan.time_column, *extra]):
            size = len(next(iter(block.values())))
            rows = np.arange(start, start + size, dtype=np.int64)
            kept = block[extra[0]] == self._part if extra and self._part is not None else slice(None)
            rows = rows[kept]
            time = self._time(block, kept, counted, len(rows))
            counted += len(rows)
            current(plan.path).hold(8 * len(rows) * len(own), f"one block of {len(own)} signals")
            yield Rows(rows=rows, time=time, values=tuple(s.to_si(block[s.signal.column][kept]) for s in own))

    def _time(self, block: dict[str, NDArray[Any]], kept: Any, counted: int, size: int) -> Floats:
        plan = self.plan
        if not plan.time_column:
            return plan.start + plan.step * np.arange(counted, counted + size, dtype=np.float64)
        return self.seconds(block[plan.time_column][kept], plan.time_column)

    def seconds(self, raw: NDArray[Any], column: str) -> Floats:
        """Stored times to seconds; integers that no float64 holds count from the log's first."""
        unit = unit_of_ticks(raw) if not self.plan.told and not self._begun else "s"
        if unit != "s":
            step = float(np.median(np.abs(np.diff(raw[:1000].astype(np.float64)))))
            text = f'has steps of {step:.3g} and no unit: as seconds, no rig\'s. Write `unit` ("{unit}"?) for it.'
            raise LogFormatError(self.plan.path, text, column=column)
        if raw.dtype.kind in "iu":
            if not self._begun and len(raw):
                self._begun = True
                self.origin = int(raw[0]) if abs(int(raw[0])) > EXACT else 0
            raw = raw - np.asarray(self.origin, dtype=raw.dtype) if self.origin else raw
        elif raw.dtype.kind not in "f":
            raise LogFormatError(self.plan.path, f"holds {raw.dtype}, not times.", column=column)
        times: Floats = raw.astype(np.float64, copy=False)
        scale = self.plan.columns.time.scale
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is not finite, which a check tells
            times = times * scale if scale != 1.0 else times
            return times * self.plan.step if self.plan.step else self.plan.ticks.apply(times)

    def joined(self, sources: Sequence[Source]) -> Iterator[Rows]:
        """Rows of signals with times of their own, all of one group and clock; after `rows` has begun."""
        clock = sources[0].clock
        for start, block in self._blocks(sources[0].group, sources, [clock]):
            times = self.seconds(block[clock], clock)
            rows = np.arange(start, start + len(times), dtype=np.int64)
            yield Rows(rows=rows, time=times, values=tuple(s.to_si(block[s.signal.column]) for s in sources))

    def _blocks(
        self, group: Group, sources: Sequence[Source], extra: Sequence[str]
    ) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
        names = list(dict.fromkeys([name for name in extra if name] + [s.signal.column for s in sources]))
        start = 0
        for block in self._reader.blocks(group, names):
            yield start, block
            start += len(block[names[0]])

    def parts(self) -> tuple[int, ...]:
        """Numbers of the runs in the file, in the order of their size."""
        column = self.plan.columns.part
        found: set[int] = set()
        for _, block in self._blocks(self.plan.group, (), [column]):
            if block[column].dtype.kind not in "iuf" or not np.all(block[column] == np.rint(block[column])):
                raise LogFormatError(
                    self.plan.path, "does not contain whole numbers, so it cannot separate runs.", column=column
                )
            found.update(np.unique(block[column]).astype(int).tolist())
        return tuple(sorted(found))


def collect(blocks: Iterable[Rows], plan: Plan, group: Group, limit: int) -> Rows:
    """Join blocks up to `limit` bytes, filling arrays in place: little more than the result is ever in memory."""
    announced = 0 if plan.columns.part else group.rows or 0
    held: tuple[NDArray[Any], ...] = ()
    size = 0
    for block in blocks:
        parts = (block.rows, block.time, *block.values)
        width = sum(part.itemsize for part in parts)
        need = max(announced, size + len(block.time))
        if need * width > limit:
            text = f"needs {need * width / 1e9:.3g} GB in memory, above the limit of {limit / 1e9:.3g} GB; `scan` it."
            raise LogFormatError(plan.path, text)
        if not held or need > len(held[0]):
            room = max(need, limit // width - size)  # while rows are moved, the old arrays are there too
            held = _grown(held, parts, size, max(need, min(room, max(2 * size, 0 if announced else FIRST))))
        for whole, part in zip(held, parts, strict=True):
            whole[size : size + len(part)] = part
        size += len(block.time)
    if not size:
        raise LogFormatError(plan.path, "holds no samples.")
    rows, time, *values = (whole[:size] for whole in held)
    return Rows(rows=rows, time=time, values=tuple(values))


def _grown(
    held: tuple[NDArray[Any], ...], parts: tuple[NDArray[Any], ...], size: int, rows: int
) -> tuple[NDArray[Any], ...]:
    grown = tuple(np.empty(rows, part.dtype) for part in parts)
    for new, old in zip(grown, held, strict=False):
        new[:size] = old[:size]
    return grown
