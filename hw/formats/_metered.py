"""A file that notices when a parser reads it in circles."""

from __future__ import annotations

import io
from pathlib import Path

from crossbody.cases import LogFormatError

ROUNDS = 8  # times the file's size that its structure may cost to read: parsers do look at a block more than once
FREE = 1 << 22  # bytes that are never counted against it


class MeteredFile(io.BufferedReader):
    """A file for a parser that follows links: no read reaches beyond the end, and links that lead back run out.

    Cyclic links make a parser read the same blocks for ever. What a whole structure costs to read is some times the
    file's size, so a parser that has read much more goes in circles. Lengths are cut at the file's end before anything
    is allocated for them.

    Args:
        path: the file.

    Attributes:
        metered: whether reads are counted; set it to False once the structure is known.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self._path = path
        self._end = path.stat().st_size
        self._left = FREE + ROUNDS * self._end
        self.metered = True

    def read(self, size: int | None = -1, /) -> bytes:
        """As of any file."""
        left = max(self._end - self.tell(), 0)
        found = super().read(left if size is None or size < 0 else min(size, left))
        if self.metered:
            self._left -= len(found)
            if self._left < 0:
                raise LogFormatError(self._path, "has blocks that lead back to themselves: damaged, or made so.")
        return found
