"""Does a coordinate jump where it should move? Wraps of encoders, slips, samples that stand alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats

Indices = NDArray[np.int64]

TURN = 2.0 * np.pi
EDGE = 2  # steps at the beginning and the end that are not judged: there are no neighbours on both sides
REST = 0.3  # rad that a step may differ from its neighbours after whole turns are taken off
ALIKE = 1.0  # rad that its neighbours may differ from one another: a motion, and no noise
OUT = 8.0  # times the neighbours' own differences, and the noise, that a step must stand out
STEPS = 4.0  # of the encoder's grid
COARSEST = TURN / 100.0  # rad: no encoder's grid, where a single step tells nothing about it
NOISE = 0.9  # quantile of the second differences of steps that is taken for twice their noise
FEWEST = 32  # of them that tell it of steps over several samples
ENOUGH = 1024  # of them that tell it
LATE = 1.5  # times the usual time of a step: there, samples are missing
SPANS = (2, 4, 8)  # samples that a slow slip may take
BEGUN = 0.1  # of a slow slip: there it begins
LONE = (1, 2)  # samples of a spike


def _none() -> Indices:
    return np.zeros(0, np.int64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Jumps:
    """Steps of a coordinate that no motion explains, in the order of their samples.

    Attributes:
        at: index of the sample after each; the first of a spike.
        turns: whole turns of each; 0 for slips and spikes.
        size: what the step has too much.
        span: samples that it takes; those that stand alone for a spike.
        spike: whether the value comes back.
        fast: indices of the samples after steps longer than half a turn that are none of these.
    """

    at: Indices = field(default_factory=_none)
    turns: Indices = field(default_factory=_none)
    size: Floats = field(default_factory=lambda: np.zeros(0))
    span: Indices = field(default_factory=_none)
    spike: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    fast: Indices = field(default_factory=_none)


def find_jumps(
    times: Floats, values: Floats, rotates: bool, noise: float | None = None, slack: Floats | None = None
) -> tuple[Jumps, float]:
    """Find the steps that stand out of their two neighbours on either side.

    A smooth motion's step lies between its neighbours, but for its third difference; so it does
    where an impact changes the velocity. A slip is a step far outside, of one sample or of some,
    a wrap one that fits when whole turns are taken off, and a spike a sample or two that leave
    the line of those around them. Wherever one is, the second difference of the steps is larger
    than the noise admits: the rest of the samples is not looked at.

    Args:
        times (n,): s, finite.
        values (n,): finite.
        rotates: whether the values are angles, rad.
        noise: of the steps; estimated from these if None.
        slack (n,): what a step up to each sample may have too much all the same; nothing if None.

    Returns:
        The jumps, and the noise.
    """
    if len(values) < 2 * EDGE + 2:
        return Jumps(), noise or 0.0
    steps = values[1:] - values[:-1]
    bent = _bent(steps)
    noise = _noise(bent) if noise is None else noise
    slow = _slowly(values)
    folds = rotates and (float(steps.max()) > 0.5 * TURN or float(steps.min()) < -0.5 * TURN)
    if not folds and not len(slow) and not float(bent.max()) > 2.0 * OUT * noise:
        return Jumps(), noise
    looked = bent > 2.0 * OUT * noise
    if folds:
        looked |= np.abs(steps[1:-1]) > 0.5 * TURN
    return _Suspects(times, values, steps, rotates, noise, slack).judged(np.flatnonzero(looked) + 1, slow), noise


def _bent(steps: Floats) -> Floats:
    """Size of the second differences of steps."""
    bends = steps[1:] - steps[:-1]
    return np.abs(bends[1:] - bends[:-1])


def _noise(bent: Floats) -> float:
    """What steps scatter by: half of what few second differences exceed."""
    some = bent[:: max(len(bent) // ENOUGH, 1)]
    at = int(NOISE * (len(some) - 1))
    return 0.5 * float(np.partition(some, at)[at])


def _slowly(values: Floats) -> Indices:
    """Samples about which the steps over eight of them stand out: a slow slip bends little from one to the next."""
    wide = SPANS[-1]
    bent = _bent(np.diff(values[::wide]))
    if len(bent) < FEWEST or not float(bent.max()) > (least := 2.0 * OUT * _noise(bent)):
        return np.zeros(0, np.int64)
    return (wide * np.flatnonzero(bent > least)[:, None] + np.arange(3 * wide)).ravel()


class _Suspects:
    """A chunk of samples, some of which are looked at."""

    def __init__(
        self, times: Floats, values: Floats, steps: Floats, rotates: bool, noise: float, slack: Floats | None
    ) -> None:
        self._times, self._values, self._steps, self._rotates = times, values, steps, rotates
        self._noise, self._slack = noise, slack
        moved = np.abs(steps[steps != 0.0])
        self._grid = min(float(moved.min(initial=np.inf)), COARSEST if rotates else np.inf)
        self._usual = float(np.median(np.diff(times)))

    def judged(self, at: Indices, slow: Indices) -> Jumps:
        """Wraps and slips of one sample first: others are judged without them."""
        inside = at[(at >= EDGE) & (at < len(self._steps) - EDGE)]
        once = self._single(inside)
        if len(once.at):
            taken = np.zeros(len(self._values))
            np.add.at(taken, once.at, once.size)
            self._values = self._values - np.cumsum(taken)
        parts = [once, *self._spikes(at), *self._slow(np.append(at, slow))]
        order = np.argsort(np.concatenate([part.at for part in parts]), kind="stable")
        at, turns, size, span, spike = (
            np.concatenate([getattr(part, name) for part in parts])[order]
            for name in ("at", "turns", "size", "span", "spike")
        )
        return Jumps(at=at, turns=turns, size=size, span=span, spike=spike, fast=once.fast)

    def _least(self, spread: Floats) -> Floats:
        """By how much a step must stand out of neighbours that differ so much."""
        return np.maximum(OUT * np.maximum(spread, self._noise), STEPS * self._grid)

    def _late(self, first: Indices, last: Indices) -> NDArray[np.bool_]:
        """Whether samples are missing between two samples."""
        return self._times[last] - self._times[first] > (last - first + LATE - 1.0) * self._usual

    def _free(self, before: Indices, after: Indices) -> Floats | float:
        """What may be too much between two samples."""
        return 0.0 if self._slack is None else np.maximum(self._slack[before], self._slack[after])

    def _single(self, at: Indices) -> Jumps:
        """Wraps and slips among steps."""
        steps, middle = self._steps[at[:, None] + np.arange(-EDGE, EDGE + 1)], self._steps[at]
        # About the place where it wraps, a noisy angle does so several times: neighbours count without their turns.
        plain = np.where(np.abs(steps) > 0.5 * TURN, steps - TURN * np.sign(steps), steps) if self._rotates else steps
        around = np.sort(np.delete(plain, EDGE, axis=1), axis=1)
        low, high = around[:, 0], around[:, -1]
        excess = np.where(middle > high, middle - high, np.minimum(middle - low, 0.0))
        out = np.abs(excess) > self._least(high - low) + self._free(at, at + 1)
        turns = np.zeros(len(at), np.int64)
        if self._rotates and self._usual > 0.0:
            wanted = around[:, 1:3].mean(axis=1) * (self._times[at + 1] - self._times[at]) / self._usual
            whole = np.rint((middle - wanted) / TURN)
            fits = (np.abs(middle - TURN * whole - wanted) < REST) & (np.abs(wanted) < 0.5 * TURN)
            turns = np.where(fits & (np.abs(whole) == 1.0) & (high - low < ALIKE), whole, 0.0).astype(np.int64)
        kept = (turns != 0) | (out & ~self._late(at - EDGE, at + EDGE + 1))
        size = np.where(turns != 0, TURN * turns, excess)[kept]
        fast = at[~kept & (np.abs(middle) > 0.5 * TURN)] + 1 if self._rotates else _none()
        ones = np.ones(len(size), np.int64)
        return Jumps(at=at[kept] + 1, turns=turns[kept], size=size, span=ones, spike=ones == 0, fast=fast)

    def _spikes(self, at: Indices) -> Iterator[Jumps]:
        """A sample or two off the line between those before and after; two steps beside it must be alike."""
        x = self._values
        for span in LONE:
            first = _near(at, 1, len(x), EDGE + 1, EDGE + span)
            before, after = first - 1, first + span
            slope = (x[after] - x[before]) / (span + 1)
            around = np.stack([slope, *(x[before - i] - x[before - i - 1] for i in range(EDGE)),
                               *(x[after + i + 1] - x[after + i] for i in range(EDGE))])  # fmt: skip
            away = np.stack([x[first + i] - x[before] - (i + 1) * slope for i in range(span)])
            size = np.abs(away).min(axis=0)
            hit = size > self._least(around.max(axis=0) - around.min(axis=0)) + self._free(before, after)
            hit &= (np.abs(away.sum(axis=0)) >= span * size) & ~self._late(before - EDGE, after + EDGE)
            spans = np.full(np.count_nonzero(hit), span)
            yield Jumps(at=first[hit], turns=0 * spans, size=away[0, hit], span=spans, spike=spans > 0)

    def _slow(self, at: Indices) -> Iterator[Jumps]:
        """Slips of some samples: as those of one, with steps of so many."""
        x, taken = self._values, np.zeros(len(self._values), np.bool_)
        for span in SPANS:
            start = _near(at, span, len(x), EDGE * span, (EDGE + 1) * span)
            far, near, middle, next_, last = (
                x[start + (i + 1) * span] - x[start + i * span] for i in range(-EDGE, EDGE + 1)
            )
            low = np.minimum(np.minimum(far, near), np.minimum(next_, last))
            high = np.maximum(np.maximum(far, near), np.maximum(next_, last))
            excess = np.where(middle > high, middle - high, np.minimum(middle - low, 0.0))
            end = start + span
            hit = (np.abs(excess) > self._least(high - low) + self._free(start, end)) & ~taken[start] & ~taken[end]
            hit &= ~self._late(start - EDGE * span, end + EDGE * span)
            hits = np.flatnonzero(hit)
            for group in np.split(hits, np.flatnonzero(np.diff(start[hits]) > span) + 1) if len(hits) else ():
                best = group[np.argmax(np.abs(excess[group]))]
                yield self._begun(int(start[best]), span, float(excess[best]), 0.5 * float(near[best] + next_[best]))
                taken[max(int(start[best]) - EDGE * SPANS[-1], 0) : int(end[best]) + EDGE * SPANS[-1]] = True

    def _begun(self, start: int, span: int, size: float, along: float) -> Jumps:
        """A slow slip from its first sample on."""
        inside = np.arange(1, span + 1)
        away = self._values[start + inside] - self._values[start] - along * inside / span
        first = start + 1 + int(np.argmax(np.abs(away) > BEGUN * abs(size)))
        at, none = np.array([first]), np.zeros(1, np.int64)
        return Jumps(at=at, turns=none, size=np.array([size]), span=none + span, spike=none > 0)


def _near(at: Indices, reach: int, length: int, before: int, after: int) -> Indices:
    """Samples up to so many before one of those, with so many samples on either side of them."""
    there = np.zeros(length, np.bool_)
    for i in range(-1, reach + 1):
        there[np.clip(at - i, 0, length - 1)] = True
    there[:before], there[max(length - after, 0) :] = False, False
    return np.flatnonzero(there)
