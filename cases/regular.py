"""Files that somebody else may have put there, opened without waiting for a writer that never comes."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO


def open_regular(path: str | Path, flags: int = 0, folder: int | None = None) -> BinaryIO:
    """Open a regular file for reading; a pipe, which would wait for a writer, and a device are refused.

    Flags are of `os.open`, beside reading; the path is relative to the folder whose descriptor is
    given.
    """
    never_wait = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_CLOEXEC", 0)
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0) | never_wait | flags, dir_fd=folder)
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "it is a folder, a pipe or a device", str(path))
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise
