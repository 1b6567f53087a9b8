"""The record of a maze's run: where the ball was, beside what every run keeps."""

from __future__ import annotations

from typing import Any

from crossbody.cases.arrays import Floats
from crossbody.engines._log import Log
from crossbody.engines._maze.machine import Settled
from crossbody.engines._maze.memory import Memory
from crossbody.engines._maze.rows import Place


class MazeLog(Log):
    """Entries as in `Log`; gaps are evaluated afterwards, from the places.

    Attributes:
        places: of the ball at every entry.
    """

    def __init__(self) -> None:
        super().__init__()
        self.places: list[Place] = []

    def note(self, t: float, q: Floats, v: Floats, lam: Any, memory: Memory) -> None:
        """Append one instant; q, v and lam are kept, not copied."""
        self.add(t, q, v, lam, memory.modes)
        self.places.append(memory.place)

    def pass_to(self, settled: Settled) -> None:
        """Append what the machine switched."""
        self.events += settled.events
        self.switches += settled.switches
