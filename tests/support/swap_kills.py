"""Kill a process before each system call that it makes while it writes a study; forked children, one a call."""

from __future__ import annotations

import errno
import os
import signal
import sys
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

CALLS = ("posix", "_io", "fcntl")
"""Modules whose functions, and whose objects' methods, reach the system."""


def reaches_the_system(called: Any) -> bool:
    """Whether a built-in function is one that may change what is on disk."""
    owner = getattr(called, "__self__", None)
    return getattr(called, "__module__", None) in CALLS or type(owner).__module__ in CALLS


def killed_before(call: int, work: Callable[[], None]) -> bool:
    """Do work in a child that is killed before its `call`-th system call; whether it was, or else came to its end."""
    child = os.fork()
    if not child:
        left = call

        def strike(_: Any, event: str, called: Any) -> None:
            nonlocal left
            if event == "c_call" and reaches_the_system(called):
                left -= 1
                if not left:
                    os.kill(os.getpid(), signal.SIGKILL)

        sys.setprofile(strike)
        try:
            work()
        finally:
            sys.setprofile(None)
            os._exit(0)
    _, status = os.waitpid(child, 0)
    return os.WIFSIGNALED(status)


ROOM = ("open", "mkdir", "rename", "replace", "link", "write", "__exit__", "fchmod", "chmod")
"""Of these, those that may find the disk full."""


def refused_before(call: int, work: Callable[[], None]) -> bool:
    """Do work whose `call`-th call that needs room on the disk finds none; whether it came to its end before."""
    left = call

    def strike(_: Any, event: str, called: Any) -> None:
        nonlocal left
        if event == "c_call" and reaches_the_system(called) and called.__name__ in ROOM:
            left -= 1
            if not left:
                if called.__name__ == "__exit__":
                    called.__self__.close()  # as the system does that refuses the last bytes
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    sys.setprofile(strike)
    try:
        work()
    finally:
        sys.setprofile(None)
    return left > 0


def everywhere(
    fresh: Callable[[Path], Path], work: Callable[[Path], None], root: Path, stride: int = 1
) -> Iterator[Path]:
    """The folder that every `stride`-th kill leaves, one after another, until the work comes to its end."""
    for call in count(1, stride):
        place = fresh(root / f"{call:05d}")

        def now(place: Path = place) -> None:
            work(place)

        if not killed_before(call, now):
            return
        yield place
