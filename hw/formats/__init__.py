"""How a log is read: one module a format, found by what the file begins with.

A format is a module here with these public names; its third-party library is imported by `open_log` only:

    SUFFIXES                     endings of its files, for messages and for the choice between formats
    Options                      a msgspec.Struct: what `[options]` of a column map may say to it
    recognises(path, head)       whether the file (or folder) is one of this format; head is its first 4096 bytes
    open_log(path, options)      a `Reader`
"""

from __future__ import annotations

import stat
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from crossbody.cases import ColumnMapError, FormatUnavailable, LogFormatError
from crossbody.cases.public_names import check_values
from crossbody.cases.registry import Registry
from crossbody.cases.regular import open_regular
from crossbody.hw.budget import MEMORY, Budget, opening
from crossbody.hw.formats._bounded import Bounded
from crossbody.hw.formats._contract import BLOCK_ROWS, READER, Block, Column, Group, Reader

__all__ = [
    "BLOCK_ROWS",
    "MEMORY",
    "Block",
    "Column",
    "Group",
    "Reader",
    "load",
    "names",
    "open_log",
    "options",
    "recognise",
    "summary",
]

HEAD = 4096


_REGISTRY = Registry("log format", __name__)
names, summary = _REGISTRY.names, _REGISTRY.summary  # readable here or not: nothing is imported


def load(name: str) -> ModuleType:
    """The module of a format.

    Raises:
        UnknownName: if there is no such format; the message lists the names.
        FormatUnavailable: if a package is not installed.
    """
    try:
        return _REGISTRY.load(name)
    except ModuleNotFoundError as error:
        raise _lacking(name, error) from None


def _lacking(name: str, error: ModuleNotFoundError) -> FormatUnavailable:
    return unavailable(f"Log format {name!r}", error, ours=name in _REGISTRY.own())


def unavailable(who: str, error: ModuleNotFoundError, *, ours: bool = True) -> FormatUnavailable:
    """The error for an absent package, of which ours are in one extra; a broken import of our own stays loud."""
    package = (error.name or "").partition(".")[0]
    if package in ("", "crossbody"):
        raise error
    brings = "crossbody[logs]" if ours else package
    return FormatUnavailable(
        f"{who} needs the package {package!r}, which is not installed; install it with: pip install {brings!r}"
    )


def recognise(path: Path) -> str:
    """Name of the format that a file or folder is written in."""
    head = _head(path)
    found = [name for name in names() if load(name).recognises(path, head)]
    if len(found) == 1:
        return found[0]
    if found:
        raise LogFormatError(path, f"could be {' or '.join(found)}; set `format` in the column map.")
    if path.is_dir():
        raise LogFormatError(path, "is a folder; name a file, or the folder of a ROS 2 bag (with its metadata.yaml).")
    if promised := [name for name in names() if path.suffix.lower() in load(name).SUFFIXES]:
        raise LogFormatError(path, f"does not begin as {' or '.join(promised)} files do: damaged, or a wrong name.")
    known = ", ".join(f"{name} ({' '.join(load(name).SUFFIXES)})" for name in names())
    raise LogFormatError(path, f"is in no known log format (it begins with {head[:8].hex(' ')}). Known: {known}.")


def _head(path: Path) -> bytes:
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            return b""
        if not stat.S_ISREG(mode):
            raise LogFormatError(path, "is a device or a pipe; name a file.")
        with open_regular(path) as file:
            head = file.read(HEAD)
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    if not head:
        raise LogFormatError(path, "is empty.")
    return head


def _unreadable(path: Path, error: Exception) -> Exception:
    if isinstance(error, LogFormatError):
        return error
    reason = getattr(error, "strerror", None) or str(error)
    return LogFormatError(path, f"cannot be read: {reason}.")


def options(name: str, given: Mapping[str, Any]) -> Any:
    """The options of a format, as its own type."""
    import msgspec

    try:
        return msgspec.convert(given, load(name).Options, strict=True)
    except msgspec.ValidationError as error:
        told, _, where = str(error).partition(" - at `$")
        known = ", ".join(load(name).Options.__struct_fields__) or "none"
        raise ColumnMapError("column map", "$.options" + where.rstrip("`"), f"{told}; {name} has: {known}.") from None


def open_log(path: Path, name: str | None = None, options: Any = None, memory: int = MEMORY) -> Bounded:
    """Open a log for reading.

    Args:
        path: file, or folder for formats that are one.
        name: the format; recognised by the file's beginning if not given.
        options: the format's own `Options`; its defaults if not given.
        memory: bytes over the file's own size that reading it may take.

    Raises:
        LogFormatError: if it cannot be read as that format, or not within that memory.
        FormatUnavailable: if the format's package is not installed.
        UnknownName: for a format that does not exist.
    """
    chosen = name or recognise(path)
    module = load(chosen)
    if name is not None and not module.recognises(path, _head(path)):
        raise LogFormatError(path, f"does not begin as {name} files do: damaged, or in another format.")
    budget = Budget(path, memory)
    try:
        with opening(budget):
            own = module.open_log(path, module.Options() if options is None else options)
            check_values(f"What open_log of the log format {chosen!r} returns", own, READER)
            reader = Bounded(path, own, budget)
    except ModuleNotFoundError as error:
        raise _lacking(chosen, error) from None
    if not reader.groups:
        reader.close()
        why = next((f" ({column} {text})" for column, text in reader.refused.items()), "")
        raise LogFormatError(path, f"holds no column of numbers{why}.")
    return reader
