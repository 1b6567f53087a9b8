"""From a file to a `Log`: open, plan, stream, repair, check, freeze."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from crossbody.cases import InvalidValue, LogFormatError, arguments
from crossbody.cases.arrays import Floats
from crossbody.hw import formats
from crossbody.hw.checks.finding import Finding
from crossbody.hw.reading import repair as _repair
from crossbody.hw.reading import store as _store
from crossbody.hw.reading.checks import Checks
from crossbody.hw.reading.columns import Columns, Role, dump_columns, load_columns
from crossbody.hw.reading.log import Channel, Log, Provenance, Repair
from crossbody.hw.reading.plan import ROTATES, Plan, Source, make_plan
from crossbody.hw.reading.stream import Rows, Stream, collect, join


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """An open log, to be gone through once.

    Attributes:
        plan: what is read.
        stream: its blocks.
        checks: what they are checked by, as far as they have been seen.
        library: package that reads.
        format: name of the format.
        limit: bytes that its numbers may take in memory.
    """

    plan: Plan
    stream: Stream
    checks: Checks
    library: str
    format: str
    limit: int

    def rows(self) -> Iterator[Rows]:
        """Blocks of rows in SI, checked as they pass."""
        for block in self.stream.rows():
            self.checks.see(block)
            yield block


@contextmanager
def scan(
    path: str | Path, columns: Columns | str | Path | None = None, part: int | None = None, *,
    memory: int = formats.MEMORY,
) -> Iterator[Scan]:  # fmt: skip
    """Open a log to go through it in bounded memory, however long it is.

    Args:
        path: as for `read`.
        columns: as for `read`; signals with times of their own are not possible here.
        part: as for `read`.
        memory: as for `read`.

    Raises:
        ColumnMapError, LogFormatError, FormatUnavailable, UnknownName: as `read`.
    """
    with _opened(path, columns, part, memory) as found:
        for source in found.plan.joined:
            text = "has other rows than the times; only `read` joins them."
            raise LogFormatError(path, text, column=source.signal.column)
        yield found


@contextmanager
def _opened(
    log: str | Path, columns: Columns | str | Path | None, part: int | None, memory: int
) -> Iterator[Scan]:  # fmt: skip
    path = Path(arguments.path("log", log))
    if part is not None:
        arguments.instance("part", part, int, "a whole number")
    chosen = _store.columns_of(path) if columns is None else columns
    chosen = chosen if isinstance(chosen, Columns) else load_columns(chosen)
    if (part is None) != (not chosen.part):
        hint = "it has one run only" if part is not None else "name one, see `parts`"
        raise InvalidValue(f"part is {part} and the map's `part` {chosen.part!r}: {hint}.")
    name = chosen.format or formats.recognise(path)
    options = formats.options(name, chosen.options)
    reader = formats.open_log(path, name, options, memory)
    try:
        plan = make_plan(path, reader, chosen)
        checks = Checks(plan.own, chosen.time.sample_time)
        yield Scan(
            plan=plan, stream=Stream(plan, reader, part), checks=checks, library=reader.library, format=name,
            limit=reader.budget.memory,
        )  # fmt: skip
    finally:
        reader.close()


def read(
    path: str | Path, columns: Columns | str | Path | None = None, *, part: int | None = None,
    repair: Collection[str] = (), limit: int | None = None, memory: int = formats.MEMORY,
) -> Log:  # fmt: skip
    """Read a log.

    Args:
        path: file of any format of `formats.names()`, or the folder of a ROS 2 bag.
        columns: the column map: its file, a name of `maps()`, or itself; not needed for a log
            that `store` wrote.
        part: number of the run, where the map names a column that tells several apart.
        repair: any of "drop_duplicates" (rows with the time of the row before), "fill_dropped"
            (samples that are missing: measured signals linearly, commanded ones held) and "unwrap"
            (coordinates in rad that jump by whole turns); what was done is in the provenance.
        limit: largest size of all its numbers in memory, bytes; what `memory` admits if not given.
        memory: bytes over the file's own size that reading may take; a file that unfolds to more is refused.

    Returns:
        The log in SI: times strictly increasing, all values finite.

    Raises:
        ColumnMapError: for a map that cannot be followed, with the path of the key.
        LogFormatError: for a log that cannot be read or trusted, with row and column of the first offence.
        FormatUnavailable: if the format's package is not installed; the message names the extra.
        UnknownName: for a repair that does not exist.
        InvalidValue: if the map tells runs apart and none was named, or the reverse; for repairs
            of a stored log.
    """
    path = Path(arguments.path("log", path))
    if limit is not None:
        arguments.real("limit", limit)
    if columns is not None and not isinstance(columns, Columns):
        arguments.path("columns", columns)
    if isinstance(repair, np.ndarray) or not isinstance(repair, Collection):
        raise InvalidValue(f"repair is {arguments.shown(repair)}; it must be a list of repairs.")
    _repair.check_names(repair)
    stored = _store.about(Path(path)) if columns is None else None
    if stored is not None and repair:
        raise InvalidValue(f"{path} is a stored log, which is never repaired; repair {stored.provenance.file} instead.")
    with _opened(path, columns, part, memory) as found:
        plan = found.plan
        block, repairs, checks = _gather(found, repair, found.limit if limit is None else limit)
        step = plan.columns.time.sample_time or plan.step or checks.clock.step
        made = np.zeros(0, np.int64)
        count = len(block.time)
        if "fill_dropped" in repair:
            block, filled, made = _repair.fill_dropped(block, [s.role for s in plan.sources], step)
            repairs += filled
    told = Provenance(
        file=str(path), sha256=_store.file_hash(Path(path)), format=found.format, library=found.library,
        columns=dump_columns(plan.columns), part=part, rows=count, origin=found.stream.origin,
        join=plan.columns.join if plan.joined else "", repairs=repairs, synthetic=plan.columns.synthetic,
        about=plan.columns.about,
    )  # fmt: skip
    channels = tuple(_channel(s, v) for s, v in zip(plan.sources, block.values, strict=True))
    log = Log(
        time=block.time, channels=channels, sample_time=step, provenance=told,
        findings=checks.findings(), filled=made,
    )  # fmt: skip
    return log if stored is None else _store.verified(log, stored)


def _gather(found: Scan, repair: Collection[str], limit: int) -> tuple[Rows, tuple[Repair, ...], Checks]:
    """All rows in memory, without duplicates if that was asked for, checked, and joined."""
    plan = found.plan
    block = collect(found.stream.rows(), plan, plan.group, limit)
    repairs: tuple[Repair, ...] = ()
    if "drop_duplicates" in repair:
        block, repairs = _repair.drop_duplicates(block)
    if "unwrap" in repair:
        block, unwrapped = _repair.unwrap(block, _angles(plan.own))
        repairs += unwrapped
    checks = _checked(plan, plan.own, block)
    if plan.joined:
        block, joined = _joined(found, block, limit, unwrap="unwrap" in repair)
        repairs += joined
        checks = _checked(plan, plan.sources, block)
    return block, repairs, checks


def _angles(sources: Sequence[Source]) -> list[int]:
    """Indices of the coordinates in rad."""
    return [i for i, s in enumerate(sources) if s.role is Role.COORDINATES and s.conversion.si == ROTATES]


def _checked(plan: Plan, sources: Sequence[Source], block: Rows) -> Checks:
    """The checks, after they have seen all rows and refused none."""
    checks = Checks(sources, plan.columns.time.sample_time)
    for start in range(0, len(block.time), formats.BLOCK_ROWS):
        checks.see(block.take(slice(start, start + formats.BLOCK_ROWS)))
    checks.refuse(plan.path)
    return checks


def _joined(found: Scan, block: Rows, limit: int, *, unwrap: bool) -> tuple[Rows, tuple[Repair, ...]]:
    """Rows with the signals of times of their own, without the leading rows that lack one of them."""
    plan, lead, repairs = found.plan, 0, tuple[Repair, ...]()
    values: dict[str, Floats] = {s.label: v for s, v in zip(plan.own, block.values, strict=True)}
    for _, group in groupby(sorted(plan.joined, key=_clock), key=_clock):
        sources = list(group)
        other = collect(found.stream.joined(sources), plan, sources[0].group, limit)
        other, unwrapped = _over_turns(plan, sources, other, unwrap)
        repairs += unwrapped
        got, late = join(plan.path, plan.columns.join, block.time, other, sources[0].signal.column)
        lead = max(lead, late)
        values |= {s.label: v for s, v in zip(sources, got, strict=True)}
    whole = Rows(rows=block.rows, time=block.time, values=tuple(values[s.label] for s in plan.sources))
    trim = Repair(name="trim", rows=lead, row=int(block.rows[0]), t=float(block.time[0]))
    return whole.take(slice(lead, None)), (*repairs, trim) if lead else repairs


def _over_turns(plan: Plan, sources: Sequence[Source], rows: Rows, unwrap: bool) -> tuple[Rows, tuple[Repair, ...]]:
    """Rows of other times with angles that go on over a turn: between the two sides of a wrap nothing lies."""
    if unwrap:
        return _repair.unwrap(rows, _angles(sources))
    if plan.columns.join == "linear":
        apart = Checks(sources, None)
        apart.see(rows)
        wraps = (finding for finding in apart.findings() if finding.check == "wraps")
        if (first := next(wraps, None)) is not None:
            raise first.error(plan.path)
    return rows, ()


def _clock(source: Source) -> tuple[str, str]:
    return source.group.name, source.clock


def _channel(source: Source, values: Floats) -> Channel:
    return Channel(
        role=source.role, name=source.name, unit=source.conversion.si, values=values,
        delay=source.signal.delay, column=source.signal.column, range=source.range,
    )  # fmt: skip


def check(
    path: str | Path, columns: Columns | str | Path | None = None, part: int | None = None, *,
    memory: int = formats.MEMORY,
) -> tuple[Finding, ...]:  # fmt: skip
    """Everything that the checks have to say about a log, faults too; in bounded memory.

    Args:
        path: as for `read`.
        columns: as for `read`.
        part: as for `read`.
        memory: as for `read`.

    Raises:
        ColumnMapError, LogFormatError, FormatUnavailable: if it cannot be read at all.
    """
    with _opened(path, columns, part, memory) as found:
        for _ in found.rows():
            pass
        told = list(found.checks.findings())
        for _, group in groupby(sorted(found.plan.joined, key=_clock), key=_clock):
            sources = list(group)
            apart = Checks(sources, None)
            for block in found.stream.joined(sources):
                apart.see(block)
            told += apart.findings()
    return tuple(sorted(told, key=lambda finding: (not finding.fault, finding.row)))


def parts(path: str | Path, columns: Columns | str | Path, *, memory: int = formats.MEMORY) -> tuple[int, ...]:
    """Numbers of the runs in a file, by the column that the map names by `part`.

    Args:
        path: as for `read`.
        columns: as for `read`.
        memory: as for `read`.

    Raises:
        InvalidValue: if the map names none.
        LogFormatError: if the file cannot be read.
    """
    chosen = columns if isinstance(columns, Columns) else load_columns(columns)
    if not chosen.part:
        raise InvalidValue("The map names no column by `part`: the file holds one run.")
    with _opened(path, chosen, 0, memory) as found:
        return found.stream.parts()
