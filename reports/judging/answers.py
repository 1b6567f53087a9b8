"""A motion at any instants, integrated once for all instants that are asked for together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Ledger, Trajectory
from crossbody.cases.arrays import Floats, distinct

ROOM = 64 << 20  # multipliers of the answers that are kept, bytes: about a third of what they take
_SAMPLED = ("t", "q", "v", "gap", "lam", "energy", "mode")


class Answers:
    """The truth at instants: every metric asks for it at those of a run, and parts of an error at those of five.

    Args:
        integrate: the motion at nondecreasing instants; one asked for twice is told from both
            sides of an event.
    """

    def __init__(self, integrate: Callable[[Floats], Trajectory]) -> None:
        self._integrate = integrate
        self._kept: list[Trajectory] = []

    def __call__(self, times: Floats) -> Trajectory:
        """Return the motion at instants: what answers that are kept know of it, the latest first, else integrated."""
        if not len(times):
            return self._integrate(times)
        known, found = list(self._kept), self._looked_for(times)
        if (missing := found.missing()).any():
            if not self._fits(int(missing.sum()), beside=sum(run.lam.nbytes for run in known)):
                missing[:] = True  # what is known would be lost, and be missing next time
            known.append(self._keep(self._integrate(times[missing])))
            found.answer[missing] = -1
            found.look(len(known) - 1, known[-1].t)
        return found.taken(known)

    def expect(self, asked: Iterable[Floats]) -> None:
        """Integrate at once for what will be asked for, unless there is no room for it.

        Args:
            asked: instants of several questions (n,), each nondecreasing.
        """
        new = [times[missing] for times in asked if (missing := self._looked_for(times).missing()).any()]
        if len(new) < 2:
            return
        once = distinct(*new)
        twice = distinct(*(times[1:][times[1:] == times[:-1]] for times in new))
        times = np.sort(np.concatenate([once, twice]))
        if self._fits(len(times)):
            self._keep(self._integrate(times))

    def _fits(self, count: int, beside: int = 0) -> bool:
        """Return whether there is room for so many instants, beside so many bytes."""
        rows = self._kept[-1].lam.shape[1] if self._kept else 1
        return 8 * rows * count + beside <= ROOM

    def _looked_for(self, times: Floats) -> _Found:
        """Return where instants stand in the answers that are kept, the latest first."""
        found = _Found(times)
        for number in reversed(range(len(self._kept))):
            found.look(number, self._kept[number].t)
        return found

    def _keep(self, answer: Trajectory) -> Trajectory:
        while self._kept and sum(run.lam.nbytes for run in (*self._kept, answer)) > ROOM:
            del self._kept[0]
        self._kept.append(answer)
        return answer


class _Found:
    """Where instants stand in answers.

    Args:
        times (n,): nondecreasing; one asked for twice is told from both sides.

    Attributes:
        answer (n,): the number of the answer that has it, -1 if none has.
        place (n,): where in that.
    """

    def __init__(self, times: Floats) -> None:
        self.times, self.again = times, np.zeros(len(times), dtype=bool)
        self.again[1:] = times[1:] == times[:-1]
        self.answer, self.place = np.full(len(times), -1), np.zeros(len(times), dtype=np.intp)

    def look(self, number: int, known: Floats) -> None:
        """Look for what is missing in an answer of that number, at the instants `known`."""
        if not (self.answer < 0).any() or not len(known):
            return
        place = np.searchsorted(known, self.times, side="left") + self.again
        has = (known[np.minimum(place, len(known) - 1)] == self.times) & (place < len(known)) & (self.answer < 0)
        self.answer[has], self.place[has] = number, place[has]

    def missing(self) -> NDArray[np.bool_]:
        """Return which (n,) no answer has; both sides of an instant are of one answer."""
        second = np.flatnonzero(self.again)
        self.answer[second - 1], self.place[second - 1] = self.answer[second], self.place[second] - 1
        return self.answer < 0

    def taken(self, known: Sequence[Trajectory]) -> Trajectory:
        """Return the motion at all instants that it gets to; at the last answer's where it gets to none."""
        used = distinct(self.answer[self.answer >= 0]) if (self.answer >= 0).any() else [len(known) - 1]
        if len(used) == 1:
            run, places = known[used[0]], self.place[self.answer == used[0]]
            return run if len(places) in (0, len(run.t)) else _taken(run, places)
        parts = [_taken(known[i], self.place[self.answer == i]) for i in used]
        order = np.argsort(np.concatenate([np.flatnonzero(self.answer == i) for i in used]))
        return _taken(_joined(parts), order)


def _joined(parts: Sequence[Trajectory]) -> Trajectory:
    """Return samples of one motion one behind the other."""
    rows: dict[str, Any] = {name: np.concatenate([getattr(run, name) for run in parts]) for name in _SAMPLED}
    if booked := [run.ledger for run in parts if run.ledger is not None]:
        accounts = {one.name: np.concatenate([getattr(each, one.name) for each in booked]) for one in fields(Ledger)}
        rows["ledger"] = Ledger(**accounts)
    return replace(parts[-1], **rows)


def _taken(run: Trajectory, places: NDArray[np.intp]) -> Trajectory:
    """Return some samples of a motion."""
    rows: dict[str, Any] = {name: getattr(run, name)[places] for name in _SAMPLED}
    if run.ledger is not None:
        rows["ledger"] = Ledger(**{one.name: getattr(run.ledger, one.name)[places] for one in fields(Ledger)})
    return replace(run, **rows)
