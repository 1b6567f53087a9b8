"""The store: SI in Parquet, with where it came from, the hash of those bytes and one of its numbers."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

import msgspec
import numpy as np

from crossbody.cases import LogFormatError, OutputError, arguments
from crossbody.cases.arrays import Floats
from crossbody.cases.regular import open_regular
from crossbody.hw.reading import published
from crossbody.hw.reading.columns import Columns, Role, Signal, Time
from crossbody.hw.reading.log import Log, Provenance

KEY = b"crossbody.log"
VERSION = 1
TIME = "time"
ROW_GROUP = 1 << 18  # rows
CHUNK = 1 << 20  # bytes that are hashed at a time


class _Channel(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    role: Role
    name: str
    unit: str
    delay: float
    column: str
    range: tuple[float, float] | None


class _About(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What the store keeps beside the numbers."""

    version: int
    sample_time: float
    content: str
    provenance: Provenance
    channels: list[_Channel]
    filled: list[int]


def store(log: Log, path: str | Path) -> str:
    """Write a log as Parquet, whole or not at all.

    Args:
        log: what to write.
        path: the file; replaced if it is there.

    Returns:
        SHA-256 of its numbers, with their names and units: the same for the same log, however it
            is compressed.

    Raises:
        OutputError: if the file cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    arguments.instance("log", log, Log, "a log that was read")
    path = arguments.path("path", path)
    names = [TIME, *(f"{c.role.value}.{c.name}" for c in log.channels)]
    units = ["s", *(c.unit for c in log.channels)]
    columns = [log.time, *(c.values for c in log.channels)]
    digest = _hash(names, units, columns)
    fields = [pa.field(n, pa.float64(), metadata={b"unit": u.encode()}) for n, u in zip(names, units, strict=True)]
    schema = pa.schema(fields, metadata={KEY: _encode(log, digest)})
    with _replacing(Path(path)) as made:
        pq.write_table(pa.table(columns, schema=schema), made, row_group_size=ROW_GROUP, compression="zstd")
    return digest


def _hash(names: Iterable[str], units: Iterable[str], columns: Iterable[Floats]) -> str:
    """SHA-256 of columns of float64 with their names and units; how they are compressed does not matter."""
    whole = hashlib.sha256()
    for name, unit, values in zip(names, units, columns, strict=True):
        digest = hashlib.sha256(np.ascontiguousarray(values, dtype="<f8").data).digest()
        whole.update(f"{name} [{unit}]".encode() + b"\0" + digest)
    return whole.hexdigest()


def _encode(log: Log, content: str) -> bytes:
    channels = [{k: getattr(c, k) for k in ("role", "name", "unit", "delay", "column", "range")} for c in log.channels]
    about = {
        "version": VERSION, "sample_time": log.sample_time, "content": content,
        "provenance": asdict(log.provenance), "channels": channels, "filled": log.filled.tolist(),
    }  # fmt: skip
    return json.dumps(about).encode()


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """A temporary sibling that takes the file's place when it is whole."""
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.absolute().parent)
        os.close(handle)
    except OSError as error:
        raise OutputError(f"Log {path} cannot be written: {error.strerror}.") from None
    made = Path(name)
    try:
        yield made
        made.chmod(0o644)
        os.replace(made, path)
    except OSError as error:
        raise OutputError(f"Log {path} cannot be written: {error.strerror or error}.") from error
    finally:
        made.unlink(missing_ok=True)


def about(path: Path) -> _About:
    """What a stored log says of itself."""
    from crossbody.hw import formats

    if formats.recognise(path) == "parquet":
        found = _metadata(path)
        if found is not None:
            return found
    raise LogFormatError(
        path,
        "needs a column map (`crossbody log info` drafts one; some come with crossbody: "
        f"{', '.join(published.names())}): it is not a log that crossbody stored.",
    )


def _metadata(path: Path) -> _About | None:
    import pyarrow.parquet as pq

    from crossbody.hw.guard import parsing

    with parsing(path, "Parquet file"):
        raw = (pq.read_schema(path).metadata or {}).get(KEY)
    if raw is None:
        return None
    with parsing(path, "stored log"):
        return msgspec.json.decode(raw, type=_About)


def columns_of(path: Path) -> Columns:
    """The column map of a stored log: everything as it is."""
    found = about(path)
    tables: dict[str, dict[str, Signal]] = {role.value: {} for role in Role}
    for channel in found.channels:
        signal = Signal(
            column=f"{channel.role.value}.{channel.name}", unit=channel.unit, delay=channel.delay, range=channel.range
        )
        tables[channel.role.value][channel.name] = signal
    origin = found.provenance
    time = Time(column=TIME, unit="s", sample_time=found.sample_time)
    columns = Columns(about=origin.about, format="parquet", synthetic=origin.synthetic, time=time)
    return msgspec.structs.replace(columns, **tables)


def verified(log: Log, stored: _About) -> Log:
    """A log read from the store, under its own provenance, if its numbers are those that were written."""
    names, units = [TIME, *(c.column for c in log.channels)], ["s", *(c.unit for c in log.channels)]
    if _hash(names, units, [log.time, *(c.values for c in log.channels)]) != stored.content:
        raise LogFormatError(
            log.provenance.file, "has changed since it was stored: its numbers do not have their hash."
        )
    source = {(c.role, c.name): c.column for c in stored.channels}
    channels = tuple(replace(c, column=source[c.role, c.name]) for c in log.channels)
    return replace(log, channels=channels, provenance=stored.provenance, filled=np.array(stored.filled, np.int64))


def file_hash(path: Path) -> str:
    """SHA-256 of a file, or of the names and contents of a folder's files in the order of their names."""
    digest = hashlib.sha256()
    try:
        for file in sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]:
            if path.is_dir():
                digest.update(file.relative_to(path).as_posix().encode() + b"\0")
            with open_regular(file) as stream:
                while chunk := stream.read(CHUNK):
                    digest.update(chunk)
    except OSError as error:
        raise LogFormatError(path, f"cannot be read: {error.strerror}.") from None
    return digest.hexdigest()
