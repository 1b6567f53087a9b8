"""All checks of a log, block by block, in bounded memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from crossbody.hw.checks.clock import ClockCheck
from crossbody.hw.checks.finding import Finding, first_of_each
from crossbody.hw.checks.rates import RateCheck
from crossbody.hw.checks.smooth import JumpCheck
from crossbody.hw.checks.values import ValueCheck
from crossbody.hw.reading.columns import Role
from crossbody.hw.reading.plan import PURE, ROTATES, Source
from crossbody.hw.reading.stream import Rows

FEWEST = 2  # rows


class Checks:
    """Whether a log can be used, and what one should know about it.

    Sources are in the order of a block's values; the map need not say a nominal sample time, s.
    """

    def __init__(self, sources: Sequence[Source], sample_time: float | None) -> None:
        self.clock = ClockCheck(sample_time)
        self._values = [ValueCheck(s.label, s.conversion.si, s.range, s.role.measured) for s in sources]
        at = {(s.role, s.name): i for i, s in enumerate(sources)}
        self._jumps = [
            (JumpCheck(s.name, s.conversion.si), i)
            for i, s in enumerate(sources)
            if s.role is Role.COORDINATES and s.conversion.si != PURE
        ]
        names = [s.name for s in sources if s.role is Role.COORDINATES and (Role.VELOCITIES, s.name) in at]
        pairs = [(n, at[Role.COORDINATES, n], at[Role.VELOCITIES, n]) for n in names]
        self._rates = [
            (RateCheck(n, sources[q].conversion.si == ROTATES, sources[v].signal.delay - sources[q].signal.delay), q, v)
            for n, q, v in pairs
        ]

    def see(self, block: Rows) -> None:
        """Take in the next block of the log."""
        with np.errstate(over="ignore", invalid="ignore"):  # what is that large has a check that tells it
            self.clock.see(block.rows, block.time)
            for check, values in zip(self._values, block.values, strict=True):
                check.see(block.rows, block.time, values)
            for jumps, i in self._jumps:
                jumps.see(block.rows, block.time, block.values[i])
            for rate, q, v in self._rates:
                rate.see(block.rows, block.time, block.values[q], block.values[v])

    def refuse(self, path: Path) -> None:
        """Raise the first fault that was found, if there is one."""
        for finding in self.findings():
            if finding.fault:
                raise finding.error(path)

    def _about_length(self) -> list[Finding]:
        if self.clock.rows >= FEWEST:
            return []
        text = f"the number of samples is {self.clock.rows}; a log needs at least {FEWEST}."
        t = self.clock.start
        return [Finding(check="samples", fault=True, channel="time", row=0, t=t, count=1, text=text)]

    def findings(self) -> tuple[Finding, ...]:
        """Everything found, faults first, in the order of their rows."""
        found = self._about_length() + self.clock.findings() + [f for check in self._values for f in check.findings()]
        found += [f for check, _ in self._jumps for f in check.findings()]
        if not any(
            f.fault and f.check != "wraps" for f in found
        ):  # with a broken clock or holes, rates tell nothing new
            found += [f for check, _, _ in self._rates for f in check.findings()]
        return tuple(sorted(first_of_each(found), key=lambda f: (not f.fault, f.row)))
