"""What readers of tables share: names and groups of columns, blocks of rows; equally long arrays are one."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from numpy.typing import NDArray

from crossbody.cases import LogFormatError
from crossbody.hw.formats._contract import BLOCK_ROWS, Block, Column, Group
from crossbody.hw.guard import parsing

HEADER_UNIT = re.compile(r"[\[(]\s*([^\[\]()]*[^\[\]()\d\s][^\[\]()]*?)\s*[\])]\s*$")
WIDEST = 64  # elements of a vector that are columns; wider ones are pictures or clouds


class NoOptions(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Nothing to choose."""


def header_unit(name: str) -> str:
    """The unit in a header like `angle [deg]` or `force (N)`; empty if there is none."""
    found = HEADER_UNIT.search(name)
    return found.group(1) if found else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A stored array that is one column or several.

    Attributes:
        key: where the file holds it.
        name: name of the column, or of the vector.
        type: numpy name of its numbers.
        rows: samples.
        width: elements of one sample; None for a plain column.
        axis: the axis of the samples.
        unit: as the file tells it.
        field: field of a compound type; empty if it has none.
    """

    key: str
    name: str
    type: str
    rows: int
    width: int | None = None
    axis: int = 0
    unit: str = ""
    field: str = ""

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns that it gives."""
        names = [self.name] if self.width is None else [f"{self.name}[{i}]" for i in range(self.width)]
        return tuple(Column(name=name, type=self.type, unit=self.unit) for name in names)


def layout(shape: Sequence[int]) -> tuple[int, int | None, int] | None:
    """Rows, width and axis of the samples of an array; None if it is no table of at most `WIDEST` columns.

    Samples run along the longer axis; a matrix with one row or one column is a plain column.
    """
    if len(shape) == 1:
        return shape[0], None, 0
    if len(shape) != 2:
        return None
    axis = 0 if shape[0] >= shape[1] else 1
    rows, width = shape[axis], shape[1 - axis]
    return (rows, None if width == 1 else width, axis) if 1 <= width <= WIDEST else None


def grouped(tables: Iterable[Table]) -> tuple[Group, ...]:
    """Groups by length, in the order of first appearance."""
    found: dict[int, list[Column]] = {}
    for table in tables:
        found.setdefault(table.rows, []).extend(table.columns)
    one = len(found) == 1
    return tuple(
        Group(name="" if one else f"{rows} rows", rows=rows, columns=tuple(columns)) for rows, columns in found.items()
    )


def places(tables: Iterable[Table]) -> dict[str, tuple[Table, int | None]]:
    """Every column's array, and its element there; of columns with one name the first."""
    found: dict[str, tuple[Table, int | None]] = {}
    for table in tables:
        for i, column in enumerate(table.columns):
            found.setdefault(column.name, (table, None if table.width is None else i))
    return found


def sliced(
    path: Path, what: str, group: Group, columns: Sequence[str], get: Callable[[str, int, int], NDArray[Any]]
) -> Iterator[Block]:
    """Blocks whose columns are read one by one; `get` gives the rows of a column by name, start and stop."""
    rows = group.rows or 0
    for start in range(0, rows, BLOCK_ROWS):
        stop = min(start + BLOCK_ROWS, rows)
        block: Block = {}
        for name in columns:
            with parsing(path, what, start, name):
                block[name] = get(name, start, stop)
            if len(block[name]) != stop - start:
                at = start + len(block[name])
                raise LogFormatError(path, f"ends before its {group.rows} rows: truncated?", at, name)
        yield block
