"""Does a coordinate jump where it should move? Encoders that wrap at a turn, and encoders that slip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crossbody.hw.checks.clock import First, Floats, Rows
from crossbody.hw.checks.finding import Finding

TURN = 2.0 * np.pi
CHUNK = 8192  # samples that are judged together, wherever blocks are cut
EDGE = 2  # steps at the beginning and the end that are not judged: there are no neighbours on both sides
REST = 0.3  # rad that a step may differ from its neighbours after whole turns are taken off
ALIKE = 1.0  # rad that its neighbours may differ from one another: a motion, and no noise
OUT = 8.0  # times the neighbours' own differences, and the noise, that a step must stand out
STEPS = 4.0  # of the encoder's grid
COARSEST = TURN / 100.0  # rad: no encoder's grid, where a single step tells nothing about it
NOISE = 0.9  # quantile of the second differences of steps that is taken for their noise
FEWEST = 256  # samples that tell the noise
LATE = 1.5  # times the usual time of a step: there, samples are missing


@dataclass(frozen=True, slots=True, kw_only=True)
class Jumps:
    """Steps of a coordinate that no motion explains.

    Attributes:
        at: index of the sample after each.
        turns: whole turns of each; 0 for a slip.
        size: what the step has too much.
    """

    at: NDArray[np.int64]
    turns: NDArray[np.int64]
    size: Floats


def find_jumps(times: Floats, values: Floats, rotates: bool, noise: float | None = None) -> tuple[Jumps, float]:
    """Find the steps that stand out of their two neighbours on either side.

    A smooth motion's step lies between its neighbours, but for its third difference; so it does where an impact changes
    the velocity. A slip is a single step far outside, and a wrap one that fits when whole turns are taken off.

    Args:
        times (n,): s, finite.
        values (n,): finite.
        rotates: whether the values are angles, rad.
        noise: of the steps; estimated from these if None.

    Returns:
        The jumps, and the noise.
    """
    none = Jumps(at=np.zeros(0, np.int64), turns=np.zeros(0, np.int64), size=np.zeros(0))
    if len(values) < 2 * EDGE + 2:
        return none, noise or 0.0
    steps, clock = np.diff(values), np.diff(times)
    usual = float(np.median(clock))
    # About the place where it wraps, a noisy angle does so several times: neighbours count without their turns.
    plain = np.where(np.abs(steps) > 0.5 * TURN, steps - TURN * np.sign(steps), steps) if rotates else steps
    far, near, folded, next_, last = (plain[i : len(steps) - 2 * EDGE + i] for i in range(2 * EDGE + 1))
    middle = steps[EDGE : len(steps) - EDGE]
    low = np.minimum(np.minimum(far, near), np.minimum(next_, last))
    high = np.maximum(np.maximum(far, near), np.maximum(next_, last))
    second = np.abs(folded - 0.5 * (near + next_))
    if noise is None:
        at = int(NOISE * (len(second) - 1))
        noise = float(np.partition(second, at)[at])
    moved = np.abs(steps[steps != 0.0])
    grid = min(float(moved.min(initial=np.inf)), COARSEST if rotates else np.inf)
    excess = np.where(middle > high, middle - high, np.minimum(middle - low, 0.0))
    out = np.abs(excess) > np.maximum(OUT * np.maximum(high - low, noise), STEPS * grid)
    found = np.flatnonzero(out | (np.abs(middle) > 0.5 * TURN) if rotates else out)
    turns = np.zeros(len(found), np.int64)
    if not len(found):
        return none, noise
    long = np.stack([clock[found + i] for i in range(2 * EDGE + 1)]).max(0) > LATE * usual
    if rotates and usual > 0.0:
        inner = (far + near + next_ + last - low - high)[found] / 2.0  # the median of four
        wanted = inner * clock[found + EDGE] / usual
        whole = np.rint((middle[found] - wanted) / TURN)
        fits = (np.abs(middle[found] - TURN * whole - wanted) < REST) & (np.abs(wanted) < 0.5 * TURN)
        turns = np.where(fits & (np.abs(whole) == 1.0) & ((high - low)[found] < ALIKE), whole, 0.0).astype(np.int64)
    kept = (turns != 0) | (out[found] & ~long)
    found, turns = found[kept], turns[kept]
    size = np.where(turns != 0, TURN * turns, excess[found])
    return Jumps(at=found + EDGE + 1, turns=turns, size=size), noise


class JumpCheck:
    """Wraps and slips of one coordinate, seen block by block.

    Args:
        name: the coordinate's name.
        unit: its SI unit; only angles wrap.
    """

    def __init__(self, name: str, unit: str) -> None:
        self._channel, self._unit = f"coordinates.{name}", unit
        self._parts: list[tuple[Rows, Floats, Floats]] = []
        self._held = 0
        self._noise: float | None = None
        self._wraps, self._slips = First(), First()
        self._size = 0.0

    def see(self, rows: Rows, times: Floats, values: Floats) -> None:
        """Take in the next block."""
        good = np.isfinite(values) & np.isfinite(times)
        self._parts.append((rows[good], times[good], values[good]))
        self._held += int(np.count_nonzero(good))
        if self._held >= 2 * CHUNK:
            self._judge(last=False)

    def _judge(self, last: bool) -> None:
        """Look at whole chunks; what is left, and the neighbours of its first step, wait for more."""
        rows, times, values = (np.concatenate(part) for part in zip(*self._parts, strict=True))
        at, keep = 0, 2 * EDGE + 1
        while len(values) - at >= 2 * CHUNK or (last and len(values) - at > keep):
            stop = at + CHUNK if len(values) - at >= 2 * CHUNK else len(values)
            self._look(rows[at:stop], times[at:stop], values[at:stop])
            at = stop - keep if stop < len(values) else stop
        self._parts = [(rows[at:], times[at:], values[at:])]
        self._held = len(values) - at

    def _look(self, rows: Rows, times: Floats, values: Floats) -> None:
        few = self._noise is not None and len(values) < FEWEST
        with np.errstate(over="ignore", invalid="ignore"):  # what is that large has a check that tells it
            found, self._noise = find_jumps(times, values, self._unit == "rad", self._noise if few else None)
        hit = np.zeros(len(values), np.bool_)
        hit[found.at[found.turns != 0]] = True
        self._wraps.see(hit, rows, times)
        slips = found.at[found.turns == 0]
        if len(slips) and not self._slips.count:
            self._size = float(found.size[found.turns == 0][0])
        hit = np.zeros(len(values), np.bool_)
        hit[slips] = True
        self._slips.see(hit, rows, times)

    def findings(self) -> list[Finding]:
        """What was found; the log must have been seen to its end."""
        if self._parts:
            self._judge(last=True)
        found = []
        if self._wraps.count:
            text = f"the angle wraps at a turn in {self._wraps.count} places; the repair unwrap undoes that."
            found.append(self._wraps.told("wraps", self._channel, text, fault=True))
        if self._slips.count:
            text = f"the value jumps by {self._size:+.3g} {self._unit} out of a smooth motion: did the encoder slip?"
            found.append(self._slips.told("slips", self._channel, text, fault=False))
        return found


def unwrapped(times: Floats, values: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """An angle without its wraps: whole turns taken off, from each of them on.

    Args:
        times (n,): s.
        values (n,): rad.

    Returns:
        The angle, and the indices where it wrapped.
    """
    turns = np.zeros(len(values))
    keep = 2 * EDGE + 1
    for start in range(0, len(values), CHUNK):
        part = slice(max(start - keep, 0), start + CHUNK)
        found, _ = find_jumps(times[part], values[part], True)
        at = found.at[found.turns != 0] + part.start
        turns[at] = found.turns[found.turns != 0]
    total = np.cumsum(turns)
    return (values - TURN * total if total.any() else values), np.flatnonzero(turns)
