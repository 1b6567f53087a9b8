"""A column map against one file: which group and column every signal is, and how it becomes SI."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crossbody.cases import InvalidValue, LogFormatError, UnknownName
from crossbody.cases.arrays import Floats
from crossbody.hw.formats import Column, Group, Reader
from crossbody.hw.reading.columns import Columns, Role, Signal
from crossbody.hw.reading.units import Conversion, to_si

ROTATES, MOVES, PURE = "rad", "m", "1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Where one signal comes from.

    Attributes:
        role, name: of the signal.
        signal: its entry in the map.
        group: the group that holds it.
        conversion: from the map's unit to SI.
        clock: the column of its times where they are not the log's; empty otherwise.
    """

    role: Role
    name: str
    signal: Signal
    group: Group
    conversion: Conversion
    clock: str = ""

    @property
    def label(self) -> str:
        """`role.name`."""
        return f"{self.role.value}.{self.name}"

    @property
    def range(self) -> tuple[float, float] | None:
        """Plausible values, SI."""
        if self.signal.range is None:
            return None
        low, high = self.conversion.apply(np.array(self.signal.range, dtype=np.float64))
        return float(low), float(high)

    def to_si(self, raw: Floats) -> Floats:
        """Stored numbers to SI; a step that changes nothing is left out, so that bits stay as they are."""
        values = raw.astype(np.float64, copy=False)
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is not finite, which a check tells
            values = values * self.signal.scale if self.signal.scale != 1.0 else values
            values = values + self.signal.offset if self.signal.offset else values
            return self.conversion.apply(-values if self.signal.sign < 0 else values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What to read.

    Attributes:
        path: the log.
        columns: the map.
        group: the group whose rows are the log's.
        sources: the signals in the order of the map.
        time_column: column of the times; empty if rows are counted.
        ticks: from the stored time to seconds.
        step, start: seconds a sample and time of the first, where samples are counted.
        told: whether map or file say in which unit the times are.
    """

    path: Path
    columns: Columns
    group: Group
    sources: tuple[Source, ...]
    time_column: str
    ticks: Conversion
    step: float
    start: float
    told: bool = True

    @property
    def own(self) -> tuple[Source, ...]:
        """Signals in the log's own rows."""
        return tuple(s for s in self.sources if s.group is self.group)

    @property
    def joined(self) -> tuple[Source, ...]:
        """Signals with times of their own."""
        return tuple(s for s in self.sources if s.group is not self.group)


def make_plan(path: Path, reader: Reader, columns: Columns) -> Plan:
    """Find every signal of a map in an open log."""
    found = _Finder(path, reader)
    time = columns.time
    groups = [found.column(time.column)[0]] if time.column else []
    groups += [found.column(s.column)[0] for _, _, s in columns.signals() if not s.time][:1]
    group = groups[0] if groups else found.column(next(columns.signals())[2].column)[0]
    counted = not time.column or time.unit == "sample"
    step = (time.sample_time or group.step) if counted else 0.0
    if counted and not step:
        raise LogFormatError(path, "has no column of times in the map and no `time.sample_time` that makes them.")
    ticks = Conversion(si="s", factor=1.0) if counted else found.ticks(time.column, time.unit)
    sources = tuple(found.source(role, name, signal, group) for role, name, signal in columns.signals())
    _check_kinds(path, sources)
    if columns.part and found.column(columns.part)[0] is not group:
        raise LogFormatError(path, "identifies the parts, but has other rows than the times.", column=columns.part)
    return Plan(
        path=path, columns=columns, group=group, sources=sources, time_column=time.column,
        ticks=ticks, step=step, start=group.start if not time.column else 0.0,
        told=counted or time.unit is not None or time.scale != 1.0 or bool(found.column(time.column)[1].unit),
    )  # fmt: skip


class _Finder:
    """Columns of an open log by name."""

    def __init__(self, path: Path, reader: Reader) -> None:
        self._path, self._refused = path, reader.refused
        self._columns = {column.name: (group, column) for group in reader.groups for column in group.columns}

    def column(self, name: str) -> tuple[Group, Column]:
        """Group and column of that name."""
        if name in self._columns:
            return self._columns[name]
        if name in self._refused:
            raise LogFormatError(self._path, f"{self._refused[name]}.", column=name)
        raise LogFormatError(self._path, str(UnknownName("column", name, self._columns)))

    def ticks(self, name: str, unit: str | None) -> Conversion:
        """Seconds in the unit of a column of times; a second where neither map nor file say."""
        found = self._conversion(self.column(name)[1], unit, "s")
        if found.si != "s":
            raise LogFormatError(self._path, f"measures [{found.si}], not time.", column=name)
        return found

    def source(self, role: Role, name: str, signal: Signal, main: Group) -> Source:
        """Where a signal comes from."""
        group, column = self.column(signal.column)
        if group is not main and not signal.time:
            text = f"has other rows than the times (group {group.name!r}); name its column of times by `time`."
            raise LogFormatError(self._path, text, column=signal.column)
        if signal.time and self.column(signal.time)[0] is not group:
            raise LogFormatError(self._path, f"has other rows than its times {signal.time!r}.", column=signal.column)
        # With scale or offset the map's unit is that of the result, not that of the stored number.
        plain = signal.scale == 1.0 and signal.offset == 0.0
        conversion = self._conversion(column, signal.unit, None, compare=plain)
        clock = signal.time if group is not main else ""
        return Source(role=role, name=name, signal=signal, group=group, conversion=conversion, clock=clock)

    def _conversion(self, column: Column, unit: str | None, default: str | None, compare: bool = True) -> Conversion:
        """The map's unit, which must not contradict the file's; the file's where the map says nothing."""
        told = self._told(column)
        if unit is None and told is None:
            if default is None:
                text = 'has no unit, neither in the file nor in the map: write `unit` ("1" for a pure number).'
                raise LogFormatError(self._path, text, column=column.name)
            return to_si(default)
        if unit is None or unit == "sample":
            return told or to_si("1")
        given = to_si(unit)
        if told is not None and compare and told != given:
            text = f"is in {column.unit!r} as the file says and in {unit!r} as the map says; one of them is wrong."
            raise LogFormatError(self._path, text, column=column.name)
        return given

    def _told(self, column: Column) -> Conversion | None:
        """The file's own unit, if it is one that can be understood."""
        if not column.unit:
            return None
        try:
            return to_si(column.unit)
        except InvalidValue:
            return None


def _check_kinds(path: Path, sources: Iterable[Source]) -> None:
    """A coordinate is an angle, a length or a pure number; its velocity is that per second."""
    coordinates = {s.name: s for s in sources if s.role is Role.COORDINATES}
    for source in sources:
        si, column = source.conversion.si, source.signal.column
        if source.role is Role.COORDINATES and si not in (ROTATES, MOVES, PURE):
            raise LogFormatError(path, f"{source.label} is in [{si}]; a coordinate is in rad, m or 1.", column=column)
        if source.role is Role.VELOCITIES:
            q = coordinates.get(source.name)
            wanted = [f"{q.conversion.si}/s"] if q else [f"{ROTATES}/s", f"{MOVES}/s", f"{PURE}/s"]
            if si not in wanted:
                text = f"{source.label} is in [{si}]; it must be in {' or '.join(wanted)}."
                raise LogFormatError(path, text, column=column)
