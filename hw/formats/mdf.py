"""ASAM MDF 4 (and 3) measurement files, by asammdf."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from traceback import walk_tb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import LogFormatError
from crossbody.hw.budget import current
from crossbody.hw.formats._bounded import MeteredFile
from crossbody.hw.formats._contract import Block, Column, Group
from crossbody.hw.formats._tables import NoOptions as Options
from crossbody.hw.formats._tables import sliced
from crossbody.hw.guard import closing, library, parsing

SUFFIXES = (".mf4", ".mdf", ".dat")
WHAT = "MDF file"
LOOKS = 8  # blocks that are unfolded as fast as one block's numbers are read and checked
DEEPEST = 8  # conversions that refer to conversions


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as MDF does."""
    return head.startswith((b"MDF     ", b"UnFinMF "))


def open_log(path: Path, options: Options) -> MdfReader:
    """Open an MDF file; a name that several groups use is preceded by the group's index, `1/speed`."""
    with path.open("rb") as file:
        if file.read(8) == b"UnFinMF ":
            raise LogFormatError(
                path, "was never closed by its recorder (unfinalised MDF): let the recorder repair it."
            )
    return MdfReader(path)


class MdfReader:
    """Numeric channels, in blocks of rows."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._budget = current(path)
        self.library = library("asammdf")
        self.refused: dict[str, str] = {}
        self._place: dict[str, tuple[int, int]] = {}
        self._raw = MeteredFile(path, self._budget)  # a file of our own is closed whatever happens in there
        with closing(self._raw), parsing(path, WHAT):
            self._file = _opened(self._raw)
            self._raw.metered = False
            self.groups = tuple(g for i in range(len(self._file.groups)) if (g := self._group(i)).columns)

    def _group(self, index: int) -> Group:
        group = self._file.groups[index]
        rows = int(group.channel_group.cycles_nr)
        self._check_size(group, rows, index)
        columns = [self._column(index, i, channel, rows) for i, channel in enumerate(group.channels)]
        return Group(name=f"{index}", rows=rows, columns=tuple(c for c in columns if c is not None))

    def _check_size(self, group: Any, rows: int, index: int) -> None:
        """A cut file announces more rows than its blocks can hold."""
        sizes = [block.original_size for block in group.get_data_blocks()]
        stored = sum(sizes)
        # asammdf unfolds a whole block for every channel that is looked at
        self._budget.hold(2 * max(sizes, default=0), f"a block of group {index}")
        self._budget.spend(max(sizes, default=0) * len(group.channels) // LOOKS)
        width = int(group.channel_group.samples_byte_nr)
        if rows and width and stored < rows * width:
            raise LogFormatError(
                self._path,
                f"announces {rows} rows in group {index} and holds {stored // width}: truncated?",
                stored // width,
            )

    def _column(self, index: int, i: int, channel: Any, rows: int) -> Column | None:
        once = len(self._file.channels_db.get(channel.name, ())) <= 1
        name = channel.name if once else f"{index}/{channel.name}"
        self._place[name] = index, i
        if not rows:
            return None
        if _has_formula(channel.conversion):
            self.refused[name] = "is converted by a formula in the file, which is not evaluated"
            return None
        try:
            sample = self._get(name, 0, 1)
        except Exception as error:  # asammdf raises anything at a damaged channel; the others may be whole
            self.refused[name] = f"cannot be decoded ({error})"
            return None
        if sample.ndim != 1 or sample.dtype.kind not in "fiub":
            self.refused[name] = f"holds {sample.dtype}, not numbers"
            return None
        return Column(name=name, type=sample.dtype.name, unit=channel.unit or "")

    def _get(self, name: str, start: int, stop: int) -> NDArray[Any]:
        group, index = self._place[name]
        values, invalid = self._file.get(
            group=group, index=index, samples_only=True, record_offset=start, record_count=stop - start
        )
        found = np.asarray(values)
        return np.where(invalid, np.nan, found) if invalid is not None and np.any(invalid) else found

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """See `Reader`. A channel that the file marks invalid is NaN."""
        return sliced(self._path, WHAT, group, columns, self._get)

    def close(self) -> None:
        """See `Reader`."""
        self._file.close()
        self._raw.close()


def _has_formula(conversion: Any, depth: int = 0) -> bool:
    """Whether a conversion, or one that it refers to, is text to be evaluated: asammdf would run it."""
    if depth > DEEPEST or bool(getattr(conversion, "formula", None)):
        return True
    refers = getattr(conversion, "referenced_blocks", None) or {}
    return any(_has_formula(one, depth + 1) for one in refers.values())


def _opened(raw: Any) -> Any:
    from asammdf import MDF

    try:
        return MDF(raw, raise_on_multiple_occurrences=False)
    except Exception as error:
        for frame, _ in walk_tb(error.__traceback__):
            half: Any = frame.f_locals.get("self")
            if hasattr(half, "_closed") and hasattr(half, "_tempfile"):  # its finaliser would complain on stderr
                half._closed = True
                half._tempfile.close()
        raise
