"""Processes that end with the one that began them, whatever ends that."""

from __future__ import annotations

import ctypes
import signal

_PARENT_DEATH = 1  # PR_SET_PDEATHSIG


def die_with_parent() -> None:
    """Have the system end this process with its parent, where it can."""
    try:
        ctypes.CDLL(None).prctl(_PARENT_DEATH, signal.SIGKILL)
    except (OSError, AttributeError):
        return
