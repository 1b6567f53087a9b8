"""The entry point of a shell: ready for Ctrl-C before anything that takes long to import."""

from __future__ import annotations

import gc
import os
import signal
import sys
from types import FrameType

FIRST, FRESH = 200_000, 20_000
"""Objects after which garbage is looked for at first, and later on: imports make a hundred thousand, all to stay."""


def main() -> None:
    """Run the command `crossbody`."""
    signal.signal(signal.SIGINT, _leave)
    # A stream that the caller has closed is None, and its number would be given to the next file that is opened.
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            os.dup2(os.open(os.devnull, os.O_RDWR), number)
            setattr(sys, name, open(number, "r" if number == 0 else "w", closefd=False))  # noqa: SIM115
    os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn with it, and it would look for windows at length
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # no matrix here is large enough that waiting for others pays
    gc.set_threshold(FIRST)
    gc.callbacks.append(_look_more_often)
    from crossbody.reports import cli

    try:
        cli.main()
    finally:  # what is done is done; the interpreter goes back to the default at its end, which would say nothing
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _look_more_often(_phase: str, _told: dict[str, int]) -> None:
    gc.callbacks.remove(_look_more_often)
    gc.set_threshold(FRESH)


def _leave(_number: int, _frame: FrameType | None) -> None:
    """End at once: an exception might be swallowed by what is being imported."""
    os.write(2, b"crossbody: interrupted.\n")
    os._exit(128 + signal.SIGINT)
