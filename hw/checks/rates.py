"""Do a coordinate and its velocity belong together? Swapped columns, wrong units and wrong signs do not."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.hw.checks.clock import Rows
from crossbody.hw.checks.finding import Finding
from crossbody.hw.checks.jumps import TURN
from crossbody.hw.checks.smooth import JumpCheck

SPAN = 16  # samples of one comparison: long enough to outweigh the noise of one sample
GAIN = (0.5, 2.0)
ALIKE = 0.7  # correlation
QUANTA = 20.0  # steps of the encoder that a span must change by, or there is no motion to judge by
SMOOTH = 0.2  # correlation of neighbouring spans: about 1 for a slow motion, -0.5 for noise at rest
LAGS = 8  # spans over which a faster motion comes back to itself; noise has forgotten after one
CHANCE = 4.5  # standard deviations that such a correlation of noise stays within
FEWEST = 8  # spans
OFF = 0.03  # of the gain: published logs of encoders and of cameras are within 0.015
LATE = 2.0  # sample times of a delay: published logs are within 1.1
MOVING = 0.1  # of the change that few spans exceed
USUAL = 0.95  # quantile of spans
FAR = 4.0  # times what few spans disagree by
SURE = 5.0  # standard errors
MOST_ALIKE = 0.99  # correlation of what neighbouring spans are apart by
UNRESOLVED = 2.0  # sample times that a change of the rate may be early or late by
UNITS = {
    "degrees taken for radians": TURN / 360.0, "radians taken for degrees": 360.0 / TURN,
    "revolutions per minute mistaken for radians per second": TURN / 60.0, "turns taken for radians": TURN,
    "millimetres taken for metres": 1e-3, "metres taken for millimetres": 1e3,
}  # fmt: skip


def _usual(spans: Floats) -> NDArray[np.bool_]:
    """Which spans tell about gain and correlation: not the few that disagree far more, as slips do."""
    products = np.einsum("ik,jk->ij", spans, spans)
    if not np.all(np.isfinite(products)):  # what is that large has a check that tells it
        return np.ones(spans.shape[1], np.bool_)
    line = np.linalg.lstsq(products[1:, 1:], products[1:, 0], rcond=None)[0]
    away, size = np.abs(spans[0] - line[0] * spans[1] - line[1] * spans[2]), np.abs(spans[1])
    moving = size >= MOVING * np.quantile(size, USUAL)
    return np.asarray(away <= FAR * np.quantile(away[moving], USUAL))


class RateCheck:
    """Compares the change of a coordinate over 16 samples with the integral of its velocity (trapezoids).

    Over all spans, the least-squares gain g of dq = g (integral of v) and their correlation tell whether
    they belong together. Where they do, dq = g (integral of v) + d (change of v) tells by how much the gain
    is off, and by which time d the velocity is late; where the coordinate less the integral jumps by more
    than both, it has slipped. A span with a dropped sample or an impact does no harm: it is one of many.

    Args:
        name: the coordinate's name.
        rotates: whether it is an angle, rad.
        lag: by how much the map says that the velocity is late, s.
    """

    def __init__(self, name: str, rotates: bool = True, lag: float = 0.0) -> None:
        self._name, self._rotates, self._lag = name, rotates, lag
        self._slips = JumpCheck(name, "rad" if rotates else "m", own=False)
        self._n, self._left, self._loose = 0, 0.0, 0.0
        # Of all spans and of usual ones: how many, squares of dq, products of two that are 1 .. `LAGS` apart.
        self._moved = np.zeros((2, 2 + LAGS))
        self._products = np.zeros((3, 3))  # of dq, the integral of v and the change of v
        self._totals = np.zeros(4)  # of usual spans: dq, the integral of v, the size of dq, time
        self._apart = np.zeros(2)  # squares of what the integral of v is more than dq, and its products with the next
        self._quantum, self._step = np.inf, np.nan
        self._tail: tuple[Rows, Floats, Floats, Floats] | None = None
        self._worst: tuple[float, float, int, float] | None = None

    def see(self, rows: Rows, times: Floats, q: Floats, v: Floats) -> None:
        """Take in the next block; what does not fill a span waits for more."""
        if not math.isfinite(float(q.sum()) + float(v.sum()) + float(times.sum())):
            good = np.isfinite(q) & np.isfinite(v) & np.isfinite(times)
            rows, times, q, v = rows[good], times[good], q[good], v[good]
        if self._tail is not None:
            held = self._tail
            rows, times = np.concatenate((held[0], rows)), np.concatenate((held[1], times))
            q, v = np.concatenate((held[2], q)), np.concatenate((held[3], v))
        count = (len(q) - 1) // SPAN
        end = max(count, 0) * SPAN
        self._tail = rows[end:], times[end:], q[end:], v[end:]
        if count >= 1:
            self._compare(rows[: end + 1], times[: end + 1], q[: end + 1], v[: end + 1])

    def _compare(self, rows: Rows, times: Floats, q: Floats, v: Floats) -> None:
        first = math.isnan(self._step)
        at = np.arange(0, len(q), SPAN)
        dq = q[at[1:]] - q[at[:-1]] - self._turns(q)
        areas = (v[1:] + v[:-1]) * (times[1:] - times[:-1])
        spans = np.stack((dq, 0.5 * np.add.reduceat(areas, at[:-1]), v[at[1:]] - v[at[:-1]]))
        usual = spans[:, _usual(spans)]
        self._n += usual.shape[1]
        self._products += np.einsum("ik,jk->ij", usual, usual)  # no BLAS: its threads cost more
        apart, length = usual[1] - usual[0], float(times[-1] - times[0]) * usual.shape[1] / len(dq)
        self._totals += usual[0].sum(), usual[1].sum(), np.abs(usual[0]).sum(), length
        self._apart += (apart * apart).sum(), (apart[1:] * apart[:-1]).sum()
        for sums, change in zip(self._moved, (dq, usual[0]), strict=True):
            sums += len(change), *((change[lag:] * change[: -lag or None]).sum() for lag in range(LAGS + 1))
        self._remember(dq, spans[1], rows[at[:-1]], times[at[:-1]])
        if first:
            self._step = float(np.median(times[1:] - times[:-1]))
        left = self._left + np.cumsum(dq - spans[1])
        slack = self._slack(v, at)
        nodes = at[1:]
        if first:
            nodes, left, slack = at, np.append(0.0, left), np.append(0.0, slack)
        self._left = float(left[-1])
        self._slips.see(rows[nodes], times[nodes], left, slack)

    def _slack(self, v: Floats, at: NDArray[np.int64]) -> Floats:
        """What rates that are unresolved, a little late or a little off leave at the end of each span."""
        high, low = np.maximum.reduceat(v[:-1], at[:-1]), np.minimum.reduceat(v[:-1], at[:-1])
        high, low = np.maximum(high, v[at[1:]]), np.minimum(low, v[at[1:]])
        own: Floats = self._step * (UNRESOLVED * (high - low) + OFF * SPAN * np.maximum(high, -low))
        before = np.append(self._loose, own[:-1])
        self._loose = float(own[-1])
        return np.asarray(own + before)

    def _turns(self, q: Floats) -> Floats | float:
        """Whole turns that a wrapped angle has jumped by in each span, which are no motion; the encoder's grid."""
        steps = q[1:] - q[:-1]
        size = np.abs(steps)
        most = float(size.max())
        size[size == 0.0] = np.inf
        self._quantum = min(self._quantum, float(size.min()))
        if not self._rotates or most <= 0.5 * TURN:
            return 0.0
        turns = np.where(np.abs(steps) > 0.5 * TURN, TURN * np.rint(steps / TURN), 0.0)
        return np.add.reduceat(turns, np.arange(0, len(turns), SPAN))

    def _remember(self, dq: Floats, iv: Floats, rows: Rows, times: Floats) -> None:
        """Keep the first span of a block that disagrees by more than the mean size of both."""
        if self._worst is not None:
            return
        size = np.sqrt((self._products[0, 0] + self._products[1, 1]) / (2 * self._n))
        bad = np.flatnonzero(np.abs(dq - iv) > 0.5 * size) if size > 0.0 else np.zeros(0, np.int64)
        if len(bad):
            i = bad[0]
            self._worst = float(dq[i]), float(iv[i]), int(rows[i]), float(times[i])

    def _line(self) -> tuple[Floats, Floats, float]:
        """Gain, delay, their standard errors and the squared correlation; 1 and 0 if there is too little."""
        known, wanted, size = self._products[1:, 1:], self._products[1:, 0], self._products[0, 0]
        told = np.all(np.isfinite(self._products)) and self._n >= FEWEST and size > 0.0
        if not told or not np.linalg.det(known) > 1e-9 * known[0, 0] * known[1, 1]:
            return np.array([1.0, 0.0]), np.full(2, np.inf), 0.0
        inverse = np.linalg.inv(known)
        found = inverse @ wanted
        left = max(float(size - found @ wanted), 0.0)
        return found, np.sqrt(np.diag(inverse) * left / (self._n - 2)), 1.0 - left / size

    def _moves(self) -> bool:
        """Whether the coordinate shows more than noise and steps of its encoder, with or without slips."""
        count, squares, *products = self._moved.T
        size = np.sqrt(squares / np.maximum(count, 1.0))
        surely = np.maximum(CHANCE / np.sqrt(np.maximum(count, 1.0)), SMOOTH)
        again = np.any(products[1:] > surely * squares, axis=0) | (products[0] > SMOOTH * squares)
        return bool(np.any((count >= FEWEST) & (size > QUANTA * self._quantum) & again))

    def findings(self) -> list[Finding]:
        """Whether the two belong together; nothing if there is too little motion to tell."""
        if not self._moves():
            return self._about_bias(fault=False)  # slow as the motion may be, all of it together tells this
        (dq2, both, _), iv2 = self._products[0], self._products[1, 1]
        gain = both / iv2 if iv2 else np.inf
        alike = both / np.sqrt(dq2 * iv2) if iv2 else 0.0
        if GAIN[0] < gain < GAIN[1] and alike > ALIKE:
            return self._about_line() or self._about_bias(fault=False) or self._slips.findings()
        if found := self._about_bias(fault=True):
            return found
        if self._worst is None:
            return []
        dq, iv, row, t = self._worst
        unit = next((f", as of {name}" for name, ratio in UNITS.items() if abs(gain / ratio - 1.0) < OFF), "")
        text = (
            f"over {SPAN} samples the coordinate changes by {dq:.3g} where its velocity "
            f"integrates to {iv:.3g} (gain {gain:.3g}{unit}, correlation {alike:.2g}); is a "
            "column swapped, a unit or a sign wrong?"
        )
        return [self._told("rates", text, row, t, fault=True)]

    def _about_line(self) -> list[Finding]:
        """A delay, or a gain below the squared correlation, to which noise of the velocity lowers it."""
        (gain, late), (unsure, early), alike = self._line()
        late -= self._lag
        row, t = (self._worst[2:]) if self._worst is not None else (0, np.nan)
        if abs(late) > max(LATE * self._step, SURE * early):
            where = "behind" if late > 0.0 else "ahead of"
            text = f"the velocity is {abs(late):.3g} s {where} its coordinate ({late / self._step:+.2g} samples)."
            return [self._told("delay", text, row, t)]
        off = max(OFF, SURE * unsure)
        if gain > 1.0 + off or gain / max(alike, 1e-9) < 1.0 - off:
            far = f"{gain:.4g} (+- {2.0 * unsure:.2g}) times as far as the integral of its velocity"
            text = f"the coordinate moves {far}: is a scale off?"
            return [self._told("gain", text, row, t)]
        return []

    def _about_bias(self, fault: bool) -> list[Finding]:
        """A rate that is off by a constant, and belongs to its coordinate without that.

        The integral of the rate is more than the whole change of the coordinate by the bias times
        the time. A gain or a delay that is within its limits leaves at most a part of the way; noise
        leaves the scatter of the spans, which are taken for an autoregressive series of first order.
        """
        (dq, iv, way, length), n = self._totals, self._n
        if n < FEWEST or not length > 0.0:
            return []
        bias, span = (iv - dq) / length, length / n
        square, next_ = self._apart - n * (bias * span) ** 2
        alike = min(max(next_ / square, 0.0), MOST_ALIKE) if square > 0.0 else 0.0
        unsure = math.sqrt(max(square, 0.0) * (1.0 + alike) / (1.0 - alike)) / length
        if not abs(bias) > max(OFF * way / length, SURE * unsure):
            return []
        (dq2, both, _), iv2 = self._products[0], self._products[1, 1]
        iv2 += bias * span * (n * bias * span - 2.0 * iv)
        both -= bias * span * dq
        if not (iv2 > 0.0 and GAIN[0] < both / iv2 < GAIN[1] and both > ALIKE * math.sqrt(dq2 * iv2)):
            return []
        unit = "rad/s" if self._rotates else "m/s"
        text = (
            f"the velocity is biased by {bias:+.3g} (+- {2.0 * unsure:.2g}) {unit}: over "
            f"{length:.3g} s it integrates to {iv:.3g} where the coordinate changes by {dq:.3g}."
        )
        row, t = (self._worst[2:]) if self._worst is not None else (0, np.nan)
        return [self._told("bias", text, row, t, fault=fault)]

    def _told(self, check: str, text: str, row: int, t: float, fault: bool = False) -> Finding:
        channel = f"coordinates.{self._name}"
        return Finding(check=check, fault=fault, channel=channel, row=row, t=t, count=1, text=text)
