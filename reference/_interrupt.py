"""Ctrl-C during a run: noted while compiled code is at work, raised between two slices."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any, Self

LONG_S = 1e-3  # a slice as long as this makes it worth to note interrupts, which takes some 5 us, s


class Interrupts:
    """Hold SIGINT back from `hold` on, to the next `answer` or the end of the block.

    The libraries through which compiled code is entered run Python of their own, and may take a
    KeyboardInterrupt that meets them there for a fault of what they were given.
    """

    def __init__(self) -> None:
        self._former: Callable[[int, FrameType | None], Any] | None = None
        self._noted = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._former is not None:
            signal.signal(signal.SIGINT, self._former)
            self.answer()

    def hold(self) -> None:
        """Note interrupts from now on; a handler that is no Python function, or another thread, is left alone."""
        former = signal.getsignal(signal.SIGINT)
        if self._former is None and callable(former) and threading.current_thread() is threading.main_thread():
            self._former = former
            signal.signal(signal.SIGINT, self._note)

    def answer(self) -> None:
        """Hand an interrupt that was noted to its handler, which raises KeyboardInterrupt as a rule."""
        if self._noted and self._former is not None:
            self._noted = False
            self._former(signal.SIGINT, None)

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        self._noted = True
