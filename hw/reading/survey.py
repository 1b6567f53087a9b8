"""What is in a file that nobody has described: channels, rates, gaps, ranges, a draft of a column map."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from crossbody.cases import InvalidValue, LogFormatError, arguments
from crossbody.cases.arrays import Floats
from crossbody.hw import formats
from crossbody.hw.checks.clock import ClockCheck
from crossbody.hw.checks.finding import Finding
from crossbody.hw.checks.values import ValueCheck
from crossbody.hw.formats import Column, Group, Reader
from crossbody.hw.reading.clock_guess import ClockGuess, guess_clock, last_word, looks_like_time
from crossbody.hw.reading.columns import Columns, Role, Signal, Time, dump_columns, load_columns, maps, safe_name
from crossbody.hw.reading.units import to_si

PATTERNS = (
    (Role.VELOCITIES, r"(v|w|dq|qd|dth|vel|velocity|omega|rate|speed)\w{0,3}(\[\d+\])?"),
    (Role.COORDINATES, r"(q|th|theta|phi|angle|pos|position|enc|encoder)\w{0,3}(\[\d+\])?|[xyz]\d?|p[xyz]"),
    (Role.INPUTS, r"(u|tau|torque|cmd|command|effort)\w{0,3}(\[\d+\])?"),
    (Role.REFERENCES, r"(r|ref|reference|target|setpoint|des|desired)\w{0,3}(\[\d+\])?"),
)
UNITS = (
    (Role.COORDINATES, "1", r"q[wxyz]"),  # of a quaternion
    (Role.COORDINATES, "m", r"[xyz]\d?|p[xyz]"),
    (Role.VELOCITIES, "m/s", r"v[xyz]"),
)
"""Units of what only bodies in space have, by their names."""
USUAL = {Role.COORDINATES: "rad", Role.VELOCITIES: "rad/s", Role.INPUTS: "N m", Role.REFERENCES: "1", Role.SENSORS: "1"}
ADMITTED = {Role.COORDINATES: ("rad", "m", "1"), Role.VELOCITIES: ("rad/s", "m/s", "1/s")}


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnSurvey:
    """One column as it stands in the file.

    Attributes:
        column: name, stored type and unit.
        low, high: smallest and largest finite value; NaN if there is none.
        missing: cells that are not finite.
    """

    column: Column
    low: float
    high: float
    missing: int


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupSurvey:
    """Columns whose rows belong together.

    Attributes:
        group: as the reader tells it.
        rows: number of rows.
        clock: the column that seems to hold the times.
        duration: from the first to the last time, s; NaN without a clock.
        step: median time between the first samples, s.
        longest: longest time between samples, s.
        lost: samples that seem to be missing.
        jitter: scatter of the sample times about a steady clock, s.
        columns: of the group, in the order of the file.
    """

    group: Group
    rows: int
    clock: ClockGuess | None
    duration: float
    step: float
    longest: float
    lost: int
    jitter: float
    columns: tuple[ColumnSurvey, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """What a file holds.

    Attributes:
        path: the file.
        format: name of its format.
        library: package that reads it, with its version.
        groups: what is in it.
        refused: columns that are no numbers -> why.
        findings: doubts about it; faults first.
        options: what the format was told by a map.
    """

    path: Path
    format: str
    library: str
    groups: tuple[GroupSurvey, ...]
    refused: dict[str, str]
    findings: tuple[Finding, ...]
    options: Mapping[str, Any] = field(default_factory=dict)

    def draft(self) -> Columns:
        """A column map to begin with: roles and missing units are guessed from names."""
        return draft(self)

    def refuse(self) -> None:
        """Raise the first fault that was found, if there is one."""
        for finding in self.findings:
            if finding.fault:
                raise finding.error(self.path)


def survey(path: str | Path, columns: Columns | str | Path | None = None, *, memory: int = formats.MEMORY) -> Survey:
    """Go through a file once, in bounded memory; a column map is not needed.

    Args:
        path: file of any format of `formats.names()`, or the folder of a ROS 2 bag.
        columns: a map whose `format` and `options` (delimiter, decimal mark, encoding, ...) the
            file is read by.
        memory: as for `read`.

    Raises:
        LogFormatError: if it cannot be read.
        FormatUnavailable: if the format's package is not installed.
        ColumnMapError: for a map that cannot be followed.
    """
    path = Path(arguments.path("log", path))
    chosen = columns if columns is None or isinstance(columns, Columns) else load_columns(columns)
    name = (chosen.format if chosen else None) or formats.recognise(path)
    reader = formats.open_log(path, name, formats.options(name, chosen.options) if chosen else None, memory)
    try:
        refused, findings = dict(reader.refused), list[Finding]()
        groups = tuple(_group(reader, group, refused, findings) for group in reader.groups)
        if not any(group.rows for group in groups):
            why = next((f" ({column}: {text})" for column, text in refused.items()), "")
            raise LogFormatError(path, f"holds no samples{why}.")
    finally:
        reader.close()
    found = tuple(sorted(findings, key=lambda f: (not f.fault, f.row)))
    return Survey(
        path=path, format=name, library=reader.library, groups=groups, refused=refused, findings=found,
        options=chosen.options if chosen else {},
    )  # fmt: skip


def _group(reader: Reader, group: Group, refused: dict[str, str], findings: list[Finding]) -> GroupSurvey:
    columns = [c for c in group.columns if _numeric(reader, group, c, refused, findings)]
    checks = {c.name: ValueCheck(c.name, c.unit or "?") for c in columns}
    clock, check, rows = None, ClockCheck(group.step or None), 0
    for block in reader.blocks(group, list(checks)) if checks else ():
        size = len(next(iter(block.values())))
        at = np.arange(rows, rows + size, dtype=np.int64)
        clock = guess_clock(columns, block) if not rows else clock
        with np.errstate(over="ignore", invalid="ignore"):
            times = _times(clock, group, block, at)
            if clock is not None or group.step:
                check.see(at, times)
            for name, one in checks.items():
                one.see(at, times, block[name].astype(np.float64))
        rows += size
    findings += check.findings() if clock else []
    findings += [f for one in checks.values() for f in one.findings() if f.channel != (clock.column if clock else "")]
    known = clock is not None or group.step > 0.0
    return GroupSurvey(
        group=group, rows=rows, clock=clock, duration=check.end - check.start if known and rows else np.nan,
        step=check.step if known else np.nan, longest=check.longest, lost=check.missing,
        jitter=check.jitter if known else np.nan, columns=tuple(_column(c, checks[c.name]) for c in columns),
    )  # fmt: skip


def _times(clock: ClockGuess | None, group: Group, block: formats.Block, rows: NDArray[np.int64]) -> Floats:
    if clock is None:
        return np.full(len(rows), np.nan) if not group.step else group.start + group.step * rows.astype(np.float64)
    return clock.seconds(block[clock.column])


def _numeric(reader: Reader, group: Group, column: Column, refused: dict[str, str], findings: list[Finding]) -> bool:
    """Whether a column is one of numbers; a text column that begins as numbers is a fault with its place."""
    if column.type != "text":
        return True
    try:
        for _ in reader.blocks(group, [column.name]):
            pass
    except LogFormatError as error:
        refused[column.name] = "holds text, not numbers"
        if error.row == 0:
            refused[column.name] = str(error).rpartition("row 0: ")[2].rstrip(".")
        if error.row:
            text = str(error).rpartition(f"row {error.row}: ")[2]
            findings.append(
                Finding(
                    check="finite", fault=True, channel=error.column, row=error.row, t=np.nan, count=1, text=text
                )
            )  # fmt: skip
        return False
    return True


def _column(column: Column, check: ValueCheck) -> ColumnSurvey:
    low, high = (check.runs.low, check.runs.high) if check.runs.low <= check.runs.high else (np.nan, np.nan)
    return ColumnSurvey(column=column, low=low, high=high, missing=check.missing)


def largest(groups: Sequence[GroupSurvey]) -> GroupSurvey:
    """The group to begin with: one that has a clock, then the one with most numbers."""
    return max(groups, key=lambda g: (g.clock is not None or g.group.step > 0.0, g.rows * len(g.columns)))


def draft(found: Survey) -> Columns:
    """A map that reads what was surveyed; see `Survey.draft`."""
    main = largest(arguments.instance("found", found, Survey, "what `survey` found").groups)
    unit = main.clock.unit if main.clock else None
    tables: dict[str, dict[str, Signal]] = {role.value: {} for role in Role}
    for group in (main, *(g for g in found.groups if g is not main and g.clock and g.clock.unit == unit)):
        for one in group.columns:
            if not looks_like_time(one.column.name) and not (group.clock and one.column.name == group.clock.column):
                _add(tables, one.column, group, group is main)
    step = None if main.clock or main.group.step else 1.0
    time = Time(column=main.clock.column if main.clock else "", unit=unit, sample_time=step)
    joined = any(signal.time for table in tables.values() for signal in table.values())
    how: Literal["hold", "exact"] = "hold" if joined else "exact"
    columns = Columns(format=found.format, options=dict(found.options), join=how, time=time)
    return msgspec.structs.replace(columns, **tables)


def _add(tables: dict[str, dict[str, Signal]], column: Column, group: GroupSurvey, own: bool) -> None:
    unit, word = _si(column), last_word(column.name)
    role = next((role for role, pattern in PATTERNS if re.fullmatch(pattern, word)), Role.SENSORS)
    if unit is not None and unit not in ADMITTED.get(role, (unit,)):
        role = Role.SENSORS
    table = tables[role.value]
    name = safe_name(word + "".join(re.findall(r"\[\d+\]$", column.name)))
    if name in table:
        name = safe_name(column.name)
    while name in table:
        name += "_"
    clock = "" if own or group.clock is None else group.clock.column
    guess = next((one for kind, one, pattern in UNITS if kind == role and re.fullmatch(pattern, word)), USUAL[role])
    table[name] = Signal(column=column.name, unit=None if unit is not None else guess, time=clock)


def _si(column: Column) -> str | None:
    """SI unit of what the file calls the column's unit; None if it says nothing that can be understood."""
    try:
        return to_si(column.unit).si if column.unit else None
    except InvalidValue:
        return None


def draft_text(found: Survey) -> str:
    """The draft as TOML; what the file does not tell, and was guessed, is marked in its line."""
    columns = draft(found)
    head, *signals = re.split(r"(?m)^(?=\[(?!time|options))", dump_columns(columns))
    marked = [re.sub(r"(?m)^(unit = .*)$", r"\1 # guessed from the name: check", one) for one in signals]
    lines = ["# Draft: roles and names are guessed from the columns' names; check every line."]
    if columns.time.sample_time is not None:
        lines.append("# No column of times was found: set the sample time, s.")
        head = re.sub(r"(?m)^(sample_time = .*)$", r"\1 # no measurement: set it", head)
    if fits := fitting(found):
        lines.append(f"# All columns of a map that comes with crossbody are here: {', '.join(fits)} (--columns).")
    return "\n".join([*lines, head + "".join(marked)])


def fitting(found: Survey) -> list[str]:
    """Names of the `maps` all of whose columns a file has."""
    there = {one.column.name for group in found.groups for one in group.columns}
    return [
        name for name in maps() for one in (load_columns(name),)
        if {one.time.column, *(signal.column for _, _, signal in one.signals())} - {""} <= there
    ]  # fmt: skip
