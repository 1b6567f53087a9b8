"""A file that notices when a parser reads it in circles."""

from __future__ import annotations

import io
from pathlib import Path

from crossbody.cases import LogFormatError
from crossbody.hw.budget import Budget

ROUNDS = 8  # times the file's size that its structure may cost to read: parsers do look at a block more than once
FREE = 1 << 22  # bytes that are never counted against it
OFTEN = 256  # reads between two looks at the clock
SAME = 2000  # times that one place may be read: parsers keep what many channels share


class MeteredFile(io.BufferedReader):
    """A file for a parser that follows links: no read reaches beyond the end, and links that lead back run out.

    Cyclic links make a parser read the same blocks for ever. What a whole structure costs to read is some times the
    file's size, so a parser that has read much more goes in circles. Lengths are cut at the file's end before anything
    is allocated for them.

    Args:
        path: the file.
        budget: whose clock is looked at while the structure is read.

    Attributes:
        metered: whether reads are counted; set it to False once the structure is known.
    """

    def __init__(self, path: Path, budget: Budget) -> None:
        super().__init__(io.FileIO(path))
        self._path, self._budget, self._reads = path, budget, 0
        self._end = path.stat().st_size
        self._left = FREE + ROUNDS * self._end
        self._places: dict[int, int] = {}
        self.metered = True

    def read(self, size: int | None = -1, /) -> bytes:
        """As of any file."""
        at = self.tell()
        left = max(self._end - at, 0)
        found = super().read(left if size is None or size < 0 else min(size, left))
        if self.metered:
            self._left -= len(found)
            self._reads += 1
            if not self._reads % OFTEN:
                self._budget.spend(0)
            self._places[at] = self._places.get(at, 0) + 1
            if self._left < 0 or (left and self._places[at] > SAME):
                raise LogFormatError(self._path, "has blocks that lead back to themselves: damaged, or made so.")
        return found
