"""What keeps one run from stopping all others: a bound on its time, and its output kept apart."""

from __future__ import annotations

import ctypes
import faulthandler
import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

AGAIN = 1.0  # time after which a run that did not notice is signalled again, s
HARD, HARD_LEAST = 10.0, 60.0
"""A process whose run takes so many times its bound, and at least so many seconds more, is ended."""


class Overdue(BaseException):
    """A run took longer than it may; not an Exception, so that no engine takes it for one of its own."""


@contextmanager
def bounded(seconds: float) -> Iterator[None]:
    """Raise Overdue in this thread when the time is up, between two instructions of the interpreter.

    Works in any thread of a process, as a signal would not. What never comes back to the
    interpreter is not stopped by this; `killed` ends the process then.
    """
    bell = _Bell(seconds)
    try:
        bell.wind(seconds)
        yield
    finally:
        try:
            bell.stop()
        except Overdue:  # it came before the bell was held
            bell.stop()


class _Bell:
    def __init__(self, seconds: float) -> None:
        self.thread, self.lock = threading.get_ident(), threading.Lock()
        self.rung, self.done = False, False
        self.timer: threading.Timer | None = None

    def wind(self, seconds: float) -> None:
        self.timer = threading.Timer(seconds, self._ring)
        self.timer.daemon = True
        self.timer.start()

    def _ring(self) -> None:
        with self.lock:
            if not self.done:
                self.rung = True
                _overdue(self.thread)
                self.wind(AGAIN)

    def stop(self) -> None:
        """Let no ring come after this; one that may be on its way is waited for.

        Taking it back (`PyThreadState_SetAsyncExc` with NULL) would leave the interpreter's mark
        that one is due, which only an exception that arrives clears: with it a profiler or a
        debugger stays at a function's first instruction for ever.
        """
        with self.lock:
            self.done = True
        if self.timer is not None:
            self.timer.cancel()
        if self.rung:
            with suppress(Overdue):
                _overdue(self.thread)  # in place of one on its way
                while True:
                    pass


def _overdue(thread: int) -> None:
    """Have a thread raise Overdue at its next instruction that looks for it."""
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(Overdue))


@contextmanager
def killed(seconds: float) -> Iterator[None]:
    """End this process if the block takes much longer than it may: it hangs where no exception reaches it."""
    faulthandler.dump_traceback_later(HARD * seconds + HARD_LEAST, exit=True, file=sys.__stderr__ or 2)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


@contextmanager
def overheard(heard: list[str]) -> Iterator[None]:
    """Append what the block writes to the process's stdout and stderr, libraries in C included."""
    saved = os.dup(1), os.dup(2)
    with tempfile.TemporaryFile() as file:
        try:
            for target in (1, 2):
                os.dup2(file.fileno(), target)
            yield
        finally:
            for stream in (sys.stdout, sys.stderr):
                stream.flush()
            for target, kept in zip((1, 2), saved, strict=True):
                os.dup2(kept, target)
                os.close(kept)
            file.seek(0)
            if text := file.read(2000).decode(errors="replace").strip():
                heard.append(text)
