"""Which bytes a log was read from, and which numbers it holds."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from crossbody.cases import LogFormatError
from crossbody.cases.regular import open_regular
from crossbody.hw.reading.rows import Floats

CHUNK = 1 << 20


def file_hash(path: Path) -> str:
    """SHA-256 of a file, or of the names and contents of a folder's files in the order of their names.

    Raises:
        LogFormatError: if it cannot be read.
    """
    digest = hashlib.sha256()
    try:
        for file in sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]:
            if path.is_dir():
                digest.update(file.relative_to(path).as_posix().encode() + b"\0")
            _update(digest, file)
    except OSError as error:
        raise LogFormatError(path, f"cannot be read: {error.strerror}.") from None
    return digest.hexdigest()


def _update(digest: hashlib._Hash, file: Path) -> None:
    with open_regular(file) as stream:
        while chunk := stream.read(CHUNK):
            digest.update(chunk)


class ContentHash:
    """SHA-256 of named columns of float64, fed block by block; how they are cut or compressed does not matter.

    Args:
        names: names of the columns with their units, in order.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._names = tuple(names)
        self._columns = [hashlib.sha256() for _ in self._names]

    def see(self, columns: Iterable[Floats]) -> None:
        """The next block of every column."""
        for digest, values in zip(self._columns, columns, strict=True):
            digest.update(np.ascontiguousarray(values, dtype="<f8").data)

    def hexdigest(self) -> str:
        """The hash of all names and columns."""
        whole = hashlib.sha256()
        for name, digest in zip(self._names, self._columns, strict=True):
            whole.update(name.encode() + b"\0" + digest.digest())
        return whole.hexdigest()
