"""MATLAB files up to version 7 (MAT v5), by scipy; objects are refused, never built."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crossbody.cases import LogFormatError
from crossbody.hw.budget import current
from crossbody.hw.formats._contract import Block, Group
from crossbody.hw.formats._mat_elements import described, starts, whole_variable
from crossbody.hw.formats._tables import NoOptions as Options
from crossbody.hw.formats._tables import Table, grouped, layout, places, sliced
from crossbody.hw.guard import library, parsing

SUFFIXES = (".mat",)
HINT = "save plain arrays or structs instead (a timetable: its columns; an object: struct(object))"
NUMBERS = {"double", "single", "logical", *(f"{s}int{n}" for s in ("", "u") for n in (8, 16, 32, 64))}


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as MAT v5 does."""
    return head.startswith(b"MATLAB 5.0 MAT-file") or (head[124:128] in (b"\x00\x01IM", b"\x01\x00MI"))


def open_log(path: Path, options: Options) -> MatReader:
    """Open a MAT v5 file."""
    return MatReader(path)


class MatReader:
    """Numeric arrays, also those in structs; `s.signals.values[1]` is the second column of that field."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._budget = current(path)
        self.library = library("scipy")
        self.refused: dict[str, str] = {}
        self._tables: list[Table] = []
        self._structs: dict[str, Any] = {}
        self._begins: dict[str, int] = {}
        with parsing(path, "MAT file"):
            for start in starts(path):
                name, shape, kind = described(path, start)
                self._begins[name] = start
                self._list(name, shape, kind)
                self._budget.spend(0)
        self.groups = grouped(self._tables)
        self._places = places(self._tables)

    def _list(self, name: str, shape: tuple[int, ...], kind: str) -> None:
        if kind == "struct":
            self._structs[name] = self._variable(name)
            self._walk(name, name, self._structs[name])
        elif kind not in NUMBERS:
            self.refused[name] = f"is a MATLAB {kind}: {HINT}"
        else:
            self._add(name, name, shape, np.dtype({"double": "f8", "single": "f4", "logical": "u1"}.get(kind, kind)))

    def _add(self, key: str, name: str, shape: Sequence[int], dtype: np.dtype[Any]) -> None:
        if (found := layout(shape)) is None:
            self.refused[name] = f"has shape {tuple(shape)}, which is not a table"
            return
        rows, width, axis = found
        self._tables.append(Table(key=key, name=name, type=dtype.name, rows=rows, width=width, axis=axis))

    def _walk(self, key: str, name: str, value: Any) -> None:
        """List the fields of a struct; anything but structs and numbers is refused by name."""
        if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1 and type(value) is np.ndarray:
            for field in value.dtype.names:
                self._walk(key, f"{name}.{field}", value.flat[0][field])
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
            self._add(key, name, value.shape, value.dtype)
        else:
            self.refused[name] = f"is a MATLAB {_kind(value)}: {HINT}"

    def _variable(self, name: str) -> Any:
        """A variable, decoded by itself; what a struct holds is only known when it has been."""
        from scipy.io import loadmat

        whole: Any = whole_variable(self._path, self._begins[name], self._budget)
        return loadmat(whole, mat_dtype=False)[name]

    def _load(self, tables: Iterable[Table]) -> dict[str, Any]:
        """The variables of some columns, whole."""
        plain = {table.key: table for table in tables if table.key not in self._structs}
        size = sum(table.rows * (table.width or 1) * np.dtype(table.type).itemsize for table in plain.values())
        self._budget.hold(size, "what the columns announce")
        with parsing(self._path, "MAT file"):
            return self._structs | {key: self._variable(key) for key in plain}

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """See `Reader`. A MAT variable can only be read whole, so the wanted ones are in memory together."""
        loaded = self._load(self._places[name][0] for name in columns)
        arrays = {name: self._inside(loaded, *self._places[name]) for name in columns}
        yield from sliced(self._path, "MAT file", group, columns, lambda name, start, stop: arrays[name][start:stop])

    def _inside(self, loaded: dict[str, Any], table: Table, element: int | None) -> Any:
        """One whole column."""
        value = loaded[table.key]
        for field in table.name.split(".")[1:]:
            value = value.flat[0][field]
        if value.ndim == 2 and table.width is None:
            value = value.reshape(-1)
        if len(value.reshape(-1)) < table.rows:
            raise LogFormatError(self._path, f"has {value.size} of {table.rows} numbers.", column=table.name)
        return np.moveaxis(value, table.axis, 0)[:, element or 0] if value.ndim == 2 else value

    def close(self) -> None:
        """See `Reader`."""


def _kind(value: Any) -> str:
    kinds = {"MatlabObject": "object", "MatlabOpaque": "object", "MatlabFunction": "function handle"}
    if type(value).__name__ in kinds:
        return kinds[type(value).__name__]
    array = np.asarray(value)
    return "struct array" if array.dtype.names else "cell array" if array.dtype == object else "char array"
