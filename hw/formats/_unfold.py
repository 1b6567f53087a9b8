"""Compressed chunks, unfolded to a bounded size and once each."""

from __future__ import annotations

import bz2
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

from crossbody.cases import LogFormatError
from crossbody.hw.budget import Budget

KEPT = 4  # of the memory, one part in so many holds unfolded chunks
WINDOW = 1 << 27  # bytes that a zstd frame may look back


def zstd(raw: bytes, most: int) -> bytes:
    """At most so many bytes of a zstd frame, whatever size it claims."""
    import zstandard

    with zstandard.ZstdDecompressor(max_window_size=WINDOW).stream_reader(BytesIO(raw)) as stream:
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

    Args:
        path: the file.
        budget: what it may unfold to.
    """

    def __init__(self, path: Path, budget: Budget) -> None:
        self._path, self._budget = path, budget
        self._kept: dict[int, bytes] = {}
        self._left = budget.memory // KEPT

    def unfold(self, key: int, compression: str, raw: bytes, declared: int | None = None) -> bytes:
        """One chunk.

        Args:
            key: which it is.
            compression: its name.
            raw: what stands in the file.
            declared: size that the file tells; None if it does not.

        Raises:
            LogFormatError: if it unfolds to another size, or to more than the budget.
        """
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
            text = f"has a chunk that unfolds to {'more' if len(found) > declared else 'less'} than it tells: damaged?"
            raise LogFormatError(self._path, text)
        self._budget.spend(len(found))
        if len(found) <= self._left:
            self._left -= len(found)
            self._kept[key] = found
        return found
