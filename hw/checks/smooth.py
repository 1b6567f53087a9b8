"""The jumps of one coordinate, block by block, as findings; and an angle without its wraps."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.hw.checks.clock import First, Rows
from crossbody.hw.checks.finding import Finding
from crossbody.hw.checks.jumps import EDGE, SPANS, TURN, find_jumps

CHUNK = 8192  # samples that are judged together, wherever blocks are cut
HALF = (EDGE + 1) * SPANS[-1]  # samples at either end of a chunk that the chunk beside it judges
FEWEST = 256  # samples that tell the noise
DEGREES = 360.0
CLOSE = 0.01  # of a turn: a jump so near to it is one
TWICE = 2  # wraps at 2 pi degrees that are no accident; one at 360 rad is none
FAST = 16  # steps longer than half a turn


def _chunks(length: int, first: bool, last: bool) -> Iterator[tuple[slice, int, int]]:
    """Whole chunks of what is held, and which of their samples each judges; the rest as one at the end."""
    at = 0
    while length - at >= 2 * CHUNK or (last and length - at > (0 if first else 2 * HALF)):
        stop = at + CHUNK if length - at >= 2 * CHUNK else length
        yield slice(at, stop), 0 if first else HALF, stop - at - (HALF if stop < length else 0)
        at, first = stop - 2 * HALF if stop < length else stop, False


class JumpCheck:
    """Wraps, slips and spikes of one coordinate, seen block by block; only angles wrap.

    Values that are not the coordinate's own are what its rate does not account for.
    """

    def __init__(self, name: str, unit: str, own: bool = True) -> None:
        self._channel, self._unit, self._own = f"coordinates.{name}", unit, own
        self._parts: list[tuple[Rows, Floats, Floats, Floats]] = []
        self._held, self._first = 0, True
        self._noise: float | None = None
        self._wraps, self._slips, self._spikes = First(), First(), First()
        self._degrees, self._radians, self._fast = First(), First(), First()
        self._slip, self._spike = (0.0, 0), (0.0, 0)  # size and samples of the first

    def see(self, rows: Rows, times: Floats, values: Floats, slack: Floats | None = None) -> None:
        """Take in the next block.

        Args:
            rows (n,): of the file.
            times (n,): s.
            values (n,): SI.
            slack (n,): what the value may jump by at each; nothing if None.
        """
        if not math.isfinite(float(values.sum()) + float(times.sum())):
            good = np.isfinite(values) & np.isfinite(times)
            rows, times, values = rows[good], times[good], values[good]
        self._parts.append((rows, times, values, values[:0] if slack is None else slack))
        self._held += len(values)
        if self._held >= 2 * CHUNK:
            self._judge(last=False)

    def _judge(self, last: bool) -> None:
        """Look at whole chunks; what is left, and the neighbours of its first step, wait for more."""
        held = self._parts[0]
        if len(self._parts) > 1:
            rows, times, values, slack = zip(*self._parts, strict=True)
            held = np.concatenate(rows), np.concatenate(times), np.concatenate(values), np.concatenate(slack)
        at = 0
        for part, low, high in _chunks(len(held[2]), self._first, last):
            self._look(held[0][part], held[1][part], held[2][part], held[3][part], low, high)
            at, self._first = part.stop - (0 if part.stop == len(held[2]) else 2 * HALF), False
        self._parts = [(held[0][at:], held[1][at:], held[2][at:], held[3][at:])]
        self._held = len(held[2]) - at

    def _look(self, rows: Rows, times: Floats, values: Floats, slack: Floats, low: int, high: int) -> None:
        few = self._noise is not None and len(values) < FEWEST
        known, rotates = self._noise if few else None, self._unit == "rad" and self._own
        with np.errstate(over="ignore", invalid="ignore"):  # what is that large has a check that tells it
            found, self._noise = find_jumps(times, values, rotates, known, slack if len(slack) else None)
        if not len(found.at) and not len(found.fast):
            return
        inside = (found.at >= low) & (found.at < high)
        wraps, spikes = inside & (found.turns != 0), inside & found.spike
        slips = inside & (found.turns == 0) & ~found.spike
        for what, of in ((slips, "_slip"), (spikes, "_spike")):
            if what.any() and not getattr(self, of)[1]:
                i = int(np.argmax(what))
                setattr(self, of, (float(found.size[i]), int(found.span[i])))
        size = np.abs(found.size)
        degrees = slips & rotates & (np.abs(size - DEGREES) < CLOSE * DEGREES)
        turn = TURN * TURN / DEGREES  # of an angle in radians that is taken for degrees
        radians = slips & rotates & (np.abs(size - turn) < CLOSE * turn)
        for first, at in (
            (self._wraps, found.at[wraps]), (self._slips, found.at[slips]), (self._spikes, found.at[spikes]),
            (self._degrees, found.at[degrees]), (self._radians, found.at[radians]),
            (self._fast, found.fast[(found.fast >= low) & (found.fast < high)]),
        ):  # fmt: skip
            there = np.zeros(len(values), np.bool_)
            there[at] = True
            first.see(there, rows, times)

    def findings(self) -> list[Finding]:
        """What was found; the log must have been seen to its end."""
        if self._parts:
            self._judge(last=True)
            self._parts = []
        found = []
        if self._wraps.count:
            text = f"the angle wraps at a turn in {self._wraps.count} places; the repair unwrap undoes that."
            found.append(self._wraps.told("wraps", self._channel, text, fault=True))
        for first, turn, least, unit in (
            (self._degrees, "360 rad", 1, "degrees"), (self._radians, "2 pi degrees", TWICE, "radians"),
        ):  # fmt: skip
            if first.count >= least and first.count == self._slips.count:
                text = f"the angle wraps at {turn} in {first.count} places: it is in {unit}; the map has another unit."
                return [first.told("unit", self._channel, text, fault=True)]
        if self._fast.count >= FAST:
            text = f"{self._fast.count} steps of the angle are longer than half a turn: is its unit right?"
            found.append(self._fast.told("unit", self._channel, text, fault=False))
        return found + self._jumps()

    def _jumps(self) -> list[Finding]:
        """Slips and spikes."""
        found = []
        size, span = self._slip
        if self._slips.count:
            within = f" within {span} samples" if span > 1 else ""
            text = f"the value jumps by {size:+.3g} {self._unit}{within} out of a smooth motion"
            if not self._own:
                text = f"the value moves by {size:+.3g} {self._unit} more than its rate accounts for"
            found.append(self._slips.told("slips", self._channel, f"{text}: did the encoder slip?", fault=False))
        size, span = self._spike
        if self._spikes.count and self._own:
            alone = "a sample leaves" if span == 1 else f"{span} samples leave"
            text = f"{alone} a smooth motion by {size:+.3g} {self._unit}, and it comes back: a spike?"
            found.append(self._spikes.told("spikes", self._channel, text, fault=False))
        return found


def unwrapped(times: Floats, values: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """An angle (n,), rad, at times, s, without its wraps, which are whole turns; and their indices."""
    turns = np.zeros(len(values))
    for part, low, high in _chunks(len(values), True, True):
        found, _ = find_jumps(times[part], values[part], True)
        wraps = (found.turns != 0) & (found.at >= low) & (found.at < high)
        turns[found.at[wraps] + part.start] = found.turns[wraps]
    total = np.cumsum(turns)
    return (values - TURN * total if total.any() else values), np.flatnonzero(turns)
