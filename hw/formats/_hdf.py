"""What HDF5 and MAT v7.3 share: datasets as columns, streamed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crossbody.hw.formats._contract import Block, Group
from crossbody.hw.formats._grouping import Table, grouped, layout, place, spans
from crossbody.hw.formats._guard import library, parsing

SIGNATURE = b"\x89HDF\r\n\x1a\n"


class HdfReader:
    """Numeric datasets, fields of compound ones too; links out of the file are not followed.

    Args:
        path: the file.
        what: name of the format, for messages.
        joint: between the names of a group and its member.
    """

    def __init__(self, path: Path, what: str, joint: str) -> None:
        import h5py

        self._path, self._what, self._joint = path, what, joint
        self.library = library("h5py")
        self.refused: dict[str, str] = {}
        self._tables: list[Table] = []
        with parsing(path, what):
            self._file = h5py.File(path, "r")
            self._file.visititems(self._visit)
        self.groups = grouped(self._tables)

    def _visit(self, key: str, item: Any) -> None:
        import h5py

        if not isinstance(item, h5py.Dataset) or key.startswith("#"):
            return
        name = key.replace("/", self._joint)
        why = self.why_not(item) or _missing(item)
        if why:
            self.refused[name] = why
        else:
            self._add(key, name, item)

    def why_not(self, item: Any) -> str:
        """Why a dataset is no column of numbers; empty if it may be one."""
        plain = [item.dtype[n] for n in item.dtype.names] if item.dtype.names else [item.dtype]
        if any(dtype.kind not in "fiub" for dtype in plain):
            return f"holds {item.dtype}, not numbers"
        return "" if layout(item.shape) else f"has shape {item.shape}, which is no table"

    def _add(self, key: str, name: str, item: Any) -> None:
        rows, width, axis = layout(item.shape) or (0, None, 0)
        unit = _text(item.attrs.get("unit", item.attrs.get("units", "")))
        for field in item.dtype.names or ("",):
            dtype = item.dtype[field] if field else item.dtype
            self._tables.append(
                Table(
                    key=key, name=f"{name}{self._joint}{field}" if field else name, type=dtype.name, rows=rows,
                    width=width, axis=axis, unit=unit, field=field,
                )
            )  # fmt: skip

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """See `Reader`."""
        wanted = {name: place(self._tables, name) for name in columns}
        for start, stop in spans(group.rows or 0):
            block: Block = {}
            for name, (table, element) in wanted.items():
                with parsing(self._path, self._what, start, name):
                    block[name] = self._slice(table, element, start, stop)
            yield block

    def _slice(self, table: Table, element: int | None, start: int, stop: int) -> Any:
        item = self._file[table.key]
        where: Any = slice(start, stop)
        if item.ndim == 2:
            where = (where, element or 0) if table.axis == 0 else (element or 0, where)
        found = np.asarray(item[where])
        return found[table.field] if table.field else found

    def close(self) -> None:
        """See `Reader`."""
        self._file.close()


def _missing(item: Any) -> str:
    """Why a dataset's numbers are not all in this file; empty if they are."""
    if item.external or item.is_virtual:
        return "keeps its numbers in another file"
    chunks = math.prod(-(-n // c) for n, c in zip(item.shape, item.chunks, strict=True)) if item.chunks else 0
    if item.chunks and item.id.get_num_chunks() < chunks:
        return "is declared but not written in full: cut off?"
    if not item.chunks and item.size and not item.id.get_storage_size():
        return "is declared but never written: cut off?"
    return ""


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value if isinstance(value, str) else ""
