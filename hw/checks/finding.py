"""What a check has to say about a log."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass

from crossbody.cases import LogFormatError


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One doubt about a log, with the place of its first offence.

    Attributes:
        check: name of the check: "samples", "time", "finite", "range", "rates", "sample_time", "dropped",
            "jitter", "drift", "stuck", "saturated", "wraps", "slips", "spikes", "unit", "gain", "delay".
        fault: True if the log cannot be used so; False for what one should know.
        channel: `role.name` of the channel, or "time".
        row: row of the file, counted from 0.
        t: time of that row, s; NaN where it has none.
        count: how often in all.
        text: what it is, in one sentence.
    """

    check: str
    fault: bool
    channel: str
    row: int
    t: float
    count: int
    text: str

    def error(self, path: str | os.PathLike[str]) -> LogFormatError:
        """The error that refuses a log because of it."""
        when = f"t = {self.t:.9g} s: " if math.isfinite(self.t) else ""
        return LogFormatError(path, when + self.text, self.row, self.channel)


def first_of_each(findings: Iterable[Finding]) -> list[Finding]:
    """First finding of each check and channel: a slip may show in the coordinate and against its rate."""
    return list({(f.channel, f.check): f for f in reversed(list(findings))}.values())[::-1]
