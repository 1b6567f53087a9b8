"""What a run has taken, whatever else the machine does."""

from __future__ import annotations

import time

WAITING = 10.0
"""A run may take so many times its limit by the clock: a controller may wait for something that computes elsewhere."""


class Elapsed:
    """Processor time of the present thread since this was made, or a tenth of the clock's, whichever is more."""

    def __init__(self) -> None:
        self._used, self._clock = time.thread_time(), time.perf_counter()

    def exceeds(self, limit: float) -> bool:
        """Return whether it is more than so many seconds; no thread has computed longer than the clock has run."""
        clock = time.perf_counter() - self._clock
        return clock > limit and max(time.thread_time() - self._used, clock / WAITING) > limit
