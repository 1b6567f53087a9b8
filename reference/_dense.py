"""The motion between the steps of a run: from marks at the ends of steps the loop itself goes on to any instant.

What the loop needs to go on is its workspace. A mark is a copy of it, and what a step from there
writes down as a sample is the integrator's own dense output, moved onto the rows where the step
is long for them. So nothing of the method is written again here, and memory is bounded: where
marks take more than `ROOM`, every second one is dropped, and the steps between two marks are
taken again when an instant between them is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crossbody.cases import InvalidValue
from crossbody.cases.arguments import shown
from crossbody.cases.arrays import numbers
from crossbody.reference.core import layout
from crossbody.reference.core.bundles import table
from crossbody.reference.kinds import Floats

if TYPE_CHECKING:
    from crossbody.reference._run import CompiledRun

ROOM = 64_000_000  # bytes of all marks of a run
SIDES = ("right", "left")
_SCRATCH = ("window",)  # arrays of the workspace that no step hands to the next


class Marks:
    """Copies of what a run needs to go on, the last one at each instant.

    Args:
        run: the run, wherever it stands.
        room: bytes that they may take; where a controller in Python gives inputs every step has
            its mark all the same, since no step with a tick can be taken again.

    Attributes:
        times: instants of the marks, s.
        every: steps from one mark to the next, at most.
    """

    def __init__(self, run: CompiledRun, room: float) -> None:
        work = [array for name, array in run.work.items() if name not in _SCRATCH]
        arrays = [run.state, run.model[0], run.buffers["mode"], run.buffers["history"], *work]
        self.run, self._views = run, [array.reshape(-1).view(np.uint8) for array in arrays]
        self._most = np.inf if run.callback is not None else room / sum(map(len, self._views))
        self.times: list[float] = []
        self._kept: list[NDArray[np.uint8]] = []
        self.every = 1

    def put(self) -> int:
        """Mark where the run stands; how many steps it may take to the next mark, 0 if it has not begun."""
        state = self.run.state[0]
        if not state["started"] or state["unsettled"]:
            return self.every if state["started"] else 0
        if self.times and self.times[-1] == state["t"]:
            self.times.pop(), self._kept.pop()
        self.times.append(float(state["t"]))
        self._kept.append(np.concatenate(self._views))
        if len(self.times) > self._most:
            self.times, self._kept, self.every = self.times[::2], self._kept[::2], 2 * self.every
        return self.every

    def restore(self, place: int, into: Marks) -> None:
        """Have another run of the same kind stand where this one stood at a mark."""
        at = 0
        for view in into._views:
            view[:] = self._kept[place][at : at + len(view)]
            at += len(view)


class Motion:
    """The positions and velocities of a run at any instant of it; see `crossbody.cases.Trajectory.sol`.

    Args:
        marks: of the run, which has come to its end.
        player: a run of the same system, start and options, to be used here alone.
        given (nq + n,): the start as it was handed over.

    Attributes:
        t_min, t_max: the run's first and last instant, s.
    """

    def __init__(self, marks: Marks, player: CompiledRun, given: Floats) -> None:
        self._marks, self._player, self._given = marks, player, given
        self._here, self._near = Marks(player, np.inf), (-1, marks)
        self.t_min, self.t_max = 0.0, float(marks.run.state[0]["t"])

    def __call__(self, t: ArrayLike, side: Literal["right", "left"] = "right") -> tuple[Floats, Floats]:
        """Return q (..., nq) and v (..., n) at instants t (...), s, in any order.

        Args:
            t: within [t_min, t_max].
            side: which limit where an event falls on an instant, "right" behind it, "left" before
                it. They differ in v alone, and only where a collision takes no time or a switch
                makes v jump; at t = 0 "left" is the start as it was given.

        Raises:
            InvalidValue: for an instant outside the run, or another word.
        """
        if side not in SIDES:
            raise InvalidValue(f"side is {shown(side)}; valid: {' or '.join(map(repr, SIDES))}.")
        given = numbers("sol", "t", t)
        times = given.ravel()
        outside = ~((times >= self.t_min) & (times <= self.t_max))  # NaN is outside
        if outside.any():
            first = float(times[outside][0])
            raise InvalidValue(f"sol: t = {first:.12g} s is outside the run, [{self.t_min:g}, {self.t_max:.12g}] s.")
        order = np.argsort(times, kind="stable")
        y = np.empty((len(times), len(self._given)))
        y[order] = self._at(times[order], side)
        q, v = np.split(y.reshape(*given.shape, y.shape[1]), [self._player.system.nq], axis=-1)
        return self._player.system.normalised("sol", q), v

    def _at(self, times: Floats, side: Literal["right", "left"]) -> Floats:
        """Return (q, v) at instants in their order, mark by mark."""
        y = np.tile(self._given, (len(times), 1))
        for place, which in _groups(self._marks.times, times, side):
            near = self._steps(place)
            for step, some in _groups(near.times, times[which], side):
                y[which][some] = self._within(near, step, times[which][some])
        return y

    def _steps(self, place: int) -> Marks:
        """Return marks of all steps from one mark to the next; those that were asked for last are there still."""
        ends = [*self._marks.times[place + 1 :][:1], self.t_max]
        if self._marks.every == 1 or ends[0] <= self._marks.times[place]:
            return self._marks
        if self._near[0] != place:
            run, near, code = self._player, Marks(self._player, np.inf), layout.MORE
            self._restore(self._marks, place)
            while code > layout.DONE and run.state[0]["t"] < ends[0]:
                near.put()
                run.state["rows"] = 0
                code = run.slice(1)
                run._grow(code)
            self._near = place, near
        return self._near[1]

    def _restore(self, marks: Marks, place: int) -> None:
        marks.restore(place, self._here)
        self._player.state["keep_events"] = 0
        if self._marks.run.callback is not None:  # it is not asked again
            self._player.work["s"][0] = 0.0

    def _within(self, marks: Marks, place: int, times: Floats) -> Floats:
        """Return (q, v) at instants of the step behind a mark, in their order."""
        self._restore(marks, place)
        y = np.tile(self._player.work["y"], (len(times), 1))
        later = times > marks.times[place]
        if later.any():
            y[later] = self._sampled(times[later])
        return y

    def _sampled(self, times: Floats) -> Floats:
        """Take a step from where the player stands, and return what it writes down of it."""
        run, ny = self._player, len(self._given)
        out, modes = run.buffers["out"], run.buffers["modes"]
        own = {"samples": np.array(times), "out": np.zeros((len(times), out.shape[1]))}
        own["modes"] = np.zeros((len(times), modes.shape[1]), np.int8)
        run.tables[2] = table([*(run.buffers | own).values()])
        for name in ("natural", "next_sample", "rows"):
            run.state[name] = 0
        run.slice(1)
        run.tables[2] = table([*run.buffers.values()])
        return own["out"][:, 1 : 1 + ny]

    def __reduce__(self) -> Any:
        """Refuse to be pickled: it goes on from the memory of its process."""
        raise TypeError("sol of a dense run lives in its process; pickle replace(run, sol=None) and samples of it.")


def _groups(marks: Sequence[float], times: Floats, side: Literal["right", "left"]) -> Iterator[tuple[int, slice]]:
    """Yield the mark that each instant is behind, and which instants are behind it; none for those before the first."""
    places = np.searchsorted(marks, times, side) - 1
    found, first = np.unique(places, return_index=True)
    for place, begin, end in zip(found.tolist(), first.tolist(), [*first.tolist(), len(times)][1:], strict=True):
        if place >= 0:
            yield place, slice(begin, end)
