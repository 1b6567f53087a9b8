"""Are the values of one channel plausible? Finite, within their range, neither stuck nor saturated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crossbody.hw.checks.clock import First, Floats, Rows
from crossbody.hw.checks.finding import Finding

STUCK = 100  # samples without any change
SATURATED = 10  # samples at the largest or smallest value of all


class ValueCheck:
    """One channel, seen block by block.

    Args:
        channel: `role.name`, for findings.
        unit: SI unit, for findings.
        range: smallest and largest plausible value, SI.
        measured: whether it is measured: a commanded value may rest as long as it likes.
    """

    def __init__(
        self, channel: str, unit: str, range: tuple[float, float] | None = None, measured: bool = True
    ) -> None:
        self._channel, self._unit, self._range, self._measured = channel, unit, range, measured
        self._finite, self._outside = First(), First()
        self.runs = Runs()

    def see(self, rows: Rows, times: Floats, values: Floats) -> None:
        """Take in the next block: rows of the file, their times, s, and the values, SI."""
        self._finite.see(~np.isfinite(values), rows, times)
        if self._range is not None:
            with np.errstate(invalid="ignore"):
                self._outside.see((values < self._range[0]) | (values > self._range[1]), rows, times)
        self.runs.see(rows, times, values)

    @property
    def missing(self) -> int:
        """Number of values that are not finite."""
        return self._finite.count

    def findings(self) -> list[Finding]:
        """What is wrong with the channel."""
        found: list[Finding] = []
        if self._finite.count:
            found.append(self._finite.told("finite", self._channel, self._say_finite(), fault=True))
        if self._outside.count and self._range is not None:
            text = (
                f"{self._outside.count} values lie outside [{self._range[0]:.6g}, {self._range[1]:.6g}] {self._unit}; "
                "is it the right column, in the right unit?"
            )
            found.append(self._outside.told("range", self._channel, text, fault=True))
        return found + (self._about_runs() if self._measured else [])

    def _say_finite(self) -> str:
        return f"the value is not a finite number ({self._finite.count} such rows)."

    def _about_runs(self) -> list[Finding]:
        runs, found = self.runs, []
        rests = runs.longest_value == 0.0 and runs.longest.count < runs.seen  # at rest a sensor reads 0
        if runs.longest.count >= STUCK and not rests:
            text = f"the value does not change for {runs.longest.count} samples."
            found.append(runs.longest.told("stuck", self._channel, text, fault=False))
        for end, first in (("largest", runs.top), ("smallest", runs.bottom)):
            value = runs.high if end == "largest" else runs.low
            if first.count >= SATURATED and runs.low < runs.high and value != 0.0 and not runs.switch:
                text = f"the value stays at its {end}, {value:.6g} {self._unit}, for {first.count} samples."
                found.append(first.told("saturated", self._channel, text, fault=False))
        return found


class Runs:
    """Runs of equal values across blocks: the longest, and the longest at either end of the values so far.

    `count` of a run is its length here.
    """

    def __init__(self) -> None:
        self.low, self.high = np.inf, -np.inf
        self.longest, self.top, self.bottom = First(), First(), First()
        self.longest_value, self.seen = np.nan, 0
        self._open = First()
        self._value = np.nan

    @property
    def switch(self) -> bool:
        """Whether the values seem to be those of a switch."""
        return (self.low, self.high) == (0.0, 1.0)

    def see(self, rows: Rows, times: Floats, values: Floats) -> None:
        """Take in the next block."""
        good = np.isfinite(values)
        rows, times, values = rows[good], times[good], values[good]
        if not len(values):
            return
        self.seen += len(values)
        starts = np.flatnonzero(np.diff(values, prepend=self._value) != 0.0)  # NaN differs from everything
        lengths = np.diff(starts, append=len(values))
        head = int(starts[0]) if len(starts) else len(values)
        if head:
            self._open.count += head
            self._note(self._open, self._value)
        if not len(starts):
            return
        for run in self._worth_noting(values[starts], lengths):
            i = int(starts[run])
            self._note(First(int(rows[i]), float(times[i]), int(lengths[run])), float(values[i]))
        last = int(starts[-1])
        self._open = First(int(rows[last]), float(times[last]), int(lengths[-1]))
        self._value = float(values[last])

    @staticmethod
    def _worth_noting(values: Floats, lengths: NDArray[np.int64]) -> set[int]:
        """Indices of the runs of a block that can be the longest, or the longest at its ends."""
        ends = (np.flatnonzero(values == values.max()), np.flatnonzero(values == values.min()))
        return {int(np.argmax(lengths)), *(int(at[np.argmax(lengths[at])]) for at in ends)}

    def _note(self, run: First, value: float) -> None:
        if run.count > self.longest.count:
            self.longest, self.longest_value = First(run.row, run.t, run.count), value
        if value > self.high or (value == self.high and run.count > self.top.count):
            self.high, self.top = value, First(run.row, run.t, run.count)
        if value < self.low or (value == self.low and run.count > self.bottom.count):
            self.low, self.bottom = value, First(run.row, run.t, run.count)
