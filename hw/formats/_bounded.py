"""What keeps readers within a budget: of columns and numbers, structures that lead back, unfolded chunks."""

from __future__ import annotations

import bz2
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from crossbody.cases import InvalidValue, LogFormatError
from crossbody.cases.errors import shown
from crossbody.hw.budget import MOST_COLUMNS, Budget
from crossbody.hw.formats._contract import Block, Group, Reader

WIDTH = 8  # bytes that every number takes once it is a float64, whatever the file stores


class Bounded:
    """A reader whose blocks are counted while they pass, and whose library may not take more than its budget."""

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
            _check(self.library, block, group, columns)
            self.budget.spend(WIDTH * sum(values.size for values in block.values()))
            yield block

    def close(self) -> None:
        """See `Reader`."""
        self._reader.close()


def _check(library: str, block: Block, group: Group, columns: Sequence[str]) -> None:
    """Refuse what is no block: arrays of one length for the columns that were asked for."""
    good = isinstance(block, dict) and all(getattr(block.get(name), "ndim", 0) == 1 for name in columns)
    if not good or len({len(values) for values in block.values()}) > 1:
        told = (
            {name: getattr(values, "shape", values) for name, values in block.items()}
            if isinstance(block, dict)
            else block
        )
        raise InvalidValue(
            f"A block of the group {group.name!r} (read by {library}) is {shown(told)}; "
            f"valid: a dictionary with an array (n,) for each of {', '.join(columns[:9])}."
        )


ROUNDS = 8  # times the file's size that its structure may cost to read: parsers do look at a block more than once
FREE = 1 << 22  # bytes that are never counted against it
OFTEN = 256  # reads between two looks at the clock
SAME = 2000  # times that one place may be read: parsers keep what many channels share


class MeteredFile(io.BufferedReader):
    """A file for a parser that follows links: no read reaches beyond the end, and links that lead back run out.

    Cyclic links make a parser read the same blocks for ever. What a whole structure costs to read
    is some times the file's size, so a parser that has read much more goes in circles. Lengths
    are cut at the file's end before anything is allocated for them.

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
                raise LogFormatError(
                    self._path, "has blocks that lead back to themselves: damaged, or built that way on purpose."
                )
        return found


KEPT = 4  # of the memory, one part in so many holds unfolded chunks
WINDOW = 1 << 27  # bytes that a zstd frame may look back


def zstd(raw: bytes, most: int) -> bytes:
    """At most so many bytes of a zstd frame, whatever size it claims."""
    import zstandard

    with zstandard.ZstdDecompressor(max_window_size=WINDOW).stream_reader(io.BytesIO(raw)) as stream:
        return stream.read(most)


def lz4(raw: bytes, most: int) -> bytes:
    """At most so many bytes of an LZ4 frame."""
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

    found: bytes = LZ4FrameDecompressor().decompress(raw, max_length=most)
    return found


def bzip2(raw: bytes, most: int) -> bytes:
    """At most so many bytes of a bzip2 stream."""
    return bz2.BZ2Decompressor().decompress(raw, max_length=most)


def plain(raw: bytes, most: int) -> bytes:
    """What is not compressed."""
    return raw


UNFOLD: dict[str, Callable[[bytes, int], bytes]] = {
    "": plain, "none": plain, "zstd": zstd, "lz4": lz4, "bz2": bzip2,
}  # fmt: skip


class Chunks:
    """The chunks of one file, kept unfolded as far as a part of its budget allows.

    The first ones are kept, not the last: all passes go through a file from its beginning.
    """

    def __init__(self, path: Path, budget: Budget) -> None:
        self._path, self._budget = path, budget
        self._kept: dict[int, bytes] = {}
        self._left = budget.memory // KEPT

    def unfold(self, key: int, compression: str, raw: bytes, declared: int | None = None) -> bytes:
        """One chunk, whose declared size the file may tell."""
        if key in self._kept:
            return self._kept[key]
        if compression not in UNFOLD:
            known = ", ".join(name for name in UNFOLD if name)
            raise LogFormatError(self._path, f"has chunks compressed by {compression[:20]!r}; known are {known}.")
        self._budget.hold(2 * (declared or 0), "a chunk and its messages")
        most = self._budget.memory // 2 if declared is None else declared
        found = UNFOLD[compression](raw, most + 1)
        if declared is None:
            self._budget.hold(2 * len(found), "a chunk and its messages")
        elif len(found) != declared:
            text = f"has a chunk that holds {'more' if len(found) > declared else 'less'} than it declares: damaged?"
            raise LogFormatError(self._path, text)
        self._budget.spend(len(found))
        if len(found) <= self._left:
            self._left -= len(found)
            self._kept[key] = found
        return found
