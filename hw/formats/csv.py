"""Text tables (CSV, TSV), by pyarrow."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TextIO

import msgspec
import numpy as np

from crossbody.cases import LogFormatError
from crossbody.hw.budget import MOST_COLUMNS, current
from crossbody.hw.formats._contract import Block, Column, Group
from crossbody.hw.formats._tables import header_unit
from crossbody.hw.guard import library, parsing, plain_allocator, words

SUFFIXES = (".csv", ".tsv", ".txt", ".dat")
DELIMITERS = ",;\t|"
BLOCK_BYTES = 1 << 20
BLOCK_LINES = 256  # at least in a block: what is checked for every column of a block takes its time
LARGEST_BLOCK = 1 << 25  # bytes
WIDE = 0.4  # of the letters' second bytes that are zero in UTF-16
OPENING = 12 << 20  # bytes that pyarrow takes for its own needs
BLOCKS = 4  # that it has in memory, as text and as numbers
COLUMN = 30_000  # bytes that it takes for each column while it parses: 19,000 were seen
HEAD = 4096  # bytes that tell the encoding
EXACT = 2**53  # beyond, an integer is no float64
MISSING = ["", "nan", "NaN", "NAN", "null", "NULL", "NA", "N/A"]
LINE = 1 << 20  # characters; a longer line is no table
CELL = 40  # characters of an offending cell that are shown
COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")
FORMULA = ("=", "+", "-", "@")


class Options(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """How the text is laid out.

    Attributes:
        delimiter: between cells; found from the header if not given.
        decimal: decimal mark.
        encoding: of the text; UTF-16 is noticed.
        skip: lines before the header.
        units: whether the line below the header holds the units of the columns.
        header: whether the first line names the columns; they are c0, c1, ... if not.
    """

    delimiter: Annotated[str, msgspec.Meta(max_length=1)] = ""
    decimal: Literal[".", ","] = "."
    encoding: str = "utf-8"
    skip: Annotated[int, msgspec.Meta(ge=0)] = 0
    header: bool = True
    units: bool = False


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file is text, of one byte a letter or two."""
    wide = wide_encoding(head)
    text = head[: len(head) & ~1].decode(wide, "replace") if wide else head.decode("latin-1")
    return bool(head) and not re.search(r"[\x00-\x08\x0e-\x1f\x7f]", text)


