"""Apache Parquet, by pyarrow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.hw.formats._contract import BLOCK_ROWS, Block, Column, Group
from crossbody.hw.formats._tables import NoOptions as Options
from crossbody.hw.formats._tables import header_unit
from crossbody.hw.guard import library, parsing, plain_allocator

SUFFIXES = (".parquet", ".pq")
BUFFER = 1 << 20  # bytes of a column chunk that are in memory at once


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as Parquet does."""
    return head.startswith(b"PAR1")


def open_log(path: Path, options: Options) -> ParquetReader:
    """Open a Parquet file."""
    return ParquetReader(path)


class ParquetReader:
    """Numbers, booleans, times and durations; streamed page by page, however large a row group is."""

    def __init__(self, path: Path) -> None:
        import pyarrow.parquet as pq

        self._path = path
        with parsing(path, "Parquet file"), plain_allocator(self._path):
            self._file = pq.ParquetFile(path, buffer_size=BUFFER, pre_buffer=False)
            schema, rows = self._file.schema_arrow, self._file.metadata.num_rows
        self.library = library("pyarrow")
        self.refused = {f.name: f"holds {f.type}, not numbers" for f in schema if _column(f) is None}
        columns = tuple(c for c in map(_column, schema) if c is not None)
        self.groups = (Group(name="", rows=rows, columns=columns),)

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """See `Reader`."""
        row = 0
        with parsing(self._path, "Parquet file"), plain_allocator(self._path):
            batches = self._file.iter_batches(BLOCK_ROWS, columns=list(columns), use_threads=False)
        while True:
            with parsing(self._path, "Parquet file", row), plain_allocator(self._path):
                if (batch := next(batches, None)) is None:
                    return
                block = {name: _numbers(batch.column(name)) for name in columns}
            yield block
            row += batch.num_rows

    def close(self) -> None:
        """See `Reader`."""
        self._file.close()


def _column(field: Any) -> Column | None:
    """The column of a schema field, None if it holds no numbers."""
    import pyarrow.types as of

    unit = (field.metadata or {}).get(b"unit", b"").decode("utf-8", "replace") or header_unit(field.name)
    if of.is_timestamp(field.type) or of.is_duration(field.type):
        return Column(name=field.name, type="int64", unit=field.type.unit)
    if of.is_boolean(field.type):
        return Column(name=field.name, type="bool", unit=unit)
    if of.is_integer(field.type) or of.is_floating(field.type):
        return Column(name=field.name, type=np.dtype(field.type.to_pandas_dtype()).name, unit=unit)
    return None


def _numbers(array: Any) -> NDArray[Any]:
    """A numpy array; a null is NaN."""
    import pyarrow as pa
    import pyarrow.types as of

    if of.is_timestamp(array.type) or of.is_duration(array.type):
        array = array.cast(pa.int64())
    numbers: NDArray[Any] = array.to_numpy(zero_copy_only=False)
    return numbers.astype(np.float64) if numbers.dtype == object else numbers
