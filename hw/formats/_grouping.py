"""Arrays of one file as groups: those of equal length belong together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.hw.formats._contract import BLOCK_ROWS, Block, Column, Group
from crossbody.hw.formats._names import WIDEST, elements

HINT = "save plain arrays or structs instead (a timetable: its columns; an object: struct(object))"  # of MATLAB


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
        names = [self.name] if self.width is None else elements(self.name, self.width)
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


def spans(rows: int) -> Iterator[tuple[int, int]]:
    """Bounds of the blocks of that many rows."""
    return ((a, min(a + BLOCK_ROWS, rows)) for a in range(0, rows, BLOCK_ROWS))


def pick(array: NDArray[Any], table: Table, element: int | None, start: int, stop: int) -> NDArray[Any]:
    """Rows of one column out of a whole array in memory."""
    if array.ndim == 2:
        array = np.moveaxis(array, table.axis, 0)[:, element or 0]
    return array[start:stop]


def cut(arrays: dict[str, tuple[NDArray[Any], Table, int | None]], rows: int) -> Iterator[Block]:
    """Blocks out of whole arrays in memory."""
    for start, stop in spans(rows):
        yield {name: pick(array, table, i, start, stop) for name, (array, table, i) in arrays.items()}
