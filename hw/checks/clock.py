"""Is the time axis one? Strictly increasing, finite, no samples dropped, little jitter, no drift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.hw.checks.finding import Finding

Rows = NDArray[np.int64]

GAP = 1.5  # sample times: a longer step lacks samples
UNIT_WRONG = 1.5  # ratio of median step to nominal step that no clock explains
EARLY = 1000  # steps that tell the sample time
JITTER = 0.1  # sample times
NO_RIGS = 100.0  # s: a step in seconds; with `sample_time` in the map a log may be as slow as it likes


@dataclass(slots=True)
class First:
    """The first offence of one kind, and how many there were."""

    row: int = -1
    t: float = np.nan
    count: int = 0

    def see(self, bad: NDArray[np.bool_], rows: Rows, times: Floats) -> None:
        """Take note of the offences in a block."""
        found = int(np.count_nonzero(bad))
        if found and not self.count:
            i = int(np.argmax(bad))
            self.row, self.t = int(rows[i]), float(times[i])
        self.count += found

    def told(self, check: str, channel: str, text: str, *, fault: bool) -> Finding:
        """As a finding."""
        return Finding(check=check, fault=fault, channel=channel, row=self.row, t=self.t, count=self.count, text=text)


class ClockCheck:
    """The clock of a log, seen block by block.

    Residuals e_k = t_k - t_0 - k T of the sample with index k (dropped samples counted) give the
    drift as their slope and the jitter as their scatter about it.

    Args:
        nominal: sample time T, s; the median step of the first block if None.
    """

    def __init__(self, nominal: float | None = None) -> None:
        self.given = nominal
        self.step = nominal or np.nan
        self.rows = 0
        self.start = self.end = np.nan
        self.longest = 0.0
        self.missing = 0
        self._early: list[float] = []
        self._index, self._row = 0, -1
        self._sums = np.zeros(5)  # k, k^2, e, e k, e^2
        self._finite, self._back, self._same = First(), First(), First()
        self._dropped, self._jitter, self._drift = First(), First(), First()

    def see(self, rows: Rows, times: Floats) -> None:
        """Take in the next block: rows of the file and their times, s."""
        if not len(times):
            return
        self._finite.see(~np.isfinite(times), rows, times)
        if not self.rows:
            self.start = self.end = float(times[0])
        self._look_at_first(times)
        with np.errstate(invalid="ignore", over="ignore"):
            steps = np.diff(times, prepend=self.end)
            if not self.rows:
                rows, times, steps = rows[1:], times[1:], steps[1:]
                self._sums[:] = 0.0
            self._same.see(steps == 0.0, rows, times)
            self._back.see(steps < 0.0, rows, times)
            self._against_nominal(rows, times, steps)
        if len(times):
            self.end = float(times[-1])
        self.rows += len(times) + (0 if self.rows else 1)

    def _look_at_first(self, times: Floats) -> None:
        """The median of the first steps; it is the sample time where none was given."""
        if len(self._early) >= EARLY:
            return
        with np.errstate(invalid="ignore", over="ignore"):
            steps = np.diff(times[:EARLY], prepend=self.end)
        self._early += steps[np.isfinite(steps) & (steps > 0.0)].tolist()
        if self.given is None and not self.step > 0.0 and self._early:
            self.step = self.median

    @property
    def median(self) -> float:
        """Median of the first steps, s; NaN if there are none."""
        return float(np.median(self._early)) if self._early else np.nan

    def _against_nominal(self, rows: Rows, times: Floats, steps: Floats) -> None:
        good = np.isfinite(steps) & (steps > 0.0) & (steps < 1e9 * self.step)
        rows, times, steps = rows[good], times[good], steps[good]
        if not len(steps):
            return
        whole = np.maximum(np.rint(steps / self.step), 1.0)
        gap = steps > GAP * self.step
        self._dropped.see(gap, rows, times)
        self.missing += int(np.sum(whole[gap]) - np.count_nonzero(gap))
        self.longest = max(self.longest, float(steps.max()))
        self._jitter.see(np.abs(steps - whole * self.step) > JITTER * self.step, rows, times)
        k = self._index + np.cumsum(whole)
        self._index = int(k[-1])
        e = times - self.start - k * self.step
        self._drift.see(np.abs(e) > self.step, rows, times)
        self._sums += (k.sum(), (k * k).sum(), e.sum(), (e * k).sum(), (e * e).sum())  # no BLAS: its threads cost more

    @property
    def drift(self) -> float:
        """Slope of the residuals, seconds a second; NaN for less than three samples."""
        return self._line()[0] / self.step

    @property
    def jitter(self) -> float:
        """Standard deviation of the sample times about a steady clock, s."""
        return self._line()[1]

    def _line(self) -> tuple[float, float]:
        n, (k, kk, e, ek, ee) = self.rows - 1, self._sums
        if n < 2:
            return np.nan, np.nan
        spread = kk - k * k / n
        slope = (ek - e * k / n) / spread if spread > 0 else 0.0
        return float(slope), float(np.sqrt(max(ee - e * e / n - slope * slope * spread, 0.0) / n))

    def findings(self) -> list[Finding]:
        """What is wrong with the clock, faults first."""
        found = [
            (self._finite, "time", "the time is not a finite number", True),
            (self._back, "time", "time decreases; it must increase from row to row", True),
            (self._same, "time", "time does not advance; drop_duplicates removes such rows", True),
            (self._dropped, "dropped", f"{self.missing} samples are missing in {self._dropped.count} places", False),
            (self._jitter, "jitter", f"steps differ from {self.step:.6g} s by more than a tenth; scatter of the clock "
             f"{self.jitter:.3g} s", False),
        ]  # fmt: skip
        told = [
            first.told(check, "time", text + ".", fault=fault) for first, check, text, fault in found if first.count
        ]
        wrong = self._unit_is_wrong()
        return [f for f in told if f.fault] + wrong if wrong else told + self._about_drift()

    def _unit_is_wrong(self) -> list[Finding]:
        if self.given is None and self.median >= NO_RIGS:
            text = f"the step is {self.median:.6g} s, which no rig has; is the unit of time right?"
            return [Finding(check="sample_time", fault=False, channel="time", row=0, t=self.start, count=1, text=text)]
        if self.given is None or not self._early:
            return []
        if 1.0 / UNIT_WRONG < self.median / self.given < UNIT_WRONG:
            return []
        text = f"the step is {self.median:.6g} s and sample_time {self.given:.6g} s; is the unit of time right?"
        return [Finding(check="sample_time", fault=True, channel="time", row=0, t=self.start, count=1, text=text)]

    def _about_drift(self) -> list[Finding]:
        if self.given is None:
            return []
        if self._drift.count:
            text = f"the clock is a whole sample off its nominal time; it runs {1e6 * self.drift:+.1f} ppm slow."
            return [self._drift.told("drift", "time", text, fault=False)]
        return []
