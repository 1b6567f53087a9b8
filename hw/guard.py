"""The border to the libraries that parse foreign bytes: what they raise on damage becomes one sentence."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, TypeVar

from crossbody.cases import CrossbodyError, LogFormatError, installed
from crossbody.hw.budget import current

LENGTH = 160  # of a library's own words
LOGGERS = ("asammdf", "nptdms")

_Found = TypeVar("_Found")
_reserved = False  # whether Arrow's own allocator has its addresses


@contextmanager
def parsing(path: Path, what: str, row: int | None = None, column: str = "") -> Iterator[None]:
    """Run calls into a parser.

    Damaged input makes these libraries raise anything (struct.error, KeyError, zlib.error,
    OverflowError, ...), so everything but an absent package and our own errors is taken as the file's
    fault; the cause stays chained. What they print, a stranger may have written: it is dropped.

    Args:
        path: the log.
        what: what the parser took it for, for example "MAT file".
        row: row that is being read, if one is.
        column: column that is being read, if one is.
    """
    try:
        with warnings.catch_warnings(), _silent(), redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            warnings.simplefilter("ignore")
            yield
    except (CrossbodyError, ModuleNotFoundError):
        raise
    except Exception as error:
        raise fault(path, what, error, row, column) from error


def parsed(path: Path, what: str, found: Iterator[_Found]) -> Iterator[_Found]:
    """What a generator yields that calls into a parser; errors as `parsing`."""
    while True:
        with parsing(path, what):
            one = next(found, None)
        if one is None:
            return
        yield one


@contextmanager
def closing(file: Any) -> Iterator[None]:
    """Close a file where the block does not come to its end: a reader that was never made has nobody who would."""
    try:
        yield
    except BaseException:
        file.close()
        raise


def fault(path: Path, what: str, error: Exception, row: int | None = None, column: str = "") -> LogFormatError:
    """The error for what a parser raised; see `parsing`."""
    return LogFormatError(path, f"is not a readable {what}: {words(error)}.", row, column)


@contextmanager
def plain_allocator(path: Path) -> Iterator[None]:
    """Let Arrow allocate as the C library does, so that what is bounded is what it uses.

    Its own allocator reserves a gigabyte for its first byte, and some of Arrow asks it all the
    same. Within a bound on the process's memory that leaves too little for the rest, and some of
    Arrow's threads and destructors abort the process where memory is denied to them: that byte is
    asked for first, outside of the bound.
    """
    import pyarrow as pa

    global _reserved
    before = pa.default_memory_pool()
    if not _reserved:
        _reserved = True
        with current(path).lifted():
            pa.allocate_buffer(1, memory_pool=before)
    pa.set_memory_pool(pa.system_memory_pool())
    try:
        yield
    finally:
        pa.set_memory_pool(before)


@contextmanager
def _silent() -> Iterator[None]:
    """Keep the loggers of the parsers from writing to stderr: what matters becomes our one sentence."""
    found = list(logging.root.manager.loggerDict.items())
    loggers = [one for name, one in found if name.startswith(LOGGERS) and isinstance(one, logging.Logger)]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def words(error: BaseException) -> str:
    """A library's message on one line, printable and short."""
    text = " ".join(str(error).split()) or type(error).__name__
    text = repr(text)[1:-1] if not text.isprintable() else text
    return (text if len(text) <= LENGTH else text[:LENGTH] + " ...").rstrip(".")


def library(package: str) -> str:
    """Name and version of the package that reads, for provenance."""
    return f"{package} {installed.version(package)}"
