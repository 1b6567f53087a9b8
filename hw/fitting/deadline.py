"""When an identification has to stop, whatever it is doing."""

from __future__ import annotations

import math
import time


class TimeOver(Exception):  # noqa: N818 - no error: it ends an identification
    """The time for all of it is over."""


class Deadline:
    """A time limit, s from now on, that is looked at before every run of a window."""

    def __init__(self, seconds: float = math.inf) -> None:
        self.seconds, self._end = seconds, time.monotonic() + seconds

    def check(self) -> None:
        """Go on, or stop.

        Raises:
            TimeOver: if the time is over.
        """
        if time.monotonic() > self._end:
            raise TimeOver
