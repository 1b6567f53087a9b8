"""Are the values of one channel plausible? Finite, within their range, neither stuck nor saturated."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.hw.checks.clock import First, Rows
from crossbody.hw.checks.finding import Finding

STUCK = 100  # samples without any change
SATURATED = 10  # samples at the largest or smallest value of all
NEAR, FAR = 10, 50  # samples before a run
CUT = 0.15  # of the way of the last 50 samples, in the last 10: 0.04 where a motion comes to rest, 0.2 where it is cut
STEPS = 6  # of the encoder's grid: where a slow parabola turns on a grid, the last 10 samples cover less
HALF = 0.5  # of the largest step: a channel that froze while it moved goes on with a jump
RARE = 0.02  # of the steps: the first of a difference, a value of its own
FINE = 1e-3  # steps are counted by their logarithms, to so much of them
ROUNDING = 1e-9  # of the largest value: differences of counts that were written with 10 digits
MOST = 8  # runs of a block that are looked at


class ValueCheck:
    """One channel, seen block by block; a commanded value may rest as long as it likes."""

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
            text = f"the value is not a finite number ({self._finite.count} such rows)."
            found.append(self._finite.told("finite", self._channel, text, fault=True))
        if self._outside.count and self._range is not None:
            text = (
                f"{self._outside.count} values lie outside [{self._range[0]:.6g}, "
                f"{self._range[1]:.6g}] {self._unit}; is it the right column, in the right unit?"
            )
            found.append(self._outside.told("range", self._channel, text, fault=True))
        return found + (self._about_runs() if self._measured else [])

    def _about_runs(self) -> list[Finding]:
        runs, found = self.runs, []
        stuck = [r for r in (runs.longest, runs.jumped) if r.count >= STUCK and r.value != 0.0 and runs.cut_off(r)]
        if stuck:  # at rest a sensor reads 0
            longest = max(stuck, key=lambda run: run.count)
            text = f"the value does not change for {longest.count} samples."
            found.append(longest.told("stuck", self._channel, text, fault=False))
        for end, run in (("largest", runs.top), ("smallest", runs.bottom)):
            if run.count >= SATURATED and run.value != 0.0 and runs.cut_off(run) and not runs.switch:
                text = f"the value stays at its {end}, {run.value:.6g} {self._unit}, for {run.count} samples."
                found.append(run.told("saturated", self._channel, text, fault=False))
        return found


@dataclass(slots=True)
class Run(First):
    """Equal values; `count` is how many.

    Attributes:
        value: what they are.
        sharp: how far in the 10 samples before, if that is no part of a smooth motion that came
            to rest; 0 if it is.
        left: by how much the first step after leaves that value.
    """

    value: float = np.nan
    sharp: float = 0.0
    left: float = 0.0


class Runs:
    """Runs of equal values across blocks that no rest explains.

    Kept are the longest, the one that ended with the largest jump, and the longest at either end
    of the values so far.

    Rests and turning points are runs too, on the grid of an encoder. They are told from a channel
    that froze or hit its limit by how the run begins: a motion that comes to rest covers 1/25 of
    its last 50 samples' way in the last 10, one that is cut off a fifth. It must be more than the
    grid explains, so that a run is judged at the end alone.
    """

    def __init__(self) -> None:
        self.low, self.high = np.inf, -np.inf
        self.longest, self.jumped, self.top, self.bottom = Run(), Run(), Run(), Run()
        self.seen = 0
        self._steps, self._largest, self._size = Counter[int](), 0.0, 0.0
        self._open = Run()
        self._value = np.nan
        self._tail: Floats = np.zeros(0)

    @property
    def switch(self) -> bool:
        """Whether the values seem to be those of a switch."""
        return (self.low, self.high) == (0.0, 1.0)

    def cut_off(self, run: Run) -> bool:
        """Whether the motion did not come to rest by itself when the run began, or not by itself go on."""
        return max(run.sharp, run.left if run.left > HALF * self._largest else 0.0) >= STEPS * self._grid()

    def see(self, rows: Rows, times: Floats, values: Floats) -> None:
        """Take in the next block."""
        good = np.isfinite(values)
        rows, times, values = rows[good], times[good], values[good]
        if not len(values):
            return
        self.seen += len(values)
        steps = np.abs(np.diff(values, prepend=self._value))
        starts = np.flatnonzero(steps != 0.0)  # NaN differs from everything
        moved = steps[starts]
        moved = moved[np.isfinite(moved)]
        self._steps.update(np.floor(np.log(moved) / FINE).astype(int).tolist())
        self._largest = max(self._largest, float(moved.max(initial=0.0)))
        self._size = max(self._size, float(np.abs(values).max()))
        head = int(starts[0]) if len(starts) else len(values)
        self._open.count += head
        if len(starts) and self.seen > len(values):
            self._open.left = abs(float(values[starts[0]]) - self._open.value)
        if self._open.count:
            self._note(self._open)
        whole = np.concatenate((self._tail, values))
        if len(starts):
            lengths = np.diff(starts, append=len(values))
            for i in sorted({*self._worth_noting(values[starts], lengths), len(starts) - 1}):
                run = self._entered(whole, len(self._tail) + int(starts[i]))
                run.row, run.t, run.count = int(rows[starts[i]]), float(times[starts[i]]), int(lengths[i])
                if i + 1 < len(starts):
                    run.left = abs(float(values[starts[i + 1]]) - run.value)
                self._note(run)
                self._open = run
            self._value = float(values[-1])
        self._tail = whole[-FAR:]

    def _grid(self) -> float:
        """Return the smallest step, but for rare ones and the rounding of what was computed from counts."""
        least = np.log(max(ROUNDING * self._size, np.finfo(float).tiny)) / FINE
        steps = sorted((place, count) for place, count in self._steps.items() if place > least)
        rare = int(RARE * sum(count for _, count in steps))
        for place, count in steps:
            if count > rare:
                return float(np.exp(FINE * place))
            rare -= count
        return np.inf

    @staticmethod
    def _entered(whole: Floats, at: int) -> Run:
        """The run that begins at an index, and how the channel came there."""
        away = np.abs(whole[max(at - FAR, 0) : at] - whole[at])
        far = float(away.max(initial=0.0))
        near = float(away[-NEAR:].max(initial=0.0))
        return Run(value=float(whole[at]), sharp=near if near > CUT * far else 0.0)

    @staticmethod
    def _worth_noting(values: Floats, lengths: NDArray[np.int64]) -> list[int]:
        """Indices of the longest runs of a block, in all and at its ends."""
        found = [np.argsort(lengths, kind="stable")[-MOST:]]
        for end in (values.max(), values.min()):
            at = np.flatnonzero(values == end)
            found.append(at[np.argsort(lengths[at], kind="stable")[-MOST:]])
        return [int(i) for i in np.concatenate(found)]

    def _note(self, run: Run) -> None:
        cut = run.sharp > 0.0
        if cut and run.count > self.longest.count:
            self.longest = replace(run)
        if run.count >= STUCK and run.left > self.jumped.left:
            self.jumped = replace(run)
        if run.value > self.high:
            self.high, self.top = run.value, Run(value=run.value)
        if run.value < self.low:
            self.low, self.bottom = run.value, Run(value=run.value)
        if run.value == self.high and cut and run.count > self.top.count:
            self.top = replace(run)
        if run.value == self.low and cut and run.count > self.bottom.count:
            self.bottom = replace(run)
