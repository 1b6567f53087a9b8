"""A reader of any format that stays within its budget."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from crossbody.cases import LogFormatError
from crossbody.hw.budget import MOST_COLUMNS, Budget
from crossbody.hw.formats._contract import Block, Group, Reader

WIDTH = 8  # bytes that every number takes once it is a float64, whatever the file stores


class Bounded:
    """A reader whose blocks are counted while they pass, and whose library may not take more than its budget.

    Args:
        path: the log.
        reader: its reader; closed if it has too many columns.
        budget: what reading may cost.

    Raises:
        LogFormatError: for too many columns.
    """

    def __init__(self, path: Path, reader: Reader, budget: Budget) -> None:
        self._reader = reader
        self.budget = budget
        self.groups: tuple[Group, ...] = reader.groups
        self.refused: Mapping[str, str] = reader.refused
        self.library = reader.library
        count = sum(len(group.columns) for group in self.groups)
        if count > MOST_COLUMNS:
            reader.close()
            raise LogFormatError(path, f"has {count} columns; a log of more than {MOST_COLUMNS} is not read.")

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """See `Reader`."""
        blocks = self._reader.blocks(group, columns)
        while True:
            with self.budget.guard():
                block = next(blocks, None)
            if block is None:
                return
            self.budget.spend(WIDTH * sum(values.size for values in block.values()))
            yield block

    def close(self) -> None:
        """See `Reader`."""
        self._reader.close()
