"""What faults of known size are made of: a motion, where they can be put, and what must be seen of each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Mode, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.measuring.truth import taken

PART = 0.02
"""Part of the largest by which a signal is off: no limit on a motion may be as wide."""

TENTH, MUCH = 0.1, 0.25
"""Likewise, of velocities and angles, and of multipliers, which robots with servos hold less tightly."""

SLACK, ROUGH = 1e-3, 3.0
"""Part, and factor, by which a number may differ from what follows: by rounding, and by where samples stand."""

QUIET = 1e-5
"""Part of the horizon within which samples are at an event, and say nothing but of it."""

SEED, DRAWN, QUARTERS = 20261127, 2, 4
"""Of all draws, how many coordinates and rows are drawn for one kind of fault, and into what samples are parted."""

LOOKED, FEW = 400, 40
"""Samples that identities look at, at most: a fault covers their neighbours; and samples for what takes long."""

RESTS, TINY = 1e-4, 1e-6
"""Sizes, SI, and part of an energy, below which a motion is not what its errors are measured by."""

FAR = 0.01
"""Part of its largest beyond which what brings an event about is far from zero."""

PUSHES = (Mode.CONTACT, Mode.COLLISION, Mode.STICK, Mode.SLIP)

Range = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """A motion with one known fault.

    Attributes:
        fault: what was done, in words.
        run: the motion.
        sees: metric -> least and most of its size, in its unit.
        plain: the same motion without the fault, where that is not the whole one.
        wrong: whether what it sees must be outside; else it is no fault, and the number alone must be right.
    """

    fault: str
    run: Trajectory
    sees: Mapping[str, Range]
    plain: Trajectory | None = None
    wrong: bool = True


def exactly(size: float) -> Range:
    """Return the range around a size that follows."""
    return (1.0 - SLACK) * size, (1.0 + SLACK) * size


def roughly(size: float) -> Range:
    """Return the range around a size that samples blur."""
    return size / ROUGH, size * ROUGH


@dataclass
class Plain:
    """A motion without a fault, and where faults can be put.

    Attributes:
        case: what moved.
        run: the motion.
        quiet: samples at which nothing happens.
        normal: rows that open.
        turning: coordinates that are parts of quaternions.
    """

    case: Case
    run: Trajectory
    quiet: NDArray[np.intp] = field(init=False)
    normal: NDArray[np.intp] = field(init=False)
    turning: frozenset[int] = field(init=False)
    draw: np.random.Generator = field(init=False)

    def __post_init__(self) -> None:
        """Look where nothing happens."""
        run = self.run
        self.draw = np.random.default_rng(SEED)
        happens = np.sort([*(e.t for e in run.events), *(s.t for s in run.switches), run.t[0], run.t[-1]])
        behind = np.searchsorted(happens, run.t)
        around = np.stack([np.maximum(behind - 1, 0), np.minimum(behind, len(happens) - 1)])
        nearest = np.min(np.abs(run.t - happens[around]), axis=0)
        self.quiet = np.flatnonzero(nearest > QUIET * self.case.t_end)
        self.normal = np.flatnonzero(self.case.law.touches)
        self.turning = frozenset(i + k for i in self.case.quaternions for k in range(4))

    def few(self) -> Trajectory:
        """Return the motion at few quiet samples, far apart; at none where there are none."""
        return taken(self.run, self.quiet[:: max(1, -(-len(self.quiet) // FEW))])

    def samples(self, among: NDArray[np.bool_] | None = None) -> list[int]:
        """Draw quiet samples of those that are asked for: one early and one late, in any order."""
        kept = self.quiet if among is None else self.quiet[among[self.quiet]]
        few = -(-len(kept) // QUARTERS)
        ends = [kept[:few], kept[-few:]] if len(kept) > few else [kept]
        return [int(self.draw.choice(ends[k])) for k in self.draw.permutation(len(ends)) if few]

    def both(self) -> Iterator[tuple[int, float]]:
        """Yield an early and a late sample, and a sign for each: what is too small is as wrong as what is too large."""
        yield from zip(sorted(self.samples()), self.draw.permutation([1.0, -1.0]).tolist(), strict=False)

    def some(self, of: Sequence[int] | NDArray[np.intp]) -> list[int]:
        """Draw a few of some numbers."""
        return [int(k) for k in self.draw.permutation(np.array(of, dtype=int))[:DRAWN]]

    def off(self, name: str, at: tuple[int | slice, int], by: float | Floats) -> Trajectory:
        """Return the motion with one signal off at some places."""
        return with_signal(self.run, name, at, getattr(self.run, name)[at] + by)


def with_signal(run: Trajectory, name: str, at: tuple[int | slice, int | slice], value: float | Floats) -> Trajectory:
    """Return a motion in which one signal has a value at some places."""
    values = np.array(getattr(run, name))
    values[at] = value
    return replace(run, **{name: values})  # type: ignore[arg-type]
