"""Text tables (CSV, TSV), by pyarrow."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from crossbody.cases import LogFormatError
from crossbody.hw.formats._budget import MOST_COLUMNS
from crossbody.hw.formats._contract import Block, Column, Group
from crossbody.hw.formats._csv_fault import find_fault
from crossbody.hw.formats._guard import library, parsing
from crossbody.hw.formats._names import header_unit

SUFFIXES = (".csv", ".tsv", ".txt", ".dat")
DELIMITERS = ",;\t|"
BLOCK_BYTES = 1 << 20
EXACT = 2**53  # beyond, an integer is no float64
MISSING = ["", "nan", "NaN", "NAN", "null", "NULL", "NA", "N/A"]


class Options(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """How the text is laid out.

    Attributes:
        delimiter: between cells; found from the header if not given.
        decimal: decimal mark.
        encoding: of the text.
        skip: lines before the header.
        header: whether the first line names the columns; they are c0, c1, ... if not.
    """

    delimiter: str = ""
    decimal: str = "."
    encoding: str = "utf-8"
    skip: int = 0
    header: bool = True


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file is text."""
    return bool(head) and not re.search(rb"[\x00-\x08\x0e-\x1f\x7f]", head)


def open_log(path: Path, options: Options) -> CsvReader:
    """Open a text table."""
    return CsvReader(path, options)


class CsvReader:
    """A table of text, a megabyte at a time. Cells are numbers or an error: nothing in them is ever evaluated."""

    def __init__(self, path: Path, options: Options) -> None:
        self._path, self._options = path, options
        self._delimiter = options.delimiter or _delimiter(path, options)
        width = _width(path, options, self._delimiter)
        if width > MOST_COLUMNS:  # before anything is made for each of them
            raise LogFormatError(path, f"has {width} columns; a log of more than {MOST_COLUMNS} is not read.")
        self.library = library("pyarrow")
        self.refused: dict[str, str] = {}
        batch, schema = self._first()
        if len(set(schema.names)) < len(schema.names):
            twice = next(name for name in schema.names if schema.names.count(name) > 1)
            raise LogFormatError(path, "is the name of two columns; names must differ.", column=twice)
        if options.header and schema.names and all(map(_is_number, schema.names)):
            raise LogFormatError(path, "has numbers where names are expected; say `options.header = false`.")
        self._types = {f.name: _type(f, batch) for f in schema}
        columns = tuple(Column(name=n, type=t, unit=header_unit(n)) for n, t in self._types.items())
        self.groups = (Group(name="", rows=None, columns=columns),)

    def _first(self) -> tuple[Any, Any]:
        """The first batch, None if there is none, and the schema that its cells suggest."""
        import pyarrow as pa

        try:
            with parsing(self._path, "CSV file"), self._stream() as stream:
                return next(iter(stream), None), stream.schema
        except LogFormatError as error:
            if isinstance(error.__cause__, pa.ArrowException):
                raise find_fault(self._path, self._options, self._delimiter, (), error.__cause__) from error
            raise

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """See `Reader`."""
        import pyarrow as pa

        rows = 0
        try:
            with self._stream(columns) as stream:
                for batch in stream:
                    yield {name: batch.column(name).to_numpy(zero_copy_only=False) for name in columns}
                    rows += batch.num_rows
        except pa.ArrowException as error:  # it does not tell the place of every fault
            raise find_fault(self._path, self._options, self._delimiter, columns, error, rows) from error

    def _stream(self, columns: Sequence[str] | None = None) -> Any:
        import pyarrow as pa
        from pyarrow import csv

        chosen = self._options
        types = {n: pa.int64() if self._types[n] == "int64" else pa.float64() for n in columns or ()}
        width = None if chosen.header else _width(self._path, chosen, self._delimiter)
        return csv.open_csv(
            self._path,
            csv.ReadOptions(
                use_threads=False,
                block_size=BLOCK_BYTES,
                skip_rows=chosen.skip,
                encoding=chosen.encoding,
                column_names=[f"c{i}" for i in range(width)] if width is not None else None,
            ),
            csv.ParseOptions(delimiter=self._delimiter),
            csv.ConvertOptions(
                include_columns=list(columns) if columns is not None else None,
                column_types=types,
                null_values=MISSING,
                decimal_point=chosen.decimal,
                timestamp_parsers=[],
            ),
        )

    def close(self) -> None:
        """See `Reader`."""


def _type(field: Any, batch: Any) -> str:
    """Integers that float64 holds are read as float64: a fraction may follow in a later block."""
    import pyarrow.types as of

    if of.is_integer(field.type):
        values = batch.column(field.name).to_numpy(zero_copy_only=False) if batch is not None else np.zeros(0)
        return "int64" if np.any(np.abs(values) > EXACT) else "float64"
    return "float64" if of.is_floating(field.type) or of.is_null(field.type) else "text"


def _first_line(path: Path, options: Options) -> str:
    with parsing(path, "CSV file"), path.open(encoding=options.encoding, newline="") as file:
        for _ in range(options.skip):
            file.readline(BLOCK_BYTES)
        return file.readline(BLOCK_BYTES)


def _delimiter(path: Path, options: Options) -> str:
    line = _first_line(path, options)
    return max(DELIMITERS, key=line.count)


def _width(path: Path, options: Options, delimiter: str) -> int:
    return _first_line(path, options).count(delimiter) + 1


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
