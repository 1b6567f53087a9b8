"""The place of the first fault in a text table, for a message."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from crossbody.cases import LogFormatError
from crossbody.hw.guard import words

if TYPE_CHECKING:
    from crossbody.hw.formats.csv import Options

LINE = 1 << 20  # characters; a longer line is no table
CELL = 40  # characters of an offending cell that are shown
COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")
FORMULA = ("=", "+", "-", "@")


def find_fault(
    path: Path, options: Options, delimiter: str, columns: Sequence[str], cause: Exception, start: int = 0
) -> LogFormatError:
    """Read the text again, line by line, up to the first cell that is no number or the first line of a wrong width.

    Args:
        path: the table.
        options: its layout.
        delimiter: between cells.
        columns: columns whose cells must be numbers.
        cause: what the parser said, for a fault that only it sees.
        start: rows that are known to be good.

    Returns:
        The error to raise.
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
                    return LogFormatError(path, "the line is no text table (binary, or without an end).", row)
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
        return LogFormatError(path, f"the line has {len(cells)} cells, the header {len(names)}: cut off?", row)
    for name, cell in zip(names, cells, strict=True):
        if name in columns and not _is_number(cell, decimal):
            kind = "a formula" if cell.lstrip().startswith(FORMULA) else "text"
            shown = cell if len(cell) <= CELL else cell[:CELL] + "..."
            text = f"{shown!r} is {kind}, not a number; it was not evaluated.{_hint(row, cell, decimal)}"
            return LogFormatError(path, text, row, name)
    return None


def _hint(row: int, cell: str, decimal: str) -> str:
    """What the map could say about a cell that is no number as it stands."""
    if decimal == "." and COMMA.fullmatch(cell.strip()):
        return ' With a decimal comma, say `options.decimal = ","`.'
    return "" if row else " Below a header of two lines, say `options.units = true`, or `options.skip`."


def _is_number(cell: str, decimal: str) -> bool:
    text = cell.strip().replace(decimal, ".") if decimal != "." else cell.strip()
    if "_" in text:  # Python would take 1_000 for a number
        return False
    try:
        float(text or "nan")
    except ValueError:
        return text in ("null", "NULL", "NA", "N/A")
    return True
