"""How far compiling is: functions that are ready, of those that are known to be needed, and the time it has taken."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread

SLOW_S, EVERY_S = 6.0, 5.0
"""When a compilation is told that was not announced, and how often the count is printed, s."""


def line(ready: int, needed: int) -> None:
    """Print the count on stderr, if there is one."""
    with suppress(OSError, ValueError, AttributeError):
        how_far = f"{ready} of {needed} functions"
        sys.stderr.write(f"crossbody: compiling the reference for this processor, once: {how_far}\n")
        sys.stderr.flush()


def nothing(_ready: int, _needed: int) -> None:
    """Leave the count untold."""


class Count:
    """What this process knows to be needed and ready; functions go by their names with the module's before.

    Args:
        every: how long nothing is told after something was, s.
        show: is given how many are ready, and how many are needed.
    """

    def __init__(self, every: float = EVERY_S, show: Callable[[int, int], None] = line) -> None:
        self.every, self.show = every, show
        self.needed, self.ready = set[str](), set[str]()
        self.pass_on: Callable[[str], object] = lambda _name: None
        self.told = False
        self._last, self._since, self._spent = 0.0, 0.0, 0.0

    def need(self, names: Iterable[str]) -> None:
        """Add functions that will be compiled."""
        self.needed.update(names)

    def done(self, name: str) -> None:
        """Count a function that is ready, here or in another process."""
        self.pass_on(name)
        if name in self.ready:
            return
        self.ready.add(name)
        due = time.monotonic() - self._last >= self.every or not self.needed - self.ready
        if name in self.needed and self.told and due:
            self.tell()

    def tell(self) -> None:
        """Say how far it is, from now on again and again until all is ready."""
        self.told, self._last = True, time.monotonic()
        self.show(len(self.ready & self.needed), len(self.needed))

    def _keep_telling(self, ended: Event) -> None:
        """Say how far it is where it takes long, and then again: one function alone may take longer than `every`."""
        while not ended.wait(self.every or EVERY_S if self.told else SLOW_S):
            due = self.every and time.monotonic() - self._last >= self.every
            if not self.told or (due and self.needed - self.ready):
                self.tell()

    @contextmanager
    def shown(self, show: Callable[[int, int], None], every: float = 0.0) -> Iterator[None]:
        """Tell it in another way for a while."""
        before = self.show, self.every
        self.show, self.every = show, every
        try:
            yield
        finally:
            self.show, self.every = before

    @property
    def seconds(self) -> float:
        """Time that this process has compiled, or waited for another that does, s."""
        return self._spent + (time.perf_counter() - self._since if self._since else 0.0)

    @contextmanager
    def clocked(self) -> Iterator[None]:
        """Count the time within; say how far it is where it takes long. Within another, do nothing."""
        if self._since:
            yield
            return
        self._since = time.perf_counter()
        ended = Event()
        Thread(target=self._keep_telling, args=(ended,), daemon=True).start()
        try:
            yield
        finally:
            ended.set()
            self._spent, self._since = self.seconds, 0.0


count = Count()


def silence() -> None:
    """Tell nothing from now on: another process does."""
    count.show = nothing