def wide_encoding(head: bytes) -> str:
    """The UTF-16 that a file begins in, by its mark or by where its zeros are; empty for another encoding."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    pairs = max(len(head) // 2, 1)
    odd, even = head[1::2].count(0) / pairs, head[0::2].count(0) / pairs
    return "utf-16-le" if odd > WIDE and not even else "utf-16-be" if even > WIDE and not odd else ""


def open_log(path: Path, options: Options) -> CsvReader:
    """Open a text table."""
    return CsvReader(path, options)


class CsvReader:
    """A table of text, a megabyte at a time. Cells are numbers or an error: nothing is evaluated."""

    def __init__(self, path: Path, options: Options) -> None:
        if options.encoding == "utf-8":
            with path.open("rb") as file:
                options = msgspec.structs.replace(options, encoding=wide_encoding(file.read(HEAD)) or "utf-8")
        self._path, self._options = path, options
        line = _first_line(path, options)
        self._delimiter = options.delimiter or max(DELIMITERS, key=line.count)
        width = line.count(self._delimiter) + 1
        if width > MOST_COLUMNS:  # before anything is made for each of them
            raise LogFormatError(path, f"has {width} columns; a log of more than {MOST_COLUMNS} is not read.")
        # pyarrow ends the process where memory is denied to it: it is not begun with less than it needs.
        most = max(BLOCK_BYTES, min(LARGEST_BLOCK, path.stat().st_size))
        self._block = min(max(BLOCK_BYTES, BLOCK_LINES * len(line)), most)
        current(path).hold(OPENING + COLUMN * width + BLOCKS * self._block, f"a table of {width} columns")
        self.library = library("pyarrow")
        self.refused: dict[str, str] = {}
        batch, schema = self._first()
        if len(set(schema.names)) < len(schema.names):
            twice = next(name for name in schema.names if schema.names.count(name) > 1)
            raise LogFormatError(path, "is the name of two columns; names must differ.", column=twice)
        if options.header and schema.names and all(map(_is_number, schema.names)):
            raise LogFormatError(path, "has numbers where names are expected; set `options.header = false`.")
        self._types = {f.name: _type(f, batch) for f in schema}
        units = dict(zip(schema.names, _units(path, options, self._delimiter), strict=False))
        columns = tuple(Column(name=n, type=t, unit=units.get(n) or header_unit(n)) for n, t in self._types.items())
        self.groups = (Group(name="", rows=None, columns=columns),)

    def _first(self) -> tuple[Any, Any]:
        """The first batch, None if there is none, and the schema that its cells suggest."""
        import pyarrow as pa

        try:
            with parsing(self._path, "CSV file"), plain_allocator(self._path), self._stream() as stream:
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
        except (pa.ArrowException, UnicodeError) as error:  # it does not tell the place of every fault
            raise find_fault(self._path, self._options, self._delimiter, columns, error, rows) from error

    def _stream(self, columns: Sequence[str] | None = None) -> Any:
        import pyarrow as pa
        from pyarrow import csv as text

        chosen = self._options
        types = {n: pa.int64() if self._types[n] == "int64" else pa.float64() for n in columns or ()}
        width = None if chosen.header else _first_line(self._path, chosen).count(self._delimiter) + 1
        return text.open_csv(
            self._path,
            text.ReadOptions(
                use_threads=False,
                block_size=self._block,
                skip_rows=chosen.skip,
                skip_rows_after_names=int(chosen.units),
                encoding=chosen.encoding,
                column_names=[f"c{i}" for i in range(width)] if width is not None else None,
            ),
            text.ParseOptions(delimiter=self._delimiter),
            text.ConvertOptions(
                include_columns=list(columns) if columns is not None else None,
                column_types=types,
                null_values=MISSING,
                decimal_point=chosen.decimal,
                timestamp_parsers=[],
            ),
            pa.system_memory_pool(),
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
        _leave_out(path, file, options.skip)
        return file.readline(BLOCK_BYTES)


def _leave_out(path: Path, file: TextIO, count: int) -> None:
    """Go past the lines before the header."""
    for line in range(count):
        if not file.readline(BLOCK_BYTES):
            raise LogFormatError(path, f"has {line} lines; `options.skip` leaves out {count}, and the header too.")


def _units(path: Path, options: Options, delimiter: str) -> list[str]:
    """The units in the line below the header, without their brackets."""
    if not options.units:
        return []
    with parsing(path, "CSV file"), path.open(encoding=options.encoding, newline="") as file:
        _leave_out(path, file, options.skip + int(options.header))
        cells = next(csv.reader([file.readline(BLOCK_BYTES)], delimiter=delimiter), [])
    return [cell.strip().strip("[]()") for cell in cells]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def find_fault(
    path: Path, options: Options, delimiter: str, columns: Sequence[str], cause: Exception, start: int = 0
) -> LogFormatError:
    """Read the text again up to the first cell that is no number or the first line of a wrong width.

    So many rows at the start are known to be good; what the parser said is the cause that only it
    sees.
    """
    try:
        with path.open(encoding=options.encoding, newline="") as file:
            for _ in range(options.skip):
                file.readline(LINE)
            names = next(csv.reader([file.readline(LINE)], delimiter=delimiter)) if options.header else None
            if options.units:
                file.readline(LINE)
            row = 0
            while line := file.readline(LINE):
                if row < start and not line.isspace():
                    row += 1
                    continue
                if len(line) >= LINE or "\0" in line:
                    return LogFormatError(
                        path, "the line is not part of a text table (binary, or without an end).", row
                    )
                if line.strip():
                    cells = next(csv.reader([line], delimiter=delimiter))
                    names = names or [f"c{i}" for i in range(len(cells))]
                    if found := _check(path, row, names, cells, columns, options.decimal):
                        return found
                    row += 1
    except (OSError, UnicodeError, csv.Error) as error:
        cause = error
    return LogFormatError(path, f"is not a readable CSV file: {words(cause)}.")


def _check(
    path: Path, row: int, names: Sequence[str], cells: Sequence[str], columns: Sequence[str], decimal: str
) -> LogFormatError | None:
    if len(cells) != len(names):
        return LogFormatError(path, f"the line has {len(cells)} cells, the header {len(names)}: truncated?", row)
    for name, cell in zip(names, cells, strict=True):
        if name in columns and not _is_numeric_cell(cell, decimal):
            kind = "a formula" if cell.lstrip().startswith(FORMULA) else "text"
            shown = cell if len(cell) <= CELL else cell[:CELL] + "..."
            text = f"{shown!r} is {kind}, not a number; it was not evaluated.{_hint(row, cell, decimal)}"
            return LogFormatError(path, text, row, name)
    return None


def _hint(row: int, cell: str, decimal: str) -> str:
    """What the map could say about a cell that is no number as it stands."""
    if decimal == "." and COMMA.fullmatch(cell.strip()):
        return ' With a decimal comma, set `options.decimal = ","`.'
    return "" if row else " With a header of two lines, set `options.units = true`, or `options.skip`."


def _is_numeric_cell(cell: str, decimal: str) -> bool:
    text = cell.strip().replace(decimal, ".") if decimal != "." else cell.strip()
    if "_" in text:  # Python would take 1_000 for a number
        return False
    try:
        float(text or "nan")
    except ValueError:
        return text in ("null", "NULL", "NA", "N/A")
    return True
