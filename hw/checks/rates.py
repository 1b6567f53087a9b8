"""Do a coordinate and its velocity belong together? Swapped columns, wrong units and wrong signs do not."""

from __future__ import annotations

import numpy as np

from crossbody.hw.checks.clock import Floats, Rows
from crossbody.hw.checks.finding import Finding
from crossbody.hw.checks.jumps import TURN

SPAN = 16  # samples of one comparison: long enough to outweigh the noise of one sample
GAIN = (0.5, 2.0)
ALIKE = 0.7  # correlation
QUANTA = 20.0  # steps of the encoder that a span must change by, or there is no motion to judge by
SMOOTH = 0.2  # correlation of neighbouring spans: about 1 for a resolved motion, -0.5 for noise at rest
FEWEST = 8  # spans


class RateCheck:
    """Compares the change of a coordinate over 16 samples with the integral of its velocity (trapezoids).

    Over all spans, the least-squares gain g of dq = g (integral of v) and their correlation tell. A span with a
    dropped sample or an impact does no harm: it is one of many.

    Args:
        name: the coordinate's name.
        rotates: whether it is an angle, rad.
    """

    def __init__(self, name: str, rotates: bool = True) -> None:
        self._name, self._rotates = name, rotates
        self._n = 0
        self._dq2 = self._iv2 = self._both = 0.0
        self._quantum = np.inf
        self._next = 0.0
        self._worst: list[tuple[float, float, int, float]] = []

    def see(self, rows: Rows, times: Floats, q: Floats, v: Floats) -> None:
        """Take in the next block; spans do not reach over its end."""
        good = np.isfinite(q) & np.isfinite(v) & np.isfinite(times)
        rows, times, q, v = rows[good], times[good], q[good], v[good]
        spans = (len(q) - 1) // SPAN
        if spans < 1:
            return
        steps = np.abs(np.diff(q))
        moved = steps[steps > 0.0]
        self._quantum = min(self._quantum, float(moved.min()) if len(moved) else np.inf)
        path = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(times))))
        q = q - self._turns(q)
        at = np.arange(spans + 1) * SPAN
        dq, iv = np.diff(q[at]), np.diff(path[at])
        self._n += spans
        self._dq2 += float((dq * dq).sum())
        self._iv2 += float((iv * iv).sum())
        self._both += float((dq * iv).sum())
        self._next += float((dq[1:] * dq[:-1]).sum())
        self._remember(dq, iv, rows[at[:-1]], times[at[:-1]])

    def _turns(self, q: Floats) -> Floats | float:
        """Whole turns that a wrapped angle has jumped by up to each sample: they are no motion."""
        if not self._rotates:
            return 0.0
        steps = np.diff(q, prepend=q[0])
        wraps = np.where(np.abs(steps) > 0.5 * TURN, TURN * np.rint(steps / TURN), 0.0)
        return np.cumsum(wraps)

    def _remember(self, dq: Floats, iv: Floats, rows: Rows, times: Floats) -> None:
        """Keep the first span of a block that disagrees by more than the mean size of both."""
        size = np.sqrt((self._dq2 + self._iv2) / (2 * self._n))
        bad = np.flatnonzero(np.abs(dq - iv) > 0.5 * size) if size > 0.0 else np.zeros(0, np.int64)
        if len(bad) and not self._worst:
            i = bad[0]
            self._worst.append((float(dq[i]), float(iv[i]), int(rows[i]), float(times[i])))

    def _moves(self) -> bool:
        """Whether the coordinate does more than show its noise and the steps of its encoder."""
        size = np.sqrt(self._dq2 / max(self._n, 1))
        return bool(self._n >= FEWEST and size > QUANTA * self._quantum and self._next > SMOOTH * self._dq2)

    def findings(self) -> list[Finding]:
        """Whether the two belong together; nothing if there is too little motion to tell."""
        if not self._moves() or not self._worst:
            return []
        gain = self._both / self._iv2 if self._iv2 else np.inf
        alike = self._both / np.sqrt(self._dq2 * self._iv2) if self._iv2 else 0.0
        if GAIN[0] < gain < GAIN[1] and alike > ALIKE:
            return []
        dq, iv, row, t = self._worst[0]
        text = (
            f"over {SPAN} samples the coordinate changes by {dq:.3g} where its velocity integrates to {iv:.3g} "
            f"(gain {gain:.3g}, correlation {alike:.2g}); is a column swapped, a unit or a sign wrong?"
        )
        return [
            Finding(check="rates", fault=True, channel=f"coordinates.{self._name}", row=row, t=t, count=1, text=text)
        ]
