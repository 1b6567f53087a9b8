"""A motion at any instants, integrated once for all instants that are asked for together."""

from __future__ import annotations

from collections.abc import Callable, Iterable
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
        """Return the motion at instants: some of those of an answer that is kept, else integrated anew."""
        for known in reversed(self._kept):
            if (places := _places(known.t, times)) is not None:
                return known if len(places) == len(known.t) else _taken(known, places)
        return self._keep(self._integrate(times))

    def expect(self, asked: Iterable[Floats]) -> None:
        """Integrate at once for what will be asked for, unless there is no room for it.

        Args:
            asked: instants of several questions (n,), each nondecreasing.
        """
        new = [times for times in asked if not any(_places(known.t, times) is not None for known in self._kept)]
        if len(new) < 2:
            return
        once = distinct(*new)
        twice = distinct(*(times[1:][times[1:] == times[:-1]] for times in new))
        times = np.sort(np.concatenate([once, twice]))
        rows = self._kept[-1].lam.shape[1] if self._kept else 1
        if 8 * rows * len(times) <= ROOM:
            self._keep(self._integrate(times))

    def _keep(self, answer: Trajectory) -> Trajectory:
        while self._kept and sum(run.lam.nbytes for run in (*self._kept, answer)) > ROOM:
            del self._kept[0]
        self._kept.append(answer)
        return answer


def _places(known: Floats, times: Floats) -> NDArray[np.intp] | None:
    """Return where instants stand among others, one asked again behind itself; None if one is not there."""
    again = np.zeros(len(times), dtype=np.intp)
    again[1:] = times[1:] == times[:-1]
    places = np.searchsorted(known, times, side="left") + again
    inside = len(times) > 0 and places.max() < len(known)
    return places if inside and (known[places] == times).all() else None


def _taken(run: Trajectory, places: NDArray[np.intp]) -> Trajectory:
    """Return some samples of a motion."""
    rows: dict[str, Any] = {name: getattr(run, name)[places] for name in _SAMPLED}
    if run.ledger is not None:
        rows["ledger"] = Ledger(**{one.name: getattr(run.ledger, one.name)[places] for one in fields(Ledger)})
    return replace(run, **rows)
