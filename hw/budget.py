"""How much a file may unfold to: a stated memory while it is read, and a bounded amount of numbers in all.

Readers refuse by the sizes that a file declares (`Budget.hold`) and by those that they meet
(`Budget.spend`). Behind both stands a last resort: while a library parses, the process may not
grow beyond the budget (`Budget.guard`), so that an unchecked declaration ends in the library's
own failure to allocate, not in the machine's.
"""

from __future__ import annotations

import math
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from crossbody.cases import LogFormatError, arguments

MOST_COLUMNS = 10_000  # of a file: each costs a few kilobytes and half a millisecond of checks
MEMORY = 1 << 30  # bytes over the file's own size
PATIENCE = 7.0  # s of processor time for a file of up to `PATIENT` bytes
PATIENT = 5_000_000  # the slowest log that is known, JSON of a resting rig, compressed, is read at 1e6 bytes a second
SLOWEST = 250e3  # bytes of what is larger that are read in a second at least
PART = 4  # of the memory, what a file of no size may unfold to: 3e7 numbers, which take seconds to check
RATIO = 100  # numbers to file: a log of changing numbers reaches 10, zeros in deflate 1000
BLOCK = 512  # bytes of `st_blocks`, whatever the file system
FIELD = 5  # of /proc/self/statm: pages of private writable memory, which RLIMIT_DATA bounds


class Budget:
    """What reading one file may cost.

    Args:
        path: the file, or the folder of a log.
        memory: bytes over the file's own size that may be in memory at once.

    Attributes:
        size: bytes that the file occupies on its disk; holes, which cost nothing to declare, do not count.
        memory: bytes that may be in memory at once.
        most: bytes that may be decoded in all.
        seconds: of processor time that parsing may take in all.
        taken: of it so far.
    """

    def __init__(self, path: Path, memory: int = MEMORY) -> None:
        memory = arguments.whole("memory (bytes)", memory)
        self._path = path
        self.size = _occupied(path)
        self.memory, self.most = memory + self.size, memory // PART + RATIO * self.size
        self.seconds = (PATIENCE + max(self.size - PATIENT, 0) / SLOWEST) * max(1.0, memory / MEMORY)
        self._spent, self.taken, self._entered = 0, 0.0, math.nan
        self._ceiling = min(_private() + self.memory, sys.maxsize)

    def hold(self, declared: int, what: str) -> None:
        """Refuse something that would be in memory at once and is larger than that may be."""
        if declared > self.memory:
            text = f"{what} needs {_shown(declared)} in memory; {self._hint(self.memory)}"
            raise LogFormatError(self._path, text)

    def spend(self, decoded: int) -> None:
        """Count what was decoded, and look at the clock of this thread."""
        taken = self.taken + (0.0 if math.isnan(self._entered) else time.thread_time() - self._entered)
        if taken > self.seconds:
            text = f"takes more than {self.seconds:.3g} s to decompress, which no valid log of {_shown(self.size)} does"
            text += " (`memory` raises the limit)."
            raise LogFormatError(self._path, text)
        self._spent += decoded
        if self._spent > self.most:
            raise LogFormatError(self._path, f"decompresses to more than {_shown(self.most)}; {self._hint(self.most)}")

    @contextmanager
    def guard(self) -> Iterator[None]:
        """Bound the private memory of the process while a library parses; where there are other threads, do nothing.

        The bound is one of the process: threads that have nothing to do with the file must not meet it.
        """
        before = _lowered(self._ceiling)
        self._entered = time.thread_time()
        try:
            yield
        except (MemoryError, LogFormatError) as error:
            if not _denied(error):
                raise
            text = f"cannot be read within {_shown(self.memory)}; {self._hint(self.memory)}"
            raise LogFormatError(self._path, text) from error
        finally:
            self.taken += time.thread_time() - self._entered
            self._entered = math.nan
            if before is not None:
                _set(before)

    @contextmanager
    def lifted(self) -> Iterator[None]:
        """Do not count what is taken in here, addresses that a library reserves once and does not use."""
        before = _private()
        bounds = _raised()
        try:
            yield
        finally:
            grown = max(_private() - before, 0)
            self._ceiling = min(self._ceiling + grown, sys.maxsize)
            if bounds is not None:
                _set((min(bounds[0] + grown, sys.maxsize), bounds[1]))

    def _hint(self, limit: int) -> str:
        return f"the limit is {_shown(limit)} for a file of {_shown(self.size)} (`memory` raises it)."


def _shown(count: int) -> str:
    return next(f"{count / size:.3g} {unit}" for size, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB"), (1, "bytes"))
                if count >= size or size == 1)  # fmt: skip


def _occupied(path: Path) -> int:
    """Bytes on disk of a file, or of the files in a folder; 0 for what cannot be looked at."""
    try:
        files = [one for one in path.iterdir() if one.is_file()] if path.is_dir() else [path]
        found = [one.stat() for one in files]
    except OSError:
        return 0
    return sum(min(one.st_size, getattr(one, "st_blocks", one.st_size) * BLOCK) for one in found)


def _private() -> int:
    """Private writable memory of this process, bytes; 0 where the system does not tell."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[FIELD]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0


def _lowered(ceiling: int) -> tuple[int, int] | None:
    """Lower the bound of this process's private memory; what it was, None if nothing was changed."""
    if threading.active_count() > 1 or not _private():
        return None
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if soft != resource.RLIM_INFINITY and soft <= ceiling:
        return None
    _set((ceiling if hard == resource.RLIM_INFINITY else min(ceiling, hard), hard))
    return soft, hard


def _raised() -> tuple[int, int] | None:
    """Raise the bound of the process's private memory as far as it goes; return what it was, None if none."""
    if not _private():
        return None
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if soft == resource.RLIM_INFINITY:
        return None
    _set((hard, hard))
    return soft, hard


def _set(bounds: tuple[int, int]) -> None:
    import resource

    resource.setrlimit(resource.RLIMIT_DATA, bounds)


def _denied(error: BaseException | None) -> bool:
    """Whether memory was denied to what raised the error, or to what caused that."""
    while error is not None:
        if isinstance(error, MemoryError):
            return True
        error = error.__cause__ or error.__context__
    return False


_current: ContextVar[Budget | None] = ContextVar("crossbody_log_budget", default=None)


@contextmanager
def opening(budget: Budget) -> Iterator[None]:
    """Let the reader that is opened here find its budget by `current`."""
    token = _current.set(budget)
    try:
        with budget.guard():
            yield
    finally:
        _current.reset(token)


def current(path: Path) -> Budget:
    """The budget of the log that is being opened; one of the default size outside of that."""
    return _current.get() or Budget(path)
