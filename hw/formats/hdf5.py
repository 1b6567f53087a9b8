"""HDF5, by h5py."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crossbody.cases import LogFormatError
from crossbody.hw.budget import current
from crossbody.hw.formats._contract import Block, Group
from crossbody.hw.formats._tables import NoOptions as Options
from crossbody.hw.formats._tables import Table, grouped, layout, places, sliced
from crossbody.hw.guard import closing, library, parsing

SUFFIXES = (".h5", ".hdf5", ".hdf")
SIGNATURE = b"\x89HDF\r\n\x1a\n"
MOST_LINKS = 20_000  # of a file, whatever they lead to: each takes some 70 us
MOST_CHUNKS, TINY = 50_000, 1024  # chunks of a dataset, where they have fewer bytes than this: each takes some 20 us
DEEPEST = 32  # groups inside one another; the library itself recurses without an end
LONGEST = 4096  # bytes of an attribute that is read
CACHE = 1 << 20  # bytes of chunks that HDF5 keeps of its own accord
SLOTS = 521  # places of its table of chunks; a prime, as it asks for


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as HDF5 does, with or without a user block that is not MATLAB's."""
    return not head.startswith(b"MATLAB") and any(head[n : n + 8] == SIGNATURE for n in (0, 512, 1024, 2048))


def open_log(path: Path, options: Options) -> HdfReader:
    """Open an HDF5 file; columns are named by their path, `rig/angle[0]`."""
    return HdfReader(path, "HDF5 file", "/")


class HdfReader:
    """Numeric datasets, fields of compound ones too; links out of the file are not followed.

    `joint` stands between the names of a group and its member.
    """

    def __init__(self, path: Path, what: str, joint: str) -> None:
        import h5py

        self._path, self._what, self._joint = path, what, joint
        self._budget = current(path)
        self.library = library("h5py")
        self.refused: dict[str, str] = {}
        self._tables: list[Table] = []
        self._visited: set[int] = set()
        self._links = 0
        with parsing(path, what):
            self._file = h5py.File(path, "r")
        with closing(self._file), parsing(path, what):
            self._walk("", self._file, 0)
        self.groups = grouped(self._tables)
        self._places = places(self._tables)

    def _walk(self, prefix: str, group: Any, depth: int) -> None:
        """List the datasets below a group, each object once, whatever links lead to it."""
        import h5py

        if depth > DEEPEST:
            raise LogFormatError(self._path, f"has groups inside groups beyond {DEEPEST} levels.")
        for name in group:
            self._links += 1
            if self._links > MOST_LINKS:
                raise LogFormatError(self._path, f"holds more than {MOST_LINKS} groups, datasets and links to them.")
            if (not prefix and name.startswith("#")) or not isinstance(group.get(name, getlink=True), h5py.HardLink):
                continue
            item = group[name]
            place_in_file = h5py.h5o.get_info(item.id).addr
            if place_in_file in self._visited:
                continue
            self._visited.add(place_in_file)
            if isinstance(item, h5py.Group):
                self._walk(f"{prefix}{name}/", item, depth + 1)
            elif isinstance(item, h5py.Dataset):
                self._list(prefix + name, item)

    def _list(self, key: str, item: Any) -> None:
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
            return f"holds {str(item.dtype)[:LONGEST]}, not numbers"
        if item.shape is None or not layout(item.shape):
            return f"has shape {item.shape}, which is not a table"
        small = item.chunks and math.prod(item.chunks) * item.dtype.itemsize < TINY
        if small and _chunks(item) > MOST_CHUNKS:
            return f"is cut into more than {MOST_CHUNKS} chunks of less than {TINY} bytes: `h5repack` joins them"
        return ""

    def _add(self, key: str, name: str, item: Any) -> None:
        rows, width, axis = layout(item.shape) or (0, None, 0)
        unit = text_of(item, "unit") or text_of(item, "units")
        for field in item.dtype.names or ("",):
            dtype = item.dtype[field] if field else item.dtype
            self._tables.append(
                Table(
                    key=key, name=f"{name}{self._joint}{field}" if field else name,
                    type=dtype.name, rows=rows, width=width, axis=axis, unit=unit, field=field,
                )
            )  # fmt: skip

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """See `Reader`. Every chunk is decoded once: those that a block of rows cuts through are kept."""
        with parsing(self._path, self._what):
            items = self._items({self._places[name][0].key for name in columns})

        def get(name: str, start: int, stop: int) -> Any:
            table, element = self._places[name]
            return _slice(items[table.key], table, element, start, stop)

        yield from sliced(self._path, self._what, group, columns, get)

    def _items(self, keys: set[str]) -> dict[str, Any]:
        """Open datasets that keep as many chunks as one block of rows touches."""
        import h5py

        sizes = {key: _chunk_bytes(self._file[key]) for key in keys}
        self._budget.hold(sum(sizes.values()), "one chunk of every column")
        found = {}
        for key, size in sizes.items():
            access = h5py.h5p.create(h5py.h5p.DATASET_ACCESS)
            access.set_chunk_cache(SLOTS, max(CACHE, size), 1.0)
            found[key] = h5py.Dataset(h5py.h5d.open(self._file.id, key.encode(), access))
        return found

    def close(self) -> None:
        """See `Reader`."""
        self._file.close()


def _slice(item: Any, table: Table, element: int | None, start: int, stop: int) -> Any:
    where: Any = slice(start, stop)
    if item.ndim == 2:
        where = (where, element or 0) if table.axis == 0 else (element or 0, where)
    found = np.asarray(item[where])
    return found[table.field] if table.field else found


def _chunk_bytes(item: Any) -> int:
    """Bytes of the chunks that lie beside one another across the samples; 0 for what is not chunked."""
    if not item.chunks:
        return 0
    other = 1 if item.ndim == 2 and item.shape[0] >= item.shape[1] else 0
    across = -(-item.shape[other] // item.chunks[other]) if item.ndim == 2 else 1
    return int(math.prod(item.chunks) * item.dtype.itemsize * across)


def _chunks(item: Any) -> int:
    """Number of chunks that a dataset's shape asks for; 0 for what is not chunked."""
    return math.prod(-(-n // c) for n, c in zip(item.shape, item.chunks, strict=True)) if item.chunks else 0


def _missing(item: Any) -> str:
    """Why a dataset's numbers are not all in this file; empty if they are."""
    if item.external or item.is_virtual:
        return "keeps its numbers in another file"
    if item.chunks and item.id.get_num_chunks() < _chunks(item):
        return "is declared but not written in full: truncated?"
    if not item.chunks and item.size and not item.id.get_storage_size():
        return "is declared but never written: truncated?"
    return ""


def text_of(item: Any, name: str) -> str:
    """A short text attribute; empty if there is none: nothing is allocated for what a file only declares."""
    import h5py

    if not h5py.h5a.exists(item.id, name.encode()):
        return ""
    found = h5py.h5a.open(item.id, name.encode())
    if found.get_space().get_simple_extent_npoints() != 1 or found.get_storage_size() > LONGEST:
        return ""
    value = item.attrs[name]
    value = value.flat[0] if isinstance(value, np.ndarray) and value.size == 1 else value
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value if isinstance(value, str) else ""
